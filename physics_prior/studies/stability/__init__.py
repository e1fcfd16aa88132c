"""The hard cases on which engines break, each a measurement with a bound; one file a family of cases.

``registry.CASES`` lists them, ``suite`` runs them, ``physics-prior stability`` shows them.
"""

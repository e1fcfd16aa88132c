"""The benchmark mechanisms of multibody dynamics as code: what the studies of stability and accuracy run on.

Each file is one mechanism, in the coordinates of its source; parameters are those of the published benchmark.
"""

"""What `physics-prior` does, one file a subcommand.

Every one has a docstring, which is its --help; ``add_arguments(parser)``; and ``run(args)``, which returns the exit code.
Nothing heavy is imported before ``run``, so that --help comes at once.
"""

"""Where the body is, how surely, and with which forces: the state on the manifold and its filter."""

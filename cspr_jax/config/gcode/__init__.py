"""G-code: words, arcs, and the paths of a file."""

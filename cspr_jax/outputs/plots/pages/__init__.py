"""Pages to explore results and plans in a browser: one file each, without a network."""

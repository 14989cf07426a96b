"""Tables of the source texts, computed beside the printed ones."""

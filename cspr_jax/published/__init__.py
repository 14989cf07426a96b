"""Tables of the source texts: computed cells beside the printed ones."""

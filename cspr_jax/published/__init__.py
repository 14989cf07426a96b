"""Tables of the source texts, computed and beside what is printed."""

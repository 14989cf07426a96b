"""Words, colours, panels and sizes that all pictures share."""

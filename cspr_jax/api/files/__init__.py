"""Files, lists, pictures and pages from Python."""

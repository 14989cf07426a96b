"""Reading of files of unknown origin, in a process of its own and with checks."""

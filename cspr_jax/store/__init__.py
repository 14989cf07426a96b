"""Files of a run: how they reach the disk, what each holds, and how each is checked."""

"""Small vectors: lanes, rotations, axes of files, and several numbers packed into one."""

"""Small vectors: lanes, rotations, axes of files, and several numbers in one array."""

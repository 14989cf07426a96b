"""Robot files of other programs, read as robot files of this one."""

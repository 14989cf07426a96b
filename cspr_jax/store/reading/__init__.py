"""Reading of files that anybody may have made: by a process of its own, checked."""

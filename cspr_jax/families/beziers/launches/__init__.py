"""Launches by Bezier segments: the release, the choice among them, and maps of what can be hit.

Files, each importing only from those above it:

    through_release    the segment through a release
    launches           launches to a target, with all that is left open chosen
    release_bounds     bounds within which a release is looked for
    launch_range       releases for many landing places
    launch_range_map   maps of launches
"""

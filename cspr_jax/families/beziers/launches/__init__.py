"""Launches by Bezier segments: the release, the choice among them, and maps of what can be hit.

Files, each importing only from those above it:

    release            the segment through a release, and bounds within which one is searched for
    launches           launches to a target, with a choice of what they leave open
    launch_range       releases for many landing points
    launch_range_map   maps of launches
"""

"""Launches from Bezier segments: the release, the choice of what a launch leaves open, and maps of landing points.

Files, each importing only from those above it:

    release            the segment through a release, and bounds of the search for a release
    launches           launches to a target, with a choice of what is left open
    launch_range       releases for many landing points
    launch_range_map   maps of launches
"""

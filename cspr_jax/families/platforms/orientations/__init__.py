"""Orientations of a platform at positions, thesis section 3.10: accessible, attainable, and maps.

Files, each importing only from those above it:

    orientation_steps   cables at poses at rest, and between neighbouring ones
    accessible          accessible orientations, section 3.10.2
    attainable          orientations that a transition from rest attains, section 3.12.3
    poses_map           maps of the arcs to poses
    orientations_map    maps of the orientations at positions, and of the arcs to each
"""

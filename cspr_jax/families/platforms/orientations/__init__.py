"""Orientations of a platform at places, thesis section 3.10: accessible, attainable, and maps.

Files, each importing only from those above it:

    orientation_steps   cables at still poses, and between neighbouring ones
    accessible          accessible orientations, section 3.10.2
    attainable          orientations that a transition from rest attains, section 3.12.3
    poses_map           maps of poses
    places_map          maps of orientations that places allow
    orientations_map    maps of all orientations of places
"""

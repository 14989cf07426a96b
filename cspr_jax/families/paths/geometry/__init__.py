"""Geometry of paths: elements, corners, sections, and what a table of a plan says of them.

Files, each importing only from those above it:

    section          sections, from nodes of Hermite pieces and orientations
    elements         straight lines and arcs; arcs of plans, moves of G-code
    corners          consecutive elements, from stop to stop, with blends
    through_points   polylines and splines through points
    path_specs       what a table of a plan says, between its poses
    waypoints        motions of any kind, and their smooth parts between stops
"""

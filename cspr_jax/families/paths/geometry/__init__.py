"""Geometry of paths: elements, corners, sections, and paths that a table of a plan describes.

Files, each importing only from those above it:

    section          sections, from nodes of Hermite pieces and from orientations
    elements         straight lines and arcs, of plans and of G-code
    corners          consecutive elements from stop to stop, with blends
    through_points   polylines and splines through points
    path_specs       paths between poses that a table of a plan describes
    waypoints        motions of any kind, and their smooth parts between stops
"""

"""Paths that a motion runs along in the least time that the robot allows.

A path is a curve over a coordinate s, about its travelled length, with a stop at each corner that is not blended. Its
sections, from stop to stop, are quintic Hermite pieces, continuous with their first derivative; so are the orientations
along them, as quaternions that are normalised afterwards.

Files, each importing only from those above it:

    section             sections, from nodes of Hermite pieces and orientations
    elements            straight lines and arcs
    corners             elements one behind another, from stop to stop, with blends
    through_points      polylines and splines through points
    shapes              arcs of plans, moves of G-code
    courses             what a table of a plan says, between its poses
    least_time          the fastest motion along a section
    leg                 poses joined along paths, as a leg of plans
"""

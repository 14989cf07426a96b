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
    rows                half-planes of path acceleration and squared path speed
    nodes               nodes of sections, and half-planes at both sides of them
    controllable        path speeds from which the end can be reached; the fastest motion on a grid
    interior_point      convex objectives under many linear constraints
    smooth              the fastest motion whose accelerations do not jump
    multipliers         multipliers for the lower bound
    discrete            a section on its grid, with margins
    duality             lower bound of the least time, by intervals
    bound               the same from a section on its grid
    timed               motions in time from path speeds
    tightening          what a motion misses between nodes, and what binds it
    jumping             the fastest motions of several sections, whose accelerations jump
    row_names           names of half-planes
    static_tension      tension that keeps a robot from standing still
    refusals            the place that no path speed passes
    least_time          the fastest motion along a section
    many                least times along many paths
    fastest_lines       lines from which searches of free motions begin
    answers             what segments of plans tell of it
    stops               motions of any kind, and their smooth parts between stops
    retraced            their paths as sections
    leg                 poses joined along paths, as a leg of plans
    map                 maps of least durations along paths
"""

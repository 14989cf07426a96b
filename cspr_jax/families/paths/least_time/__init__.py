"""Least time along sections of paths: a grid, its constraints, bounds, proof, and continuous accelerations.

Files, each importing only from those above it:

    constraints        half-planes of path acceleration and squared path speed
    nodes              nodes of sections, and half-planes at both sides of them
    controllable       path speeds from which the end can be reached; the fastest motion on a grid
    interior_point     convex objectives under many linear constraints
    smooth             the fastest motion whose accelerations do not jump
    multipliers        multipliers for the lower bound
    discrete           a section on its grid, with margins
    duality            lower bound of the least time, by intervals
    bound              the same from a section on its grid
    timed              motions in time from path speeds
    tightening         what a motion misses between nodes, and what binds it
    jumping            the fastest motions of several sections, whose accelerations jump
    static_tension     tension that keeps a robot from standing still
    refusals           the point that no path speed passes, and names of half-planes there
    least_time         the fastest motion along a section
"""

"""Least time along sections of paths: a grid, its constraints, bounds, proof, and continuous accelerations.

Files, each importing only from those above it:

    motor_bounds       tensions with which motors keep their limits, near a motion
    constraints        half-planes of path acceleration and squared path speed
    nodes              nodes of sections, and half-planes at both sides of them
    controllable       path speeds from which the end can be reached; the fastest motion on a grid
    interior_point     convex objectives under many linear constraints
    smooth             the fastest motion without jumps of acceleration
    multipliers        multipliers that make the lower bound close
    discrete           a section on its grid, with margins
    duality            lower bound of the least time, by interval arithmetic
    bound              lower bound from a section on its grid
    timed              motions in time from path speeds
    tightening         limits that a motion breaks between nodes, and criteria that bind it
    jumping            the fastest motions of many sections, with jumps of acceleration
    refusals           the point that no path speed can pass, names of half-planes there, and tensions that prevent rest
    least_time         the fastest motion along a section
"""

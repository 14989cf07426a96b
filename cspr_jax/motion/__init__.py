"""Motion: what every trajectory family provides, and what a plan asks of it.

A motion is a pytree that gives its duration and its state at each time (`motion`). Slacks and peaks take any
motion of any robot; answers, legs and waypoints are common to all families. No file of this package names a family.

Files, each importing only from those above it:

    formulas            formulas of motions with rational numbers, for exact decisions and certificates
    motion              the protocol: duration, state, breaks; motions reversed and placed
    ticks               ticks of a clock over consecutive motions
    amplitudes          amplitude functions A(tau), with bounds of their derivatives
    swing_plane         the plane in which an effector swings between two points
    platform_kind       kinds of motions of platforms, static in compiled functions
    limits              which limits are set, the quantities that they bound, and their slacks
    given_limits        limits of a file or a caller, checked
    problem             robot, limits and amplitude function
    slacks              slacks of any motion at one time
    peaks               extremes of tensions, heights, lengths and speeds along a motion
    acceleration_sets   feasible accelerations of a point mass
    cause               a criterion that a motion fails, in numbers
    answers             the record that every family returns
    waypoints           consecutive poses of a plan, as points of the kernels
    leg                 consecutive poses that one family joins, and results other than the motion
"""

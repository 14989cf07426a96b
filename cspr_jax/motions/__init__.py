"""Motions: what every trajectory family provides, and what can be computed of any motion.

A motion is a pytree that gives its duration and the state at each instant (`motion`). Slacks, demands and needs take
any motion of any robot; blocks of time, answers, uncertainty, legs and way-points are what families have in common.
No file here knows a family.

Files, each importing only from those above it:

    motion              the protocol: duration, state, breaks; motions reversed and placed
    amplitudes          amplitude functions A(tau), with bounds of their derivatives
    amplitude_bounds    bounds of amplitude functions over blocks of time
    several             several motions of one family, bounded together
    swing_plane         the plane in which an effector swings between two points
    swing_bounds        bounds of swings about P0 over a block of time
    platform_kind       kinds of motions of platforms, known when a function is compiled
    limits              which limits are set, the quantities that they bound, and their slacks
    given_limits        limits of a file or a caller, checked
    problem             robot, limits and amplitude function
    slacks              slacks of any motion at one instant
    needs               what a motion needs at its worst instants, and what is allowed
    demands             extremes of tensions, heights, lengths and speeds along a motion
    acceleration_sets   feasible accelerations of a point mass
    cause               a criterion that stands between a motion and feasible
    answers             the record that every family returns
    fewest_limits       the limit that alone refuses a motion
    proved_verdicts     verdicts that rest on a proof
    sampled             answers of motions that are only sampled
    criteria            criteria of any motion
    block_slacks        slacks of any motion over blocks of time, from bounds of its states
    block_parts         blocks of several motions, cut where lines leave little undecided
    time_proof          proof of criteria over the whole time of a motion, or of several
    blocks              parts of arcs, halved while they are undecided
    enclosures          bounds of a robot's state over a block of time
    cable_rates         speeds and accelerations of cables over blocks
    uncertainty         verdicts about all robots within an uncertainty
    tolerances          the largest multiple of an uncertainty that a motion tolerates
    uncertain_slacks    slacks of all robots within an uncertainty over blocks of time, from bounds of states
    motion_tolerances   the largest multiple of an uncertainty that a motion with such bounds tolerates
    piece_slacks        slacks of any motion over each of its pieces
    feeds               proof of largest speeds that hold over some pieces of a motion alone
    proved_answers      answers of motions that give bounds of their states
    attained            smallest slacks that proved motions attain, and when
    judged              motions of families that know neither surroundings nor pulleys, judged with both
    stretching          the least uniform stretching of time that is feasible
    proved              summaries of proofs of motions
    waypoints           consecutive poses of a plan, as points of the kernels
    outcome             what comes of a leg beyond its motion
    flight              free flight of a released object
    parabola            flight that a [launch] table asks for
    landings            scatter of the landings of launches
    launch_outcome      release and flight of a launch, in the axes of the robot file
    leg                 consecutive poses that one family joins
"""

"""Free motions: motions between poses along any path that are the fastest, or best by another objective.

Between poses a motion is a quintic B-spline of normalised time, with four continuous derivatives, so that tensions and
their rates are continuous. Its control points, its duration and the accelerations at the poses are found by an
interior-point method on the limits at many samples, from several starts. The proof for any motion then says where
limits are broken between samples; there they are tightened, and the search goes on. For all robots within an
uncertainty, limits are tightened by the slack that these robots lose. The orientation is a Rodrigues vector relative to
an orientation midway; the result is a spline of quaternions, as all other motions are.

Files, each importing only from those above it:

    search         the interior-point search
    poses          tasks from poses, and motions from the results of a search
    closed_forms   motions of other families, from which searches also start
    problem        poses, limits and objective of a search, and how bounds tighten
    static_poses   poses that no motion can have
    contacts       planes that separate bodies where a motion brings them too near
    robust         bounds that leave slack for all robots within an uncertainty
    proofs         motions tightened until they are proved, for the planned robot or for all
    free_motion    the fastest motion through poses, proved
    no_slower      motions of other families in place of what a search finds, where they are faster
    neighbours     the best motions of many pairs of poses, from few starts and from motions of neighbouring pairs
    batch          the fastest motions of many pairs of poses, tightened until they are proved
    leg            poses joined by free motions, as a leg of plans
    map            maps of least durations
"""

"""Free motions: the fastest, or otherwise best, motion between poses, along whatever path.

Between poses a motion is a quintic B-spline of normalised time, with four continuous derivatives, so that tensions and
their rates are continuous. Its control points, its duration and the accelerations at the poses are found by an
interior-point method on the limits at many samples, from several starts. The proof of any motion then says where
limits are missed between samples; there they are tightened, and the search goes on. For all robots within an
uncertainty, limits are tightened by the slack that these robots lose. The orientation is a Rodrigues vector, measured
from an orientation midway, so that the motion is a spline of quaternions as all others are.

Files, each importing only from those above it:

    search         the interior-point search
    poses          tasks from poses, and motions from what is found
    closed_forms   motions of other families, from which searches begin, too
    problem        poses, limits and objective of a search, and how bounds tighten
    static_poses   poses that no motion can have
    contacts       planes that separate bodies where a motion brings them too near
    robust         bounds that leave slack for all robots within an uncertainty
    proofs         motions tightened until they are proved, for the planned robot or for all
    free_motion    the fastest motion through poses, proved
    no_slower      motions of other families in place of what a search finds, where they are faster
    neighbours     the best motions of many pairs of poses, from few starts and from neighbours' motions
    batch          the fastest motions of many pairs of poses, tightened until they are proved
    leg            poses joined by free motions, as a leg of plans
    map            maps of least durations
"""

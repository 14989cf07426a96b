"""Bezier curves of point masses from rest to rest, and objects that are launched from them.

A Bezier curve of the second order, traversed by half a period of a cosine, is at rest at both ends. The
pseudotensions along it are polynomials of low degree in the cosine of the phase, whose coefficients depend on
r = (T / pi)^2: their minima are exact, and the durations at which a verdict can change are roots of polynomials. A
launch releases an object on a segment that passes the position of the release with the velocity that the flight
requires. With more cables than degrees of freedom, tensions are enclosed over time instead, and durations are searched
for by samples.

Source: the launch paper, section 3.1 (curve) and the sections after it (release and free flight).

Files, each importing only from those above it:

    motion                positions over time, section 3.1
    margins               smallest pseudotensions and depth, exact
    limits                smallest slacks of limits, proved
    duration_roots        durations at which a verdict can change
    redundant_verdicts    verdicts with more cables than degrees of freedom, by the proof for any motion
    verdicts              verdicts of given durations
    redundant_durations   intervals of durations and the least one, with more cables than degrees of freedom
    durations             intervals of durations that keep every cable taut; the least duration under limits
    sequences             least sum of the durations of a sequence
    segments              answers for consecutive segments
    launches              releases, and maps of the points that an object can be thrown to
    leg                   Bezier segments in a plan
"""

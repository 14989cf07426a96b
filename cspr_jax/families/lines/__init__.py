"""Straight lines of point masses from rest to rest: by the S-model, a quintic or a cubic, in the least time.

Along a straight line, limits of tensions are half-planes of path coordinate and path acceleration. If only they apply,
formulas give the least duration of a law, and of any motion along the line. Other limits need a search over the
duration and, for the S-model, over the fraction p / T of its acceleration. Each motion found is proved between the
samples; a lower bound of the duration of any motion is given beside its duration.

Source: Boralugoda's thesis (feasible accelerations, S-model, least time: tables 4.1 to 4.3).

Files, each importing only from those above it:

    faces          feasible accelerations along a line, as half-planes
    motion         positions over time by the three laws
    s_model        least durations by formulas: of the S-model, and of any motion
    slacks         cables and limits as functions of s, s'^2 and s''
    lower_bounds   lower bounds of the duration of any motion under limits of the cables
    any_limits     least durations by search
    proof          smallest slacks, proved between the samples
    durations      durations before they are proved: by formula or by search
    verdicts       verdicts of given durations
    fastest        the fastest motions with their verdicts
    least_time     least durations of many lines
    timed_lines    answers for lines with given or least durations
    leg            lines in a plan
    map            maps of least durations
"""

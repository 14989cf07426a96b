"""Splines: motions that a user brings, as curves or as functions of time.

Curves through samples and way-points, and what is read as such, are in `curves`; here they become motions of plans.

Files, each importing only from those above it:

    functions   motions that are functions of time
    leg         poses at their times, and files, as a leg of plans
"""

"""Splines: motions of the user's own, as curves or as functions of time.

`curves` makes and reads curves through samples and waypoints; here they become motions of plans.

Files, each importing only from those above it:

    functions   motions that are functions of time
    leg         poses at given times, and files, as a leg of plans
"""

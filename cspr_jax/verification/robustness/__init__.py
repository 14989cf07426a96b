"""Robustness: verdicts about all robots within an uncertainty, and the largest multiple that is tolerated.

Files, each importing only from those above it:

    cable_rates         speeds and accelerations of cables over blocks
    uncertainty         verdicts about all robots within an uncertainty
    tolerances          the largest multiple of an uncertainty that a motion tolerates
    uncertain_slacks    slacks of all robots within an uncertainty over blocks of time, from bounds of states
    motion_tolerances   the largest multiple of an uncertainty that a motion with such bounds tolerates
"""

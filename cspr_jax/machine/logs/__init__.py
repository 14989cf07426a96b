"""Recorded logs of a machine beside the plan that it has played: delay, errors of lengths and poses, slack cables.

Files, each importing only from those above it:

    delay         delay of measured lengths behind planned ones
    disagreement  cables whose lengths do not agree with the others, cables that are slack
"""

"""Proof of swings, fast: screens refute most, blocks with bounds of slacks prove the rest.

Files, each importing only from those above it:

    slacks         taut cables and depth, with bounds of their second derivatives
    limit_slacks   slacks of limits, likewise
    criteria       all criteria in one order
    blocks         cuts of a segment at the knots of its amplitude function
    enclosures     bounds of the state over a block of time, for robots that differ a little
    verdicts       verdicts that hold between the samples
    margins        smallest slacks, refined
    screen         upper bounds of the margins of all numbers of arcs at once
    limit_screen   candidates that a few samples refute by a limit
"""

"""Fast proof of swings: screens refute most motions, blocks with bounds of slacks prove the others.

Files, each importing only from those above it:

    slacks         taut cables and depth, with bounds of their second derivatives
    limit_slacks   slacks of limits, likewise
    criteria       all criteria in one order
    blocks         blocks of a segment between the knots of its amplitude function
    enclosures     bounds of the state over a block of time, for slightly different robots
    verdicts       verdicts that also hold between samples
    margins        smallest slacks, refined
    screen         upper bounds of the margins for all numbers of arcs together
    limit_screen   candidates that a limit at a few samples refutes
"""

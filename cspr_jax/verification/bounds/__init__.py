"""Bounds of motions over blocks of time: of states, slacks and enclosures, of one motion or of a batch.

Files, each importing only from those above it:

    amplitude_bounds   bounds of amplitude functions over blocks of time
    batch              several motions of one family, bounded together
    swing_bounds       bounds of swings about P0 over a block of time
    block_slacks       slacks of any motion over blocks of time, from bounds of its states
    block_parts        blocks of several motions, cut around their undecided parts
    blocks             parts of arcs, halved while they are undecided
    enclosures         bounds of a robot's state over a block of time
"""

"""Harmonic ellipses: turns on ellipses, circles and lines of any amplitude, and transfers from one to another.

A point mass that moves as x = C + a cos(wt) + b sin(wt) has pseudotensions of one harmonic each, so that verdict,
margin and the interval of feasible frequencies are formulas; at the natural frequency every ellipse below the spools is
feasible whose centre lies below their hull. Rest is an ellipse without axes. On a transfer between ellipses, centre,
axes, frequency and orientation change along an amplitude function, in the smallest number of arcs that is proved.

Source: Gosselin, Ren, Foucault (ICRA 2012); Mottola, Gosselin, Carricato (J. Mechanisms and Robotics 10, 2018, 031004);
docs/theory.md derives the formulas for any coplanar spools, centre and plane.

Files, each importing only from those above it:

    hull                   hull of the spools, described by affine functions
    harmonics              margins and frequencies by formulas
    rotation               orientations of platforms
    motion                 motion on ellipses and between them
    frequencies            frequencies that a plan leaves open
    rotation_frequencies   natural frequencies of rotation of a platform at rest
    transfers              smallest numbers of arcs between two ellipses
    releases               ellipses from which an object is released
    leg                    ellipses in a plan
    cells                  proofs and answers of turns on many ellipses
    map                    maps of feasible frequencies and margins
    swing_range            slowest throws from ellipses
    swing_range_map        maps of slowest throws
"""

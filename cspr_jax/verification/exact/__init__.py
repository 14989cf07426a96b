"""Exact decisions of what proofs by bounds leave open, by ball arithmetic at high precision and by algebra.

Bounds in float64 cannot tell a slack from zero that is nearer to it than their rounding. Here the formulas of a motion
are evaluated in balls of 256 bits, as power series, within the open blocks alone; where a slack is nearer to its level
than 1e-30, roots of polynomials in rational numbers tell touching from crossing. Needs python-flint.

Files, each importing only from those above it:

    series       series of balls, and states of motions
    components   smooth components of slacks
    kinematics   cables, wrenches, tensions
    facets       margins of redundant cables
    contacts     clearances
    slacks       slacks of all criteria
    minimum      smallest value of a slack, enclosed
    algebra      signs by roots of polynomials
    decisions    proofs with their open criteria decided
    extremes     smallest slacks and peaks to any number of digits
"""

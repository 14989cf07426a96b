"""Search for free motions: splines, equations at instants, and an interior-point method for many motions.

Files, each importing only from those above it:

    basis            quintic B-splines, and the instants at which motions are looked at
    instants         equations and bounds of a motion at an instant
    determinants     determinants of the wrenches of unit tensions, with derivatives
    derivatives      equations at many instants, with first and second derivatives
    objectives       what a motion is the best in
    tasks            motions that are sought together, and their unknowns
    condensation     tensions and multipliers, eliminated from Newton's equations of each instant
    newton           steps of Newton's method, with banded matrices
    points           motions with their equations during a search, and how far they are from an optimum
    descent          steps along which the merit falls
    interior_point   the interior-point method
    starts           lines, bent lines and swings, from which searches begin
    time_bounds      lower bounds of the time of all motions between two poses
"""

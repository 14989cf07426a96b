"""Search for free motions: splines, equations at samples, and an interior-point method for many motions.

Files, each importing only from those above it:

    basis            quintic B-splines, and the samples at which motions are evaluated
    equations        equations and bounds of a motion at one time
    determinants     determinants of the wrenches of unit tensions, with derivatives
    derivatives      equations at many samples, with first and second derivatives
    objectives       what is minimised: time, energy, the largest tension, or minus the margin
    tasks            motions that are searched for together, and their unknowns
    condensation     tensions and multipliers, eliminated from Newton's equations of each sample
    newton           steps of Newton's method, with banded matrices
    points           motions with their equations during a search, and steps along which their merit falls
    interior_point   the interior-point method
    starts           lines, deflected lines and swings, from which searches begin
    time_bounds      lower bounds of the time of all motions between two poses
"""

"""Calibration: spools, attachment points, offsets of lengths and radii, from measurements at many poses.

Each pose gives readings of the cables, and, where a tracker looks on, a position and an orientation. Poses are unknown
too. With the whitened residuals r and their derivatives J by the parameters and B by the coordinates of a pose, rows of
U^T, the part of the left singular vectors of B that B does not reach, free the problem of the pose: U^T r + U^T J d is
least. The stacked rows of all poses are one small matrix, whose singular values decide what the measurements tell: its
inverse is the covariance, its null space what they cannot see. Along the null space the estimate stays as close to the
nominal robot as it can (free network adjustment), and its covariance is that of such estimates. Mistakes among the
measurements are found by residuals over their standard deviation, which the redundancy of each measurement gives
(Baarda, A Testing Procedure for Use in Geodetic Networks, 1968), while a robust loss keeps them from hiding each other.

Files, each importing only from those above it:

    measurements     what was measured, with standard deviations
    setups           a robot with what stands around it: offsets of lengths, the tracker
    parameters       which numbers are unknown
    predictions      what would be measured at a pose, and its derivatives
    elimination      poses eliminated: rows, null space, redundancy, steps
    starting_poses   poses from readings alone, and the tracker's axes
    least_squares    the iteration, and the search for mistakes
    radii            radii that hold a spool with a probability
    directions       directions that cannot be seen, in words; correlations
    next_poses       poses that would tell most, by the determinant of the information
    calibrated       the whole calibration, in the axes of the file
"""

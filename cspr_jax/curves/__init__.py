"""Curves: piecewise polynomials through positions and orientations, and what is read as such.

Controllers play a table of samples or waypoints and interpolate between them by polynomials, piece by piece. Over a
block of time each coordinate lies close to a straight line, with a remainder that its Bernstein coefficients bound,
whether the block holds a part of a piece or hundreds of pieces. These bounds give bounds of cables, of the force
balance and of tensions (`robots.bounds.state_bounds`, `robots.bounds.witness_tensions`), and so verdicts between the
samples. The parameter of a curve is the time of a motion, or the coordinate along a path that has no timing yet.

Orientations are quaternions that are interpolated as they are and normalised afterwards.

Files, each importing only from those above it:

    spline          positions and rotations over time, and bounds of them over blocks, of one motion or a batch
    interpolation   cubic, quintic and Hermite curves through samples, or through every second one
    reading         tables and pieces that were read, curves of SciPy, tables window by window
    noise           noise of recorded samples
    smoothing       the smoothest curve near noisy samples
    files           motions of files and arrays, in the axes of the kernels
"""

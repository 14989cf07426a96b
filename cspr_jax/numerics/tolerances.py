"""Tolerances that decide verdicts, one a line with its reason; other tolerances stand beside the code that uses them.

A slack closer to zero than the tolerance of its proof is undecided, since its sign may be due to rounding.
"""

import numpy as np

# Fraction of a limit by which a motion may exceed it: a limit that is touched is kept (docs/theory/proofs.md).
# Rounding errors are some 1e-16 of numbers a hundred times as large as a limit; proofs bound the slack of a limit to
# 1e-10 of it, those of platforms on six cables to 1e-9. No drive, gauge or robot file gives a limit as precisely; a
# motion that exceeds a limit by a millionth is refused.
TOUCHED = 1e-8
# Slacks of taut cables and of depth along swings, over their values at rest; their rounding is bounded in addition.
SMALLEST_MARGIN = 1e-9
# The same for platforms on six cables and for the determinant: Cramer's rule loses digits near singular poses.
SIX_CABLES_UNDECIDED = 1e-6
# Slacks at samples of platforms on more cables; samples only refute motions or pass them on to a proof.
SAMPLES_UNDECIDED = 1e-7
# Slacks of closed forms: of lines over gravity, of Bezier segments over the limits, of poses at rest over the largest
# tension.
FORMULAS_UNDECIDED = 1e-12
# Margins of poses and accelerations at rest, over the largest tension and over gravity: poses that the fast methods
# leave open are answered by singular values, with a smaller error.
BOUNDARY = 1e-9
# Relative error of one operation on bounds, which rounds a few times.
ROUNDING = 8.0 * float(np.finfo(float).eps)
# Largest difference of the norm of a given quaternion from 1: files have six decimals.
UNIT_NORM = 1e-6

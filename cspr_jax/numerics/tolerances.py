"""Tolerances that decide verdicts, one a line with its reason; errors of formulas and stopping rules stand beside them.

A slack nearer to zero than the tolerance of its proof is undecided, since rounding could have made its sign.
"""

import numpy as np

# Part of a limit by which a motion may miss it and keep it: a limit that is touched is kept (docs/theory/proofs.md).
# Rounding errors are some 1e-16 of numbers a hundred times as large as a limit; proofs bound the slack of a limit to
# 1e-10 of it, those of platforms on six cables to 1e-9. No drive, gauge or robot file knows a limit as precisely, and a
# limit that is exceeded by a millionth is refused.
TOUCHED = 1e-8
# Slacks of taut cables and depths of swings, over their values at rest, besides their rounding, which is bounded.
SMALLEST_MARGIN = 1e-9
# The same of platforms on six cables, and of the determinant: Cramer's rule loses digits near singular poses.
SIX_CABLES_UNDECIDED = 1e-6
# Motions of platforms on more cables, which samples refute or pass on to a proof.
SAMPLES_UNDECIDED = 1e-7
# Closed forms: of lines over gravity, of Bezier segments over the limits, of poses at rest over the largest tension.
FORMULAS_UNDECIDED = 1e-12
# Margins of poses and accelerations at rest, over the largest tension and over gravity: poses that the fast methods
# leave open are answered by singular values, with a smaller error.
BOUNDARY = 1e-9
# Relative error of an operation of bounds: a few roundings.
ROUNDING = 8.0 * float(np.finfo(float).eps)
# By how much the norm of a given quaternion may differ from 1: files have six decimals.
UNIT_NORM = 1e-6

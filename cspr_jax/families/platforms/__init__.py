"""Platforms that translate and rotate: hypocycloids of position with oscillating SLERP of orientation.

Position and orientation oscillate together, so that the cables of a robot that is in equilibrium at P0 stay taut while
its platform moves to poses far from it. Tensions, determinant, limits on the pose and contacts are proved on blocks of
time: they are analytic functions of complex time, so the error of polynomials through their values at Chebyshev nodes
can be bounded. On more than six cables, searches rely on samples; the motion that they choose is then proved by
tensions that balance it throughout blocks.

Source: Dion-Gauvin's thesis, chapter 3 (sections 3.7 to 3.13: oscillating SLERP, beta-hat, accessible and attainable
orientations).

Files, each importing only from those above it:

    oscillating_slerp        oscillating rotation, section 3.7
    slerp_bounds             bounds of this rotation over a block of time
    slerp_formulas           formulas of this rotation with rational numbers
    platform_segment         segment between two poses, (3.42) to (3.66), and batches of segments
    platform_segment_lanes   the same motion, one lane a segment
    from_rest_lanes          the same motion from rest, with the fewest operations
    end_acceleration         angular acceleration at the end of a segment, section 3.8
    beta_hat                 values of beta-hat to try, and poses at which motions can end
    motion_checker           protocol of checkers for searches, for any number of cables
    six_cable_proof          the fast proof of motions on six cables
    redundant                checker of motions on more than six cables
    checkers                 the checker for a number of cables
    arcs                     smallest numbers of arcs between pairs of poses
    answers                  answers for given numbers of arcs
    pose_targets             smallest numbers of arcs to many poses
    orientations             orientations at positions, section 3.10
    leg                      platform motions in a plan
"""

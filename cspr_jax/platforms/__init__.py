"""Platforms that move and turn: hypocycloids of position with oscillating SLERP of orientation.

Position and orientation swing together, so that the cables of a robot that is in equilibrium at P0 stay taut while its
platform goes to poses far from it. Tensions, determinant, limits on the pose and contacts are proved on blocks of time:
they are analytic functions of complex time, so that the error of polynomials through their values at Chebyshev nodes
can be bounded. On more than six cables searches look at samples, and what they choose is proved by tensions that
balance it throughout blocks.

Source: Dion-Gauvin's thesis, chapter 3 (sections 3.7 to 3.13: oscillating SLERP, beta-hat, accessible and attainable
orientations).

Files, each importing only from those above it:

    oscillating_slerp       rotation that swings, section 3.7
    slerp_bounds            bounds of it over a block of time
    platform_segment        segment between two poses, (3.42) to (3.66)
    platform_segment_lanes  the same, one lane a segment
    from_rest_lanes         the same from rest, with the fewest operations
    end_acceleration        angular acceleration at the end of a segment, section 3.8
    beta_hat                values of beta-hat to try, and whether motions can end at poses
    slacks                  criteria of one instant
    slack_lanes             the same, one lane a case
    motions                 many motions in one record, and selections from it
    motion_checker          what searches ask of a checker, whatever the number of cables
    sieve                   a first look, in single precision
    orientation_steps       cables at still poses, and between neighbouring ones
    crossings               cables that cross between samples
    meetings                proofs that cables meet
    work_list               blocks that are closed, or halved; the few numbers that this needs of their nodes
    platform_reach          bounds of a motion on an ellipse of complex time
    limit_blocks            limits on blocks
    tension_blocks          tensions and determinant on blocks
    place_blocks            contacts, depth and limits on the pose on blocks
    proof                   proofs of tensions and determinant
    place_proof             proofs of contacts, depth and limits on the pose
    enclosures              bounds over robots that differ a little
    margins                 smallest values, refined
    checker                 verdicts and margins of motions on six cables
    redundant_kernels       states of motions on more than six cables
    redundant_checker       verdicts and margins of motions on more than six cables
    checkers                the checker for a number of cables
    arcs                    smallest numbers of arcs between pairs of poses
    answers                 answers for known numbers of arcs
    pose_targets            smallest numbers of arcs to many poses
    accessible              accessible orientations, section 3.10.2
    attainable              orientations that a transition from rest attains, section 3.12.3
    leg                     platform motions in a plan
    poses_map               maps of poses
    places_map              maps of orientations that places allow
    orientations_map        maps of all orientations of places
"""

"""Fast proof of motions of six-cable platforms: tensions, determinant, contacts and limits on blocks.

Files, each importing only from those above it:

    slacks           criteria at one time: a readable form, and a form with one lane a case
    screen           a cheap test of most motions, in single precision
    cable_contacts   proofs that cables touch
    work_list        blocks that are proved or halved, and the few numbers of their nodes that this needs
    complex_bounds   bounds of a motion on an ellipse of complex time
    limit_blocks     limits on blocks
    tension_blocks   tensions and determinant on blocks
    pose_blocks      contacts, depth, and limits on the pose on blocks
    tension_proof    proofs of tensions and determinant
    pose_proof       proofs of contacts, depth and limits on the pose
    enclosures       bounds over robots that differ a little
    margins          smallest values, refined
    checker          verdicts and margins of motions on six cables
"""

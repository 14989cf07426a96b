"""Certificates of motions, which another program can check (docs/certificates.md).

Files, each importing only from those above it:

    statement     robot, limits, bodies and motion in rational numbers
    blocks        feasible motions: bounds, and witnesses block by block
    failures      infeasible motions: times at which criteria fail
    certificate   the content of the file
"""

"""Motions of platforms on more cables than degrees of freedom: proved as any motion is, after samples.

Files, each importing only from those above it:

    crossings           cables that cross between samples
    redundant_kernels   states of motions on more than six cables
    redundant_checker   screen, verdicts and margins of motions on more than six cables
"""

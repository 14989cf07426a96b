"""Motions of platforms on more cables than degrees of freedom: sampled in searches, then proved like any motion.

Files, each importing only from those above it:

    crossings           motions whose cables cross between samples
    redundant_kernels   states of motions on more than six cables, compiled
    redundant_checker   screen, verdicts and margins of motions on more than six cables
"""

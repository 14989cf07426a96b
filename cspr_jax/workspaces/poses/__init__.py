"""Margins of poses: facet normals of the sets of wrenches that cables supply, exact margins, compiled margins.

Files, each importing only from those above it:

    geometry        unit vectors and wrench matrices of many poses
    facet_normals   facet normals of a robot
    margins         bounds of margins, one facet normal after the other
    exact           margins of single poses by singular values
    kernels         compiled margins of many poses
"""

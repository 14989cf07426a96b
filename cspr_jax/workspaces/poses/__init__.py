"""Margins of poses: facet normals of the wrenches that cables give, exact margins, compiled ones.

Files, each importing only from those above it:

    geometry        unit vectors and wrench matrices of many poses
    facet_normals   facet normals that a robot has
    margins         margins, one facet normal after the other, between two bounds
    exact           margins of single poses by singular values
    kernels         compiled margins of many poses
"""

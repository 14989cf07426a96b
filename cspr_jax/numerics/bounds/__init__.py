"""Bounds of functions over blocks of their variables: affine forms, jets, and unions of intervals."""

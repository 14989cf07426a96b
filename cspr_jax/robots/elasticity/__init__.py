"""Elastic cables: springs, stiffness and mass matrices, natural frequencies and modes."""

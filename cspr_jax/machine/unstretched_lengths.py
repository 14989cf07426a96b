"""Unstretched lengths l0 = l / (1 + f / EA) of elastic cables, which drums pay out so that cables have the length l."""

from __future__ import annotations

from jax import Array

from cspr_jax.numerics.shapes import Float


def unstretched_lengths(
    lengths: Float[Array, "n"], tensions: Float[Array, "n"], stiffness: Float[Array, "n"] | None
) -> Float[Array, "n"]:
    """Lengths without load of cables that are stretched to `lengths`; without a stiffness EA they do not stretch."""
    return lengths if stiffness is None else lengths / (1.0 + tensions / stiffness)

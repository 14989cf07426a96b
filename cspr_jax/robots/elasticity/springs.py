"""Elastic cables as springs: tensions, and unstretched lengths, which drums set so that cables have planned lengths.

A linear cable of axial stiffness EA and unstretched length l0 has the tension f = EA (l / l0 - 1) at the length l, so
that l0 = l / (1 + f / EA). The whole length stretches, from the point where the drum or the pulley lets the cable off,
with what is wrapped around the pulley, over which it slides without friction. What lies on the drum does not.
"""

from __future__ import annotations

from jax import Array

from cspr_jax.numerics.shapes import Float


def unstretched_lengths(
    lengths: Float[Array, "... n"], tensions: Float[Array, "... n"], stiffness: Float[Array, "n"] | None
) -> Float[Array, "... n"]:
    """Lengths without tension of cables that are stretched to `lengths`; without a stiffness EA they do not stretch."""
    return lengths if stiffness is None else lengths / (1.0 + tensions / stiffness)


def spring_tensions(
    stiffness: Float[Array, "n"], lengths: Float[Array, "... n"], unstretched: Float[Array, "... n"]
) -> Float[Array, "... n"]:
    """Tensions of cables stretched to some lengths, N; negative where they would be slack."""
    return stiffness * (lengths - unstretched) / unstretched


def spring_constants(
    stiffness: Float[Array, "n"], lengths: Float[Array, "... n"], tensions: Float[Array, "... n"]
) -> Float[Array, "... n"]:
    """Derivatives of the tensions in the lengths at fixed unstretched lengths, EA / l0, N/m."""
    return (stiffness + tensions) / lengths

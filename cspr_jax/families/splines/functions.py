"""Motions that are functions of time, differentiated by jax."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.curves.spline import turning_of
from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.state import State


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class FunctionMotion:
    """Motion given by a function of time; see `motion.motion.Motion`. It has no bounds.

    Fields:
        time: () duration, s.
        z0: () depth at which slacks are normalised, m.
        factor: () factor that stretches time.
        function: maps times () s to positions (3,) m, for a platform to positions and quaternions (7,); static when
            functions are compiled.
    """

    time: Array
    z0: Array
    factor: Array
    function: Callable[[Array], Array] = dataclasses.field(metadata={"static": True})

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.time * self.factor

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""

        def value(t: Array) -> Array:
            return self.function(t / self.factor)

        def rate(t: Array) -> Array:
            return jax.jvp(value, (t,), (jnp.ones_like(t),))[1]

        t = tau * self.duration()
        position, (first, second) = value(t), jax.jvp(rate, (t,), (jnp.ones_like(t),))
        turning = turning_of(position[3:], first[3:], second[3:]) if position.shape[0] > len("xyz") else ()
        return State(position[:3], first[:3], second[:3], *turning)

    def breaks(self) -> Array:
        """Breaks; see `Motion.breaks`."""
        return jnp.zeros(0)

    def stretched(self, factor: float) -> "FunctionMotion":
        """The motion, run slower or faster by a factor of time; see `Spline.stretched`."""
        return dataclasses.replace(self, factor=as_float64(self.factor * factor))


def function_motion(
    function: Callable, duration: float, *, frame: Frame, reference: Float[np.ndarray, "4"], is_platform: bool
) -> FunctionMotion:
    """Motion of a function with positions in the axes of a robot file, converted to the axes of the kernels."""
    try:
        shape = jax.eval_shape(lambda t: jnp.asarray(function(t)), jnp.asarray(0.0)).shape
    except TypeError as error:
        raise InputError("times", None, "must be one of jax.numpy", problem="jax cannot follow it") from error
    allowed = ((3,), (7,)) if is_platform else ((3,),)
    if shape not in allowed:
        raise InputError(
            "times", None, f"must give values of shape {' or '.join(map(str, allowed))}", problem=f"{shape}"
        )
    back = jnp.asarray(reference * np.array([1.0, -1.0, -1.0, -1.0]))

    def inward(t: Array) -> Array:
        value = jnp.asarray(function(t), float)
        position = jnp.asarray(frame.inward(value[:3]))
        if not is_platform:
            return position
        turning = jnp.asarray(frame.rotated_quaternions(value[3:])) if shape == (7,) else jnp.eye(4)[0]
        return jnp.concatenate([position, rotations.product(turning, back)])

    return FunctionMotion(as_float64(duration), as_float64(1.0), as_float64(1.0), inward)

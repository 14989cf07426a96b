"""What a platform's segments ask of the robot, at their extremes; the state of the platform along them."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.minima import narrowed
from cspr_jax.feasibility.platform.samples import SAMPLES
from cspr_jax.feasibility.point_mass.demands import SIGNS, Extremes
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots import wrench_balance
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.runtime.stages import stage
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment, motion

BATCH = 512


@partial(jax.jit, static_argnames="kind")
def _demands(problem: Problem, arguments, *, kind: Kind) -> Array:
    def one(segment, arcs, tau):
        robot, pose = problem.robot, motion(segment, problem.amplitude, arcs, tau, kind=kind)
        per_length = wrench_balance.tensions_per_length(robot, pose)
        lengths, rates, bends = wrench_balance.cable_motion(robot, pose)
        force = robot.mass * per_length * lengths
        depth = plane_normal(robot) @ pose.position * segment.rate / robot.gravity
        return jnp.stack(
            [
                jnp.min(force),
                -jnp.max(force),
                jnp.min(per_length),
                depth,
                -pose.position[2],
                -jnp.max(lengths),
                -jnp.max(jnp.abs(rates)),
                -jnp.max(jnp.abs(bends)),
            ]
        )

    return jax.vmap(one)(*arguments)


def pose_extremes(
    problem: Problem, segments: PoseSegment, arcs: np.ndarray, least_samples: int, *, kind: Kind
) -> Extremes:
    """What segments ask of the robot: at least 64 samples an arc, narrowed where a value is extreme.

    Args:
        problem: robot, limits, amplitude, reference.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,).
        least_samples: smallest number of samples of a segment.
        kind: of the motions.

    Returns:
        the extremes.
    """
    found, samples = [], []
    for i, p in enumerate(arcs):
        stage(f"extremes along segment {i + 1} of {len(arcs)}")
        segment = jax.tree.map(lambda x, i=i: x[i], segments)
        tau = np.linspace(0.0, 1.0, max(SAMPLES * int(p), least_samples) + 1)

        def at(points, segment=segment, p=p):
            items = jax.tree.map(lambda x: np.broadcast_to(x, (len(points), *np.shape(x))), (segment, float(p)))
            return in_batches(partial(_demands, problem, kind=kind), (*items, points), size=BATCH)

        smallest = narrowed(at, tau, at(tau))
        found.append(smallest * SIGNS + 0.0)  # no -0
        samples.append(len(tau))
    names = [field.name for field in dataclasses.fields(Extremes)][:-1]
    return Extremes(**dict(zip(names, np.array(found).T, strict=True)), samples=np.array(samples))

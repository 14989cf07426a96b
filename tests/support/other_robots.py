"""Robots that differ a little from a planned one: at random, and as bad as can be found, by the oracles alone."""

import dataclasses

import numpy as np
from oracles import platform as oracle

from cspr_jax.robots.model.limits import Uncertainty


def uncertain(**numbers):
    """An uncertainty; what is not given is certain."""
    given = {"spool_positions": 0.0, "mass_centre": 0.0, "mass_factor": 1.0} | numbers
    return Uncertainty(**{name: np.asarray(value) for name, value in given.items()})


def on_balls(rng, shape, radius):
    """Vectors (..., 3) of one length."""
    vectors = rng.normal(size=(*shape, 3))
    return radius * vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def displaced(robot, spools, centre):
    """An oracle's platform with displaced spools (6, 3) and mass centre (3,), m."""
    return dataclasses.replace(robot, base=robot.base + spools, com=robot.com + centre)


def ratios(robot, motion):
    """Tensions of a platform per mass and nominal metre, (n, 6), along a motion of its frame's origin."""
    right = oracle.wrench(robot, motion.rotation, motion.acceleration, motion.omega, motion.omega_dot)
    return oracle.force_ratios(robot, motion.position, motion.rotation, right)


def rows(motion, which):
    """Some instants of a motion."""
    own = {name: value[which] for name, value in vars(motion).items() if name != "duration"}
    return dataclasses.replace(motion, **own)


def worst_robot(robot, motion, instant, cable, spools, centre, *, sign=1.0):
    """The robot within balls that to first order lowers a tension most at an instant; sign -1: that raises it most.

    By differences of the oracle's tensions, not by formulas.
    """
    step, here = 1e-6, rows(motion, [instant])

    def tension(base, com):
        return ratios(displaced(robot, base, com), here)[0, cable]

    base, com = np.zeros((6, 3)), np.zeros(3)
    slope = np.zeros((6, 3))
    for j, i in np.ndindex(6, 3):
        base[j, i] = step
        slope[j, i] = tension(base, com) - tension(-base, com)
        base[j, i] = 0.0
    turn = np.zeros(3)
    for i in range(3):
        com[i] = step
        turn[i] = tension(base, com) - tension(base, -com)
        com[i] = 0.0
    # Along its own ray a spool changes no tension, only its measure here.
    rays = oracle.cables(robot, here.position, here.rotation)[0]
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    slope -= np.sum(slope * units, axis=1, keepdims=True) * units
    sizes = np.linalg.norm(slope, axis=1, keepdims=True)
    size = max(np.linalg.norm(turn), 1e-300)
    return displaced(robot, -sign * spools * slope / np.maximum(sizes, 1e-300), -sign * centre * turn / size)

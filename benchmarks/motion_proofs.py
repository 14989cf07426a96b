"""Proofs of spline motions, one by one and many together, beside linear programs by HiGHS: seconds of CPU time."""

import argparse
import time

import jax
import numpy as np

from cspr_jax.build.robots import load_robot
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.curves.spline import SplineBatch
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.cables import wrench_units
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.tensions.tension_programs import by_program
from cspr_jax.verification.proved_answers import proof_of, proofs_of

INSTANTS, PROGRAMS, ROWS, DURATION = 200, 5, 10_001, 10.0
# Robots, the middle of their motions and how far these go, m, tilts, and limits of tensions, N.
ROBOTS = {
    "prototype": ((0.0, 0.0, 1.0), 0.12, 0.0, (0.1, 4.0)),
    "boralugoda-rectangle": ((0.0, 0.0, 2.0), 0.6, 0.0, (1.0, 300.0)),
    "cogiro": ((0.0, 0.0, 4.0), 1.5, 0.05, (100.0, 5000.0)),
}


def cpu(work):
    """Seconds of CPU time, and the answer."""
    began = time.process_time()
    answer = work()
    return time.process_time() - began, answer


def motion(rng, name):
    """Quintic spline through random poses."""
    middle, size, tilt, _ = ROBOTS[name]
    places = np.array(middle) + size * rng.uniform(-1.0, 1.0, (7, 3))
    turns = np.concatenate([np.ones((7, 1)), tilt * rng.uniform(-1.0, 1.0, (7, 3))], axis=1)
    return interpolated(np.linspace(0.0, DURATION, 7), places, turns if tilt else None, interpolation="quintic")


def rows_of(spline):
    """Record of a motion, at 1 kHz."""
    times = np.linspace(0.0, DURATION, ROWS)
    states = jax.tree.map(np.asarray, jax.jit(jax.vmap(spline.state))(times / DURATION))
    return times, states.position, states.quaternion if spline.quaternion is not None else None


def programs(robot, splines, low, high):
    """Linear programs at instants of some motions: seconds a motion."""
    unit = np.asarray(wrench_units(robot))

    def balances(tau, spline):
        state = spline.state(tau)
        return robot.wrench_matrix(state) / unit[:, None], robot.inertial_wrench(state) / unit

    taus = np.linspace(0.0, 1.0, INSTANTS)
    pairs = [jax.tree.map(np.asarray, jax.vmap(balances, (0, None))(taus, spline)) for spline in splines]
    return cpu(lambda: [by_program(*each, low, high) for pair in pairs for each in zip(*pair, strict=True)])[0] / len(
        pairs
    )


def measure(name: str, count: int) -> None:
    """Print the CPU time of one long record, and of many motions beside linear programs."""
    robot, rng = centred(load_robot(name))[0], np.random.default_rng(0)
    low, high = (np.full(robot.n_cables, value) for value in ROBOTS[name][3])
    problem = Problem(robot, Limits(tension_min=low, tension_max=high), named("quintic"))
    splines = [motion(rng, name) for _ in range(count)]
    first, _ = cpu(lambda: proof_of(problem, splines[0]))
    record = rows_of(splines[0])
    seconds, case = cpu(lambda: proof_of(problem, interpolated(*record)))
    print(f"{name}: {first:.1f} s the first proof, with compiling")
    print(f"  {ROWS} rows of 10 s: {seconds:.3f} s with interpolation, {case.proof.blocks} blocks")

    def many():
        several = SplineBatch(splines)
        return proofs_of(problem, several.bounds, several.durations, jumps=several.jumps)

    seconds, cases = cpu(many)
    proofs = [case.proof for case in cases]
    each, blocks = seconds / count, sum(proof.blocks for proof in proofs)
    proved, refuted = sum((p.low > 0.0).all() for p in proofs), sum((p.high < 0.0).any() for p in proofs)
    print(f"  {count} motions: {1e3 * each:.2f} ms, {blocks / count:.0f} blocks each, {blocks / seconds:.0f} a second")
    print(f"  {proved} proved, {refuted} refuted")
    by_highs = programs(robot, splines[:PROGRAMS], low, high)
    print(f"  HiGHS at {INSTANTS} instants: {1e3 * by_highs:.0f} ms a motion, {by_highs / each:.0f} times as long")


def main() -> None:
    """Measure each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000)
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for name in options.robots:
        measure(name, options.count)


if __name__ == "__main__":
    main()

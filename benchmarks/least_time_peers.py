"""Least times along random paths, many together, beside toppra, if it is installed, on the same half-planes.

CPU seconds a path, of all threads, without compiling. Half-planes are those of the package, at both ends of cells for
the same u, handed over as they are: then toppra's own conversion, canlinear_colloc_to_interpolate, which returns the
bounds of x and u in the other order than its constraints do, is not in the way. Making them counts for neither side in
"solving", and for the package in "half-planes". toppra solves for u that is constant in each cell; so does "solving"
here, whose T is compared; "motion" is the package's motion, with u that changes along cells, in three such solutions.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import any_motion_cases, path_rows
from support.least_time import robot_of, section_of

from cspr_jax.families.paths.geometry.section import SectionSettings
from cspr_jax.families.paths.least_time.bound import path_bound
from cspr_jax.families.paths.least_time.discrete import discretes
from cspr_jax.families.paths.least_time.jumping import jumping_motions, run_of, solved_together
from cspr_jax.families.paths.least_time.tightening import cell_slacks
from cspr_jax.families.paths.least_time.timed import cell_times, timed
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred

try:
    import toppra
    from toppra.constraint import DiscretizationType, LinearConstraint
except ImportError:
    toppra = None

# Kinds of the reference's robots; limits of tensions over the weight.
KINDS, TENSIONS = ("3T-3", "3T-4", "3R3T-6", "3R3T-8"), (0.02, 2.0)


def work(rng, kind, count):
    """A random robot, its problem, and sections through random points inside its footprint."""
    robot, reference, ranges, _ = any_motion_cases.random_robot(rng, kind)
    prepared, frame = centred(robot_of(robot))
    weight = robot["mass"] * robot["gravity"]
    low, high = (as_float64(np.full(prepared.n_cables, fraction * weight)) for fraction in TENSIONS)
    sections = []
    for _ in range(count):
        points = reference + 0.5 * ranges * rng.uniform(-1.0, 1.0, (6, 3))
        turns = None
        if robot["platform_points"] is not None:
            turns = np.concatenate([np.ones((6, 1)), 0.05 * rng.uniform(-1.0, 1.0, (6, 3))], axis=1)
        sections.append(section_of(path_rows.through(points, turns), frame))
    return Problem(prepared, Limits(tension_min=low, tension_max=high), named("quintic")), sections


def half_planes(path, gravity):
    """Rows A u + B x <= C of the cells, arrays (N, rows), over 0 <= s <= 1 in units of time sqrt(L / g)."""
    start, end, length = path.start, path.end, path.grid.nodes[-1]
    width, cap = path.grid.width[:, None], path.cap()[:-1, None]
    a = np.concatenate([start.u, end.u + 2.0 * width * end.x, 0.0 * cap], axis=1) * gravity
    b = np.concatenate([start.x, end.x, 1.0 / cap], axis=1) * gravity * length
    c = np.concatenate([start.most, end.most, 1.0 + 0.0 * cap], axis=1)
    size = np.maximum(np.maximum(np.abs(a), np.abs(b)), 1e-300)
    return a / size, b / size, c / size


def by_toppra(nodes, a, b, c):
    """T by toppra, in units of time sqrt(L / g), and CPU seconds for setting up and for solving."""

    class Given(LinearConstraint):
        """Half-planes as canonical linear constraints: v = A u + B x - C, v <= 0."""

        def __init__(self):
            super().__init__()
            self.identical = True
            self.discretization_type = DiscretizationType.Collocation
            self._format_string = ""

        def compute_constraint_params(self, path, gridpoints, *args, **kwargs):
            # Nothing happens after the last node: rows that always hold.
            none = np.zeros((1, a.shape[1]))
            parts = [np.concatenate(part) for part in ((a, none), (b, none), (-c, none - 1.0))]
            return *parts, np.eye(a.shape[1]), np.zeros(a.shape[1]), None, None

    grid = nodes / nodes[-1]
    began = time.process_time()
    path = toppra.SplineInterpolator([0.0, 0.5, 1.0], [[0.0], [0.5], [1.0]])
    instance = toppra.algorithm.TOPPRA([Given()], path, gridpoints=grid, solver_wrapper="seidel")
    ready = time.process_time()
    speed = instance.compute_parameterization(0.0, 0.0)[1]
    done = time.process_time()
    if speed is None or np.isnan(speed).any():
        return np.inf, ready - began, done - ready
    return np.sum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1])), ready - began, done - ready


def cpu(function, repeats=3):
    """Least CPU seconds of several calls after a first one, seconds of that one by the clock, and the answer."""
    began, spent = time.perf_counter(), []
    answer = function()
    first = time.perf_counter() - began
    for _ in range(repeats):
        began = time.process_time()
        function()
        spent.append(time.process_time() - began)
    return min(spent), first, answer


def compared(kind, args):
    """Print the rates of a kind of robot."""
    problem, sections = work(np.random.default_rng(args.seed), kind, args.paths)
    settings = [SectionSettings(args.cells, 0.0)] * len(sections)
    costs, firsts = {}, {}

    def measured(name, function, each=None):
        costs[name], firsts[name], answer = cpu(function)
        costs[name] *= 1e3 / (each or len(sections))
        return answer

    paths = measured("half-planes", lambda: discretes(problem, sections, settings))
    still = [np.zeros_like(path.grid.width) for path in paths]
    solutions = measured("solving", lambda: solved_together(paths, still))
    motions = measured("motion", lambda: jumping_motions(paths))
    going = [k for k, motion in enumerate(motions) if motion.run is not None][: args.proofs]
    proofs = [(paths[k], timed(paths[k].section, paths[k].grid, motions[k].run)) for k in going]
    measured("certificate", lambda: cell_slacks(problem, [motion for _, motion in proofs]), len(going))
    bounds = measured("bound", lambda: [path_bound(problem, paths[k], motions[k].run.x) for k in going], len(going))
    times = [cell_times(motions[k].run, paths[k].grid.width).sum() for k in going]
    gaps = 1.0 - np.array(bounds) / np.array(times)
    print(
        f"{kind}, N = {args.cells}, {paths[0].start.u.shape[1]} half-planes at a node, {args.paths} paths, ms a path:"
    )
    print("  " + ", ".join(f"{name} {cost:.2f}" for name, cost in costs.items()))
    print("  first call, s: " + ", ".join(f"{name} {first:.1f}" for name, first in firsts.items()))
    print(f"  {len(motions) - sum(motion.run is None for motion in motions)} of them can be run along; ", end="")
    print(f"lower bound less by {gaps.mean():.2%} on average, {gaps.max():.2%} at worst, before proofs")
    if toppra is None:
        return
    rows = []
    for path, solution, second_derivative in list(zip(paths, solutions, still, strict=True))[: args.toppra]:
        gravity, run = float(problem.robot.gravity), run_of(solution, path, second_derivative)
        ours = np.inf if run is None else cell_times(run, path.grid.width).sum()
        theirs = by_toppra(path.grid.nodes, *half_planes(path, gravity))
        rows.append((ours * np.sqrt(gravity / path.grid.nodes[-1]), *theirs))
    ours, theirs, setting, solving = np.array(rows).T
    both = np.isfinite(ours) & np.isfinite(theirs)
    apart = np.abs(theirs[both] / ours[both] - 1.0).max(initial=0.0)
    once, whole = 1e3 * solving.mean(), costs["half-planes"] + costs["solving"]
    print(
        f"  toppra: {once:.2f}, and {1e3 * setting.mean():.2f} to set up; {once / costs['solving']:.1f} times as long "
        f"as solving, {once / whole:.1f} times as long as half-planes and solving; "
        f"T apart by {apart:.1e} at most, {(np.isfinite(ours) != np.isfinite(theirs)).sum()} verdicts differ"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--paths", type=int, default=64, help="that are solved together")
    parser.add_argument("--proofs", type=int, default=8, help="of them whose certificates and lower bounds are timed")
    parser.add_argument("--toppra", type=int, default=10, help="of them that toppra solves")
    parser.add_argument("--cells", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if toppra is None:
        print("toppra is not installed: pip install 'cspr_jax[peers]'")
    with double_precision():
        for kind in args.kinds:
            compared(kind, args)


if __name__ == "__main__":
    main()

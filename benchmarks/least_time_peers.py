"""Least times along paths by toppra, if it is installed, on the same half-planes: T, and CPU seconds a path.

Half-planes are those of the tests' reference, at both ends of cells for the same u, handed over as they are: then
toppra's own conversion, canlinear_colloc_to_interpolate, which returns the bounds of x and u in the other order than
its constraints do, is not in the way. The seconds leave out making them. Beside it: the reference's T.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import any_motion_cases, least_time, path_rows

try:
    import toppra
    from toppra.constraint import DiscretizationType, LinearConstraint
except ImportError:
    toppra = None

# Kinds of the reference's robots, and limits of tensions over the weight.
KINDS = {"3T-3": (0.02, 2.0), "3T-4": (0.02, 2.0), "3R3T-6": (0.02, 2.0), "3R3T-8": (0.02, 2.0)}
SIZES = (200, 500, 1000)


def problem_of(rng, kind, count):
    """A random path inside a robot's footprint, and its problem."""
    robot, reference, ranges, _ = any_motion_cases.random_robot(rng, kind)
    points = reference + 0.5 * ranges * rng.uniform(-1.0, 1.0, (6, 3))
    turns = None
    if robot["platform_points"] is not None:
        turns = np.concatenate([np.ones((6, 1)), 0.05 * rng.uniform(-1.0, 1.0, (6, 3))], axis=1)
    weight, cables = robot["mass"] * robot["gravity"], len(robot["base_points"])
    low, high = (np.full(cables, share * weight) for share in KINDS[kind])
    return least_time.problem(robot, {"tension_min": low, "tension_max": high}, path_rows.through(points, turns), count)


def half_planes(problem):
    """Rows A u + B x <= C of the cells in units that make them about 1, arrays (N, rows)."""
    # An interval of x_(i+1) without ends gives two rows that never hold back; toppra has its own.
    cells = [problem.cell(i, (0.0, np.inf)) for i in range(len(problem.nodes) - 1)]
    a, b, c = (np.stack([cell[k][:-2] for cell in cells]) for k in range(3))
    size = np.maximum(np.maximum(np.abs(a), np.abs(b)), 1e-300)
    return a / size, b / size, c / size


def by_toppra(nodes, a, b, c):
    """T by toppra over 0 <= s <= 1, in units of time sqrt(L / g), and CPU seconds for setting up and for solving."""

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


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paths", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if toppra is None:
        print("toppra is not installed: pip install toppra")
    for kind in KINDS:
        for count in SIZES:
            rng = np.random.default_rng(args.seed)
            rows = []
            for _ in range(args.paths):
                problem = problem_of(rng, kind, count)
                planes = half_planes(problem)
                began = time.process_time()
                solution = least_time.solved(problem)
                spent = time.process_time() - began
                # Of the reference in units of sqrt(L / g).
                unit = np.sqrt(problem.path.length / problem.robot["gravity"])
                theirs = by_toppra(problem.nodes, *planes) if toppra else (np.nan,) * 3
                rows.append((solution.time / unit, spent, *theirs))
            ours, spent, theirs, setting, solving = np.array(rows).T
            both = np.isfinite(ours) & np.isfinite(theirs)
            apart = np.abs(theirs[both] / ours[both] - 1.0).max(initial=0.0)
            print(
                f"{kind} N = {count}, {planes[0].shape[1]} rows: toppra {1e3 * solving.mean():.2f} ms "
                f"(and {1e3 * setting.mean():.2f} to set up), reference {1e3 * spent.mean():.1f} ms, "
                f"T from {np.nanmin(theirs):.4f} to {np.nanmax(theirs):.4f} sqrt(L/g), apart by {apart:.1e} at most, "
                f"{(np.isfinite(ours) != np.isfinite(theirs)).sum()} verdicts differ"
            )


if __name__ == "__main__":
    main()

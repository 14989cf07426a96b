"""Workspaces that papers on other programs compute: counts of poses, and times beside other methods.

The grids are those of CASPR (Lau et al., IROS 2016, Table I: IPAnema 2, wrench closure, printed times 89 to 455 s), of
CASPR's model of IPAnema 1, and of the CoGiRo robot in cdpyr. No source prints counts of poses.
"""

import time
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax.build.robots import load_robot
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.tensions.tension_programs import CLOSE, by_program, by_squares
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import CLOSURE, FEASIBLE, STATIC, Requirement, requirement
from cspr_jax.workspaces.search import WorkspaceSearch

# Number of poses, evenly over the grid, that linear programs and least squares check too.
SAMPLE = 60
MICRO = 1e6


class PoseGrid(NamedTuple):
    """A study: one condition on a grid of poses.

    Fields:
        name: name of its row in the table.
        robot: name in the catalogue.
        condition: one of `workspaces.requirements.CONDITIONS`.
        positions: (n, 3) of the origin of the platform's axes, in the axes of the file, m.
        quaternions: (n, 4) unit quaternions, scalar first.
    """

    name: str
    robot: str
    condition: str
    positions: np.ndarray
    quaternions: np.ndarray


def _product(*axes: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))


def _quaternions(angles: np.ndarray) -> np.ndarray:
    # CASPR's convention is R = Rx Ry Rz.
    return Rotation.from_euler("XYZ", angles).as_quat(scalar_first=True)


def grids() -> list[PoseGrid]:
    """All studies."""
    level = _product(np.linspace(-4.0, 4.0, 81), np.linspace(-3.0, 3.0, 61), np.array([2.0, 3.0, 4.0]))
    tilted = np.repeat(_quaternions(np.deg2rad([[30.0, -30.0, 5.0]])), len(level), axis=0)
    studies = [
        PoseGrid(f"{name}, closure", robot, CLOSURE, level, tilted)
        for name, robot in (("IPAnema 2", "ipanema-2"), ("IPAnema 2, set IROS 2016", "ipanema-2-iros"))
    ]
    ends, steps = np.array([2.0, 1.5, 1.0, 0.5, 0.5, 0.1]), (11, 11, 11, 5, 5, 3)
    poses = _product(*[np.linspace(-end, end, count) for end, count in zip(ends, steps, strict=True)])
    poses[:, 2] += 1.0
    for condition in (FEASIBLE, STATIC, CLOSURE):
        studies.append(
            PoseGrid(f"IPAnema 1, {condition}", "ipanema-1", condition, poses[:, :3], _quaternions(poses[:, 3:]))
        )
    cube = _product(np.linspace(-6.0, 6.0, 10), np.linspace(-4.0, 4.0, 10), np.linspace(0.0, 4.0, 10))
    upright = np.repeat(_quaternions(np.zeros((1, 3))), len(cube), axis=0)
    studies += [
        PoseGrid(f"CoGiRo, {condition}", "cogiro", condition, cube, upright) for condition in (FEASIBLE, STATIC)
    ]
    return studies


def peers() -> dict[Key, float | None]:
    """The table: numbers of poses, of those inside and on the boundary, and microseconds a pose by three methods.

    Times include the first poses, for which programs are compiled. Linear programs (HiGHS) and least squares (NNLS)
    check some poses of the grid in the same run.
    """
    cells: dict[Key, float | None] = {}
    for grid in grids():
        for column, value in _row(grid).items():
            cells[grid.name, column, ""] = value
    return cells


def _row(grid: PoseGrid) -> dict[str, float]:
    robot = load_robot(grid.robot)
    centred_robot, frame = centred(robot)
    demand = requirement(centred_robot, grid.condition, robot.limits if grid.condition == FEASIBLE else Limits())
    quaternions = frame.rotated_quaternions(grid.quaternions)
    centres = mass_centres(centred_robot, np.asarray(frame.inward(grid.positions)), quaternions)
    start = time.perf_counter()
    search = WorkspaceSearch(centred_robot, demand)
    answers = search(centres, quaternions)
    count, seconds = len(centres), time.perf_counter() - start
    sample = np.linspace(0, count - 1, min(SAMPLE, count)).astype(int)
    matrices = np.asarray(geometry.wrench_matrices(centred_robot, centres[sample], quaternions[sample]))
    matrices = matrices / search.unit[:, None]
    wrench = search.required(centres[0], quaternions[0]).corners[0]
    limits = (None, None) if grid.condition == CLOSURE else (demand.low, demand.high)
    inside, clear = answers.verdict[sample] == 0, np.abs(answers.margin[sample]) > CLOSE * _magnitude(demand)
    numbers = {
        "poses": float(count),
        "inside": float((answers.verdict == 0).sum()),
        "on the boundary": float((answers.verdict == Verdict.UNDECIDED).sum()),
        "us a pose": MICRO * seconds / count,
    }
    for name, decide in (("HiGHS", by_program), ("NNLS", by_squares)):
        start = time.perf_counter()
        verdicts = np.array([decide(matrix, wrench, *limits) for matrix in matrices])
        numbers[f"us, {name}"] = MICRO * (time.perf_counter() - start) / len(sample)
        numbers[f"differ, {name}"] = float(((verdicts != inside) & clear).sum())
    return numbers


def _magnitude(demand: Requirement) -> float:
    finite = demand.high[np.isfinite(demand.high)]
    return 1.0 if demand.condition == CLOSURE else float(max([*demand.low, *finite, demand.wrenches.magnitude]))

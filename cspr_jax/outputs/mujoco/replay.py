"""A plan played in MuJoCo: the path on which its tensions take the model, and MuJoCo's tensions along the plan."""

from __future__ import annotations

import contextlib
import dataclasses
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.outputs.mujoco.mjcf import model_xml
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import STEP, Played, Suspended, coordinates, played, suspended, upward
from cspr_jax.outputs.table_layout import two_digits
from cspr_jax.plans.planning import PlannedMotions

_LENT = threading.Lock()


class PlayedPath(NamedTuple):
    """Path of MuJoCo's robot.

    Fields:
        position: (n, 3) position of the mass centre, m.
        rotated: (n,) angle from the planned orientation, rad; 0 for a point mass.
    """

    position: np.ndarray
    rotated: np.ndarray


@dataclasses.dataclass(frozen=True)
class PlayedPlan:
    """A plan and the motion that MuJoCo computes from it, at the ends of steps; in the axes of the robot file.

    Fields:
        robot: name of the robot.
        z_axis: direction of its z axis, "down" or "up".
        mujoco: version of MuJoCo.
        steps: number of steps.
        time: (n,) time from the start of the plan, s; twice where segments meet or the acceleration may jump.
        segment: (n,) number of the segment, from 1 on.
        position: (n, 3) planned position, m.
        played: path of MuJoCo's robot under the tensions, each segment from its planned start.
        through: the same with all segments in succession, from the start of the plan.
        tension: (n, n_cables) planned tensions, N; for parallel pairs, of all six cables.
        tension_deviation: (n, n_cables) change of these tensions, with the least sum of squares, that makes them supply
            the wrench of MuJoCo's inverse dynamics along the plan's path, N; on as many cables as degrees of freedom it
            is the difference of the two programs' tensions.
    """

    robot: str
    z_axis: str
    mujoco: str
    steps: int
    time: np.ndarray
    segment: np.ndarray
    position: np.ndarray
    played: PlayedPath
    through: PlayedPath
    tension: np.ndarray
    tension_deviation: np.ndarray

    @property
    def path_deviation(self) -> np.ndarray:
        """Distance from the plan if each segment is played from its planned start, (n,) m."""
        return np.linalg.norm(self.played.position - self.position, axis=1)

    @property
    def through_deviation(self) -> np.ndarray:
        """Distance from the plan if all segments are played in succession, (n,) m."""
        return np.linalg.norm(self.through.position - self.position, axis=1)

    def to_dict(self) -> dict[str, Any]:
        """The largest deviations, and where they occur, as plain values."""
        cable = np.abs(self.tension_deviation).argmax(1)
        of_cables = np.abs(self.tension_deviation).max(1)
        deviations = {
            "path": self._largest(self.path_deviation, "m"),
            "path_in_one_go": self._largest(self.through_deviation, "m"),
            "turn": self._largest(self.played.rotated, "rad"),
            "turn_in_one_go": self._largest(self.through.rotated, "rad"),
            "tension": self._largest(of_cables, "N") | {"cable": int(cable[of_cables.argmax()]) + 1},
        }
        full = {"robot": self.robot, "mujoco": self.mujoco, "duration": float(self.time[-1]), "steps": self.steps}
        return full | {"largest_deviation": deviations}

    def _largest(self, values: np.ndarray, units: str) -> dict[str, Any]:
        row = int(values.argmax())
        where = {"t": float(self.time[row]), "segment": int(self.segment[row])}
        return {"value": float(values[row]), "units": units, **where}

    def lines(self) -> list[str]:
        """The largest deviations for people."""
        deviations = self.to_dict()["largest_deviation"]
        text = [f"{self.robot}: {self.time[-1]:.2f} s in {self.steps} steps of MuJoCo {self.mujoco}"]
        for name, how in (("", "each segment from its start"), ("_in_one_go", "all in one go")):
            far, turn = deviations[f"path{name}"], deviations[f"turn{name}"]
            angle = f" and {two_digits(turn['value'])} rad" if self.played.rotated.any() else ""
            text.append(f"path, {how}: at most {two_digits(far['value'])} m{angle} off the plan, {_time_text(far)}")
        maximum = deviations["tension"]
        text.append(
            f"tensions: at most {two_digits(maximum['value'])} N off, cable {maximum['cable']}, {_time_text(maximum)}"
        )
        return text


def _time_text(deviation: dict[str, Any]) -> str:
    return f"at {deviation['t']:.2f} s in segment {deviation['segment']}"


def replay(plan: PlannedMotions, step: float = STEP) -> PlayedPlan:
    """Play a plan in MuJoCo."""
    mujoco = need_mujoco()
    body, moved = suspended(plan), played(plan, step)
    rows, world = ends_of_steps(moved), upward(plan.robot_file.z_axis)
    paths = [path_of(body, moved, step, by_segment=by_segment) for by_segment in (True, False)]
    by_segment_path, through = (path._replace(position=world.rotated(path.position)) for path in paths)
    return PlayedPlan(
        robot=plan.robot_file.name,
        z_axis=plan.robot_file.z_axis,
        mujoco=mujoco.__version__,
        steps=len(rows) - len(moved.runs()),
        time=moved.time[rows],
        segment=moved.segment[rows],
        position=world.rotated(moved.position[rows]),
        played=by_segment_path,
        through=through,
        tension=moved.tension[rows],
        tension_deviation=tension_deviation(body, moved),
    )


def ends_of_steps(moved: Played) -> Int[np.ndarray, "n"]:
    """Rows of a motion at which steps start or end."""
    return np.concatenate([np.asarray(run[::2]) for run in moved.runs()])


def path_of(body: Suspended, moved: Played, step: float = STEP, *, by_segment: bool) -> PlayedPath:
    """Path of MuJoCo's robot under the tensions of a motion."""
    return path_under(body, moved, lambda row, _: moved.tension[row], step, by_segment=by_segment)


def path_under(
    body: Suspended,
    moved: Played,
    forces: Callable[[int, Any], Float[np.ndarray, "n_cables"]],
    step: float = STEP,
    *,
    start: Float[np.ndarray, "nq"] | None = None,
    by_segment: bool = False,
) -> PlayedPath:
    """Path of MuJoCo's robot under forces of its cables, by MuJoCo's own integrator.

    Forces are a function of the row of the motion and of MuJoCo's state. From a given `start` they have no limits.
    """
    mujoco = need_mujoco()
    qpos, rates, _ = coordinates(body, moved)
    reached, row = [], 0

    def control(model: Any, data: Any) -> None:
        # RK4 calls this at the start of a step, twice in its middle, and at its end.
        data.ctrl[:] = forces(row + round(2.0 * (data.time - moved.time[row]) / model.opt.timestep), data)

    with callback_lent(mujoco):
        model = mujoco.MjModel.from_xml_string(model_xml(body, moved, step))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        if start is not None:
            model.actuator_ctrllimited[:] = 0
            data.qpos[:] = start
        mujoco.set_mjcb_control(control)
        for run in moved.runs():
            if by_segment and moved.segment[run.start] != moved.segment[run.start - 1]:
                data.qpos[:], data.qvel[:] = qpos[run.start], rates[run.start]
            reached.append(data.qpos.copy())
            for row in run[:-1:2]:
                data.time, model.opt.timestep = moved.time[row], moved.time[row + 2] - moved.time[row]
                mujoco.mj_step(model, data)
                reached.append(data.qpos.copy())
    return path_at(moved, np.array(reached), body.axes, ends_of_steps(moved))


@contextlib.contextmanager
def callback_lent(mujoco: Any) -> Iterator[None]:
    """Lend MuJoCo's control callback, of which a process has one, and which it calls even while it compiles a model."""
    with _LENT:
        before = mujoco.get_mjcb_control()
        mujoco.set_mjcb_control(None)
        try:
            yield
        finally:
            mujoco.set_mjcb_control(before)


def path_at(
    moved: Played, reached: Float[np.ndarray, "n nq"], axes: Sequence[int], rows: Any = slice(None)
) -> PlayedPath:
    """Path of the effector from the coordinates of MuJoCo's joints, at some rows of a motion."""
    position = np.array(moved.position[rows])
    rotated = np.zeros(len(position))
    if moved.rotation is None:
        position[:, list(axes)] = reached[:, : len(axes)]
    else:
        position[:], quaternions = reached[:, :3], np.roll(reached[:, 3:7], -1, axis=1)
        rotated = (moved.rotation[rows].inv() * Rotation.from_quat(quaternions)).magnitude()
    return PlayedPath(position, rotated)


def tension_deviation(body: Suspended, moved: Played) -> Float[np.ndarray, "n n_cables"]:
    """Difference between tensions of a motion and those that MuJoCo's inverse dynamics requires along its path."""
    mujoco = need_mujoco()
    with callback_lent(mujoco):
        model = mujoco.MjModel.from_xml_string(model_xml(body, moved))
    # The pulleys are placed in the planes of their cables, so that constraints for that are not needed.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    rows, freedoms = ends_of_steps(moved), model.nv - len(body.wheels)
    data, (qpos, rates, accelerations) = mujoco.MjData(model), coordinates(body, moved)
    jacobians, forces = np.empty((len(rows), freedoms, model.nu)), np.empty((len(rows), freedoms))
    for i, row in enumerate(rows.tolist()):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[row], rates[row], accelerations[row]
        mujoco.mj_inverse(model, data)
        # A positive tension shortens its cable, hence the sign.
        jacobians[i], forces[i] = -_tendons(model, data)[: model.nu, :freedoms].T, data.qfrc_inverse[:freedoms]
    missing = forces - np.einsum("nij,nj->ni", jacobians, moved.tension[rows])
    return np.einsum("nji,ni->nj", np.linalg.pinv(jacobians), missing)


def _tendons(model: Any, data: Any) -> np.ndarray:
    # Jacobian of the tendons, (ntendon, nv). MuJoCo may keep only the coordinates on which a tendon depends.
    if data.ten_J.size == model.ntendon * model.nv:
        return np.reshape(data.ten_J, (model.ntendon, model.nv))
    matrix = np.zeros((model.ntendon, model.nv))
    row = np.repeat(np.arange(model.ntendon), model.ten_J_rownnz)
    matrix[row, model.ten_J_colind] = data.ten_J
    return matrix

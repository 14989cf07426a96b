"""A plan played in MuJoCo on elastic cables, by drums that set lengths: with and without compensation of the stretch.

Drums set unstretched lengths l0 over time, whatever the effector does; each cable pulls with EA (l / l0 - 1), and with
the damping times the rate of that strain, but never pushes. With compensation l0 = l / (1 + f / EA), from planned
lengths l and tensions f: the planned motion then solves the equations of motion. Without, l0 = l: the effector hangs
lower from the start, where it would hang if cables could push, or else in the planned place.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np
from jax import Array
from scipy.spatial.transform import Rotation

from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.mujoco.mjcf import check_elastic, leads, unstretched_of
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import STEP, Played, Suspended, coordinates, played, suspended, upward
from cspr_jax.outputs.mujoco.replay import PlayedPath, ends_of_steps, path_under
from cspr_jax.outputs.table_layout import two_digits
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.elasticity.equilibrium import Settled, settled
from cspr_jax.robots.elasticity.natural_frequencies import modes_in, tensions_in
from cspr_jax.robots.elasticity.stiffness import pose_lengths

# Longest step, times the highest natural frequency.
FASTEST = 0.5
# An equilibrium may miss its wrench by this fraction of the weight.
BALANCED = 1e-6


@dataclasses.dataclass(frozen=True)
class ElasticPlan:
    """A plan, and its motion on elastic cables in MuJoCo, at the ends of steps; in the axes of the robot file.

    Fields:
        robot: name of the robot.
        z_axis: direction of its z axis, "down" or "up".
        mujoco: version of MuJoCo.
        steps: number of steps.
        time: (n,) time from the start of the plan, s.
        position: (n, 3) planned position of the mass centre, m.
        compensated: path if drums set unstretched lengths.
        uncompensated: path if drums set the lengths of cables that do not stretch, from where the robot hangs then.
        settled: distance from the planned end at which the robot comes to rest without compensation, m; NaN where a
            cable is slack there, or where no equilibrium was found.
    """

    robot: str
    z_axis: str
    mujoco: str
    steps: int
    time: np.ndarray
    position: np.ndarray
    compensated: PlayedPath
    uncompensated: PlayedPath
    settled: float

    def deviation(self, path: PlayedPath) -> np.ndarray:
        """Distance of a path from the plan, (n,) m."""
        return np.linalg.norm(path.position - self.position, axis=1)

    def to_dict(self) -> dict[str, Any]:
        """Deviations with and without compensation, at the end and at most, as plain values."""
        full = {"robot": self.robot, "mujoco": self.mujoco, "duration": float(self.time[-1]), "steps": self.steps}
        paths = {name: self._of(getattr(self, name)) for name in ("compensated", "uncompensated")}
        paths["uncompensated"]["settled"] = self.settled if np.isfinite(self.settled) else None
        return full | paths

    def _of(self, path: PlayedPath) -> dict[str, Any]:
        distance = self.deviation(path)
        row, turn = int(distance.argmax()), int(path.rotated.argmax())
        return {
            "end": {"distance": float(distance[-1]), "turn": float(path.rotated[-1])},
            "largest": {"distance": float(distance[row]), "t": float(self.time[row])},
            "largest_turn": {"turn": float(path.rotated[turn]), "t": float(self.time[turn])},
        }

    def lines(self) -> list[str]:
        """Deviations for people."""
        values = self.to_dict()
        text = [f"{self.robot}: {self.time[-1]:.2f} s in {self.steps} steps of MuJoCo {self.mujoco}, elastic cables"]
        for name, how in (("compensated", "unstretched lengths set"), ("uncompensated", "stretch not compensated")):
            of_way = values[name]
            end, largest = (_distance(of_way[key]["distance"]) for key in ("end", "largest"))
            turn, largest_turn = of_way["end"]["turn"], of_way["largest_turn"]["turn"]
            angles = f" and {two_digits(turn)} rad", f" and {two_digits(largest_turn)} rad"
            first, second = angles if largest_turn > 0.0 else ("", "")
            at = f"at most {largest}{second}, at {of_way['largest']['t']:.2f} s"
            text.append(f"{how}: {end}{first} off the plan at the end, {at}")
        if np.isfinite(self.settled):
            text[-1] += f"; it comes to rest {_distance(self.settled)} off"
        return text


def _distance(value: float) -> str:
    return f"{two_digits(value)} m"


def replay_elastic(plan: PlannedMotions, step: float = STEP) -> ElasticPlan:
    """Play a plan in MuJoCo on elastic cables; steps are shorter where natural frequencies are high."""
    mujoco, body = need_mujoco(), suspended(plan)
    check_elastic(plan, body)
    start, end = (_hanging(plan, *ends) for ends in ((plan.legs[0].motions[0], 0.0), (plan.legs[-1].motions[-1], 1.0)))
    moved = played(plan, min(step, FASTEST / _highest(plan)))
    rows, world = ends_of_steps(moved), upward(plan.robot_file.z_axis)
    planned = coordinates(body, moved)[0][0]
    is_hanging = float(start.missed) <= BALANCED
    qpos = planned, coordinates(body, _started(plan, moved, start))[0][1] if is_hanging else planned
    lengths = unstretched_of(body, moved), np.asarray(moved.length)
    paths = [_path(body, moved, *each) for each in zip(qpos, lengths, strict=True)]
    compensated, uncompensated = (path._replace(position=world.rotated(path.position)) for path in paths)
    last, aim = plan.frame.outward(np.asarray(end.state.position)), world.rotated(moved.position[-1])
    is_settled = end.missed <= BALANCED and np.asarray(end.tensions > 0.0).all()
    return ElasticPlan(
        robot=plan.robot_file.name,
        z_axis=plan.robot_file.z_axis,
        mujoco=mujoco.__version__,
        steps=len(rows) - len(moved.runs()),
        time=moved.time[rows],
        position=world.rotated(moved.position[rows]),
        compensated=compensated,
        uncompensated=uncompensated,
        settled=float(np.linalg.norm(last - aim)) if is_settled else float("nan"),
    )


def _hanging(plan: PlannedMotions, motion: Motion, tau: float) -> Settled:
    # The pose in which the robot hangs if drums set the lengths of cables that do not stretch.
    robot = plan.problem.robot
    states = states_at(motion, np.array([tau]))
    tensions = tensions_in(robot, states, plan.problem.limits, plan.keys.tension_rule)[0]
    state = jax.tree.map(lambda values: values[0], states)
    solution: Settled = _settled(robot, state, tensions)
    return solution._replace(missed=solution.missed / (robot.mass * robot.gravity))


@jax.jit
def _settled(robot: Any, state: Any, tensions: Array) -> Settled:
    return settled(robot, state, tensions, pose_lengths(robot, state))


def _highest(plan: PlannedMotions) -> float:
    # Highest natural frequency at both ends of all segments.
    robot, highest = plan.problem.robot, 1e-9
    for leg in plan.legs:
        for motion in leg.motions:
            states = states_at(motion, np.array([0.0, 0.5, 1.0]))
            tensions = tensions_in(robot, states, plan.problem.limits, plan.keys.tension_rule)
            highest = float(np.fmax(highest, np.nanmax(modes_in(robot, states, tensions).frequencies, initial=0.0)))
    return highest


def _started(plan: PlannedMotions, moved: Played, start: Settled) -> Played:
    # The planned start, and the place where the robot hangs then.
    world = upward(plan.robot_file.z_axis)
    position = world.rotated(plan.frame.outward(np.asarray(start.state.position)))
    changes: dict[str, Any] = {
        "position": np.stack([moved.position[0], position]),
        "velocity": moved.velocity[:2],
        "acceleration": moved.acceleration[:2],
    }
    if moved.rotation is not None and moved.omega is not None and moved.omega_dot is not None:
        rotation = world.rotated_tensor(plan.frame.rotated_tensor(np.asarray(start.state.rotation)))
        both = Rotation.from_matrix(np.stack([moved.rotation[0].as_matrix(), rotation]))
        changes |= {"rotation": both, "omega": moved.omega[:2], "omega_dot": moved.omega_dot[:2]}
    return dataclasses.replace(moved, **changes)


def _path(
    body: Suspended, moved: Played, qpos: Float[np.ndarray, "nq"], unstretched: Float[np.ndarray, "n n_cables"]
) -> PlayedPath:
    # Path from a start, with unstretched lengths over time.
    stiffness, lead, rates = body.axial_stiffness, leads(body), _rates(moved, unstretched)
    count = len(body.spools)

    def forces(row: int, data: Any) -> np.ndarray:
        strain = (data.ten_length[:count] - lead) / unstretched[row] - 1.0
        rate = (data.ten_velocity[:count] - (strain + 1.0) * rates[row]) / unstretched[row]
        return np.maximum(stiffness * strain + body.axial_damping * rate, 0.0)

    return path_under(body, moved, forces, start=qpos)


def _rates(moved: Played, lengths: Float[np.ndarray, "n n_cables"]) -> Float[np.ndarray, "n n_cables"]:
    # Derivatives of lengths in time, by differences within each run.
    return np.concatenate([np.gradient(lengths[run], moved.time[run], axis=0) for run in map(list, moved.runs())])

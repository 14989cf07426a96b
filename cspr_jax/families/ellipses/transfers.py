"""Transfers between ellipses: the smallest number of arcs (half turns) whose motion is proved."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.motion import EllipseMotion, integral, with_turns
from cspr_jax.families.ellipses.rotation import Rotation, turn_between
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import MotionProof, proof_of, sampled_proof
from cspr_jax.verification.smallest_proved import NONE, smallest_proved

# Number of intervals between samples, which refute most motions before a proof is tried.
FEW = 256
# Angles that differ by less than this count as the same, rad.
SAME_ANGLE = 1e-9


@dataclasses.dataclass(frozen=True)
class Turning:
    """Ellipse with a frequency, an angle on it, and the orientation of a platform.

    Fields:
        ellipse: leaves (3,); at rest its axes are zero.
        frequency: rad/s; 0 at rest: a transfer then has the frequency of its other end.
        phase: angle, rad.
        quaternion: (4,) mean orientation; None for a point mass.
        axis: (3,) unit vector of the axis of oscillation.
        oscillation: (2,) angles p and q of `rotation`, rad.
    """

    ellipse: Ellipse
    frequency: float = 0.0
    phase: float = 0.0
    quaternion: np.ndarray | None = None
    axis: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(3)[0])
    oscillation: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(2))

    @property
    def rests(self) -> bool:
        """Tell whether it is at rest."""
        return self.frequency == 0.0

    def is_same(self, other: "Turning") -> bool:
        """Tell whether another one has the same ellipse and frequency, at any angle."""
        return all(np.array_equal(a, b) for a, b in zip(self._parts, other._parts, strict=True))

    @property
    def _parts(self) -> tuple:
        turning = () if self.quaternion is None else (self.quaternion, self.axis, self.oscillation)
        return (*self.ellipse, self.frequency, *turning)


class Transfer(NamedTuple):
    """A transfer that was tried.

    Fields:
        motion: the transfer and the turns after it.
        proof: proof of the full motion.
        arcs: number of half turns of the transfer.
        fewer_undecided: whether a motion with fewer arcs stayed undecided.
    """

    motion: EllipseMotion
    proof: MotionProof
    arcs: int
    fewer_undecided: bool = False


def step_of(first: Turning, last: Turning) -> int:
    """Step between possible numbers of arcs: 1 if the angle at a rest is free, else 2; 0 if no transfer is needed."""
    if first.is_same(last):
        return 0
    return 1 if first.rests or last.rests else 2


def between(first: Turning, last: Turning) -> float:
    """Angle from one to the other, the smallest in the direction of the motion."""
    full = 2.0 * math.pi
    angle = (last.phase - first.phase) % full
    return 0.0 if min(angle, full - angle) < SAME_ANGLE else angle


def motion_between(amplitude: Amplitude, first: Turning, last: Turning, arcs: int, turns: float) -> EllipseMotion:
    """Motion from one ellipse to another, and turns on the latter."""
    step, full = step_of(first, last), 2.0 * math.pi
    start, end = first.frequency or last.frequency, last.frequency or first.frequency
    rest = between(first, last)
    swept = (rest, math.pi * arcs, (rest or full) + math.pi * (arcs - 2))[step]
    phase = last.phase - swept if first.rests else first.phase
    mean = start + (end - start) * float(integral(amplitude).at(1.0))
    transfer_time, turning_time = (swept / mean if step else 0.0), turns * full / end + (0.0 if step else swept / end)
    law = with_turns(amplitude, transfer_time / (transfer_time + turning_time) if step else 0.0)
    frequencies, complete = as_float64([start, end]), as_float64(transfer_time + turning_time)
    rotation = rotation_between(first, last)
    return EllipseMotion(
        first.ellipse, last.ellipse, frequencies, as_float64(phase), law, integral(law), complete, rotation
    )


def rotation_between(first: Turning, last: Turning) -> Rotation | None:
    """Rotation of a platform on the transfer from one ellipse to another."""
    if first.quaternion is None or last.quaternion is None:
        return None
    axis = last.axis if last.oscillation.any() else first.axis
    turn = turn_between(first.quaternion, last.quaternion)
    return Rotation(
        as_float64(first.quaternion),
        turn,
        as_float64(axis),
        as_float64(first.oscillation),
        as_float64(last.oscillation),
    )


def smallest_transfer(
    problem: Problem, first: Turning, last: Turning, turns: float, scene: Scene | None, *, arcs: int, max_arcs: int
) -> Transfer:
    """The transfer with the smallest number of arcs that is proved, and the turns after it."""
    step, transfers = step_of(first, last), dict[int, Transfer]()

    def trial(_: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        number = int(numbers[0])
        motion = motion_between(problem.amplitude, first, last, number, turns)
        proof = sampled_proof(problem, motion, scene, FEW)
        if not proof.broken.any():
            proof = proof_of(problem, motion, scene)
        transfers[number] = Transfer(motion, proof, number)
        return numbers, np.array([proof.verdict])

    lowest, highest = (step, max_arcs) if step and not arcs else (arcs, arcs)
    smallest = smallest_proved(trial, np.array([lowest]), step=max(step, 1), last=highest)
    number, undecided = int(smallest.number[0]), int(smallest.undecided[0])
    if number != NONE:
        return transfers[number]._replace(fewer_undecided=undecided != NONE)
    if undecided != NONE:
        return transfers[undecided]
    best = max(transfers.values(), key=lambda each: float((each.proof.proof.high / each.proof.scales).min()))
    # Samples have refuted this motion: prove it now for its causes.
    return best._replace(proof=proof_of(problem, best.motion, scene))

"""Verifier of any motion between two poses, by samples: limits, ends, derivatives, and whether accelerations jump.

Derivatives agree with what they are derivatives of by the corrected trapezoidal rule between neighbours,

    p(t + h) - p(t) = h (v_0 + v_1) / 2 - h^2 (a_1 - a_0) / 12 + O(h^5),
    v(t + h) - v(t) = h (a_0 + a_1) / 2 + O(h^3),

and so do rotations, by the vector of the rotation from one sample to the next. Where accelerations jump, halving the
interval in which they change most leaves the jump.
"""

import dataclasses

import numpy as np

from . import any_motion, free_motions, least_time_bounds, sampled_motion

SUSPECTS = 200


@dataclasses.dataclass(frozen=True)
class Verification:
    """What samples say of a motion, each number over the size of what it is compared with.

    slacks: least of each limit: over the weight, or the limit; negative where it is broken. depth: least one below the
    plane of the spools, over their spread, where motions have to stay below; else infinite. ends: largest difference of
    "position" (over the distance to the spools), "velocity" (over the largest one), "rotation" (rad), "omega".
    smoothness: largest residual of "position", "velocity", "rotation", "omega" where the next derivative is integrated,
    and "acceleration jump", "alpha jump".
    """

    slacks: dict
    depth: float
    ends: dict
    smoothness: dict

    def faults(self, near=1e-6, rough=1e-4):
        """What is wrong by more than a share, as words; rough: of derivatives, and jumps; none: the motion is good."""
        found = [f"limit {name}: {slack:.3g}" for name, slack in self.slacks.items() if not slack >= -near]
        found += [f"depth: {self.depth:.3g}"] * (not self.depth >= -near)
        found += [f"end {name}: {value:.3g}" for name, value in self.ends.items() if not value <= near]
        return found + [f"{name}: {value:.3g}" for name, value in self.smoothness.items() if not value <= rough]


def rotated(before, after):
    """Vectors of the rotations from rotations (k, 3, 3) to others, by less than pi."""
    turn = after @ np.swapaxes(before, 1, 2)
    odd = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1
    )
    sine, cosine = np.linalg.norm(odd, axis=1), 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
    angle = np.arctan2(sine, cosine)
    return odd * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-300), 1.0)[:, None]


def largest(vectors):
    """Largest length of vectors (k, 3)."""
    return float(np.linalg.norm(vectors, axis=1).max())


def residuals(a, b, h):
    """How far two states with the times h (k,) between them are from agreeing, dict of (k, 3), m, m/s, rad, ..."""
    h = np.asarray(h)[:, None]

    def stepped(first, second=None):
        """Step by the corrected rule, or by the trapezoidal one."""
        v, w = (getattr(x, first) for x in (a, b))
        return 0.5 * h * (v + w) - (0.0 if second is None else h**2 / 12.0 * (getattr(b, second) - getattr(a, second)))

    return {
        "position": b.position - a.position - stepped("velocity", "acceleration"),
        "velocity": b.velocity - a.velocity - stepped("acceleration"),
        "rotation": rotated(a.rotation, b.rotation) - stepped("omega", "alpha"),
        "omega": b.omega - a.omega - stepped("alpha"),
        "acceleration jump": b.acceleration - a.acceleration,
        "alpha jump": b.alpha - a.alpha,
    }


# Of what a residual is a share: the step by the largest of these, or a jump of them; by which one intervals are chosen,
# as what jumps is integrated badly; and how often they are halved, as rounding lets.
SIZES = {
    "position": ("velocity", True, "position", 8),
    "velocity": ("acceleration", True, "velocity", 8),
    "rotation": ("omega", True, "rotation", 8),
    "omega": ("alpha", True, "omega", 8),
    "acceleration jump": ("acceleration", False, "velocity", 20),
    "alpha jump": ("alpha", False, "omega", 20),
}


def smoothness(state, times):
    """Largest residuals, as shares, dict; where they are largest, intervals are halved: kinks of a smooth motion go."""
    known, shares = state(times), {}
    a, b = (sampled_motion.State(*(v[s] for v in vars(known).values())) for s in (slice(None, -1), slice(1, None)))
    for name, (unit, is_step, chosen, halvings) in SIZES.items():

        def off(a, b, h, chosen=chosen):
            return np.linalg.norm(residuals(a, b, h)[chosen], axis=1)

        at = np.argsort(-off(a, b, np.diff(times)))[:SUSPECTS]
        low, high = times[at], times[at + 1]
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            states = [state(t) for t in (low, middle, high)]
            is_first = off(*states[:2], middle - low) > off(*states[1:], high - middle)
            low, high = np.where(is_first, low, middle), np.where(is_first, middle, high)
        # Of a body that hardly turns, rounding is not to count.
        least = {"omega": 1e-3 / (times[-1] - times[0]), "alpha": 1e-3 / (times[-1] - times[0]) ** 2}.get(unit, 1e-300)
        size = max(largest(getattr(known, unit)), least) * (high - low if is_step else 1.0)
        made = residuals(state(low), state(high), high - low)[name]
        shares[name] = float((np.linalg.norm(made, axis=1) / size).max())
    return shares


def verified(robot, limits, state, duration, start, end, samples=any_motion.SAMPLES, began=0.0):
    """Verification of a motion from a pose at zero velocity to another one."""

    class Motion:
        times = began, began + duration

        @staticmethod
        def state(times):
            return state(times)

    times = np.linspace(*Motion.times, samples)
    found, weight = state(times), robot["mass"] * robot["gravity"]
    slacks = least_time_bounds.slacks(robot, limits, Motion, times)
    # Slacks of cables with limits of their own are over the smallest one.
    slacks = {n: float(s.min() / (weight if n == "tension" else np.min(np.abs(limits[n])))) for n, s in slacks.items()}
    depth, base = np.inf, np.asarray(robot["base_points"], float)
    if free_motions.stays_below(robot):
        normal, level = free_motions.plane(robot)
        depth = (found.position @ normal - level).min() / np.ptp(base, axis=0).max()
    away = max(np.linalg.norm(np.asarray(pose.position) - base.mean(0)) for pose in (start, end))
    poses = np.array([start.position, end.position], float)
    turns = sampled_motion.rotations(np.array([start.quaternion, end.quaternion], float))
    both = [0, -1]
    ends = {
        "position": largest(found.position[both] - poses) / away,
        "velocity": largest(found.velocity[both]) / max(largest(found.velocity), 1e-300),
        "rotation": largest(rotated(turns, found.rotation[both])),
        "omega": largest(found.omega[both]) / max(largest(found.omega), 1e-300),
    }
    return Verification(slacks, float(depth), ends, smoothness(state, times))

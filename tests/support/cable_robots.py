"""Random but sane robots of every pattern of motion and any number of cables, and symmetric ones that degenerate.

z up, SI units.  A generator gives the same robot for the same state; nothing of the package is used.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
DEGREES = {"1T": 1, "2T": 2, "3T": 3, "1R2T": 3, "3R": 3, "2R3T": 5, "3R3T": 6}
HALF = np.array([3.0, 2.5, 2.0])  # m, half sides of the frame around the origin
POINT_MASSES = {"1T": [2], "2T": [0, 2], "3T": [0, 1, 2]}


@dataclass(frozen=True)
class CableRobot:
    """base, platform: (n, 3) m; low, high: (n,) N; arm: (3,) m, platform axes, from the origin to the mass centre.

    The origin of the platform is its mass centre (arm zero), or its joint (3R).  Positions are drawn from a box of
    half sides `space` (3,) m around `middle`, rotations up to `turn` (rad), about y if planar.
    """

    name: str
    pattern: str
    base: np.ndarray
    platform: np.ndarray
    mass: float
    low: np.ndarray
    high: np.ndarray
    space: np.ndarray
    turn: float = 0.0
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def cables(self):
        return len(self.base)

    def pose(self, rng):
        """A position (3,) and a rotation (3, 3)."""
        position = np.asarray(self.middle) + self.space * rng.uniform(-1.0, 1.0, 3)
        axis = np.array([0.0, 1.0, 0.0]) if self.pattern == "1R2T" else rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        return position, Rotation.from_rotvec(self.turn * rng.uniform(-1.0, 1.0) * axis).as_matrix()

    def with_bounds(self, low, high):
        """The same robot with other bounds: numbers or (n,)."""
        ones = np.ones(self.cables)
        return CableRobot(**{**vars(self), "low": low * ones, "high": high * ones})


def _bounds(rng, n, mass, bounds):
    # Bounds of three kinds: "equal", "mixed" (other bounds per cable, some without end), "unbounded".
    if bounds == "unbounded":
        return np.zeros(n), np.full(n, np.inf)
    force = mass * GRAVITY
    if bounds == "equal":
        return np.full(n, 0.02 * force), np.full(n, 1.5 * force)
    low, high = force * rng.uniform(0.0, 0.1, n), force * rng.uniform(0.5, 3.0, n)
    return low, np.where(rng.random(n) < 0.3, np.inf, high)


def _spools(rng, n, suspended):
    # On the frame: at the top, a little out of level, or top and bottom in turn.
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    ring = np.c_[np.cos(angles), np.sin(angles)]
    ring /= np.abs(ring).max(1, keepdims=True)
    height = np.full(n, 1.0) if suspended else np.where(np.arange(n) % 2, -1.0, 1.0)
    return np.c_[ring, height + rng.uniform(-0.05, 0.05, n)] * HALF


def point_mass(rng, pattern, n, suspended=True, bounds="equal"):
    """1T on the z axis, 2T in the plane y = 0, 3T; suspended 1T hangs from spools of various heights."""
    keep = POINT_MASSES[pattern]
    sides = np.ones(n) if suspended else np.where(np.arange(n) % 2, -1.0, 1.0)
    base = _spools(rng, n, suspended)
    if pattern == "1T":
        base[:, 2] = sides * HALF[2] * rng.uniform(0.8, 1.2, n)
    if pattern == "2T":
        angles = (np.pi if suspended else 2.0 * np.pi) * (np.arange(n) + rng.uniform(0.2, 0.8, n)) / n
        base[:, 0] = 1.2 * HALF[0] * np.cos(angles)
        base[:, 2] = HALF[2] * (rng.uniform(0.9, 1.1, n) if suspended else 1.2 * np.sin(angles))
    missing = np.setdiff1d(range(3), keep)
    base[:, missing] = 0.0
    space = 0.5 * HALF
    space[missing] = 0.0
    mass = rng.uniform(0.5, 5.0)
    low, high = _bounds(rng, n, mass, bounds)
    return CableRobot(f"{pattern} {n}", pattern, base, np.zeros((n, 3)), mass, low, high, space)


def planar(rng, n, suspended=False, bounds="equal"):
    """1R2T in the plane y = 0: spools around a frame, attachment points around a platform."""
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(0.2, 0.8, n)) / n
    base = np.c_[1.2 * HALF[0] * np.cos(angles), np.zeros(n), 1.2 * HALF[2] * np.sin(angles)]
    if suspended:
        base[:, 2] = HALF[2] * rng.uniform(0.9, 1.1, n)
    corners = angles + rng.uniform(-1.5, 1.5, n)
    platform = np.c_[0.5 * np.cos(corners), np.zeros(n), 0.4 * np.sin(corners)]
    mass = rng.uniform(1.0, 20.0)
    low, high = _bounds(rng, n, mass, bounds)
    space = 0.5 * HALF * np.array([1.0, 0.0, 1.0])
    return CableRobot(f"1R2T {n}", "1R2T", base, platform, mass, low, high, space, 0.4)


def spatial(rng, n, suspended=True, bounds="equal"):
    """3R3T: spools around the top of the frame, or top and bottom in turn; attachment points all over a platform."""
    platform = rng.normal(size=(n, 3))
    platform *= 0.5 / np.linalg.norm(platform, axis=1, keepdims=True)
    mass = rng.uniform(1.0, 50.0)
    low, high = _bounds(rng, n, mass, bounds)
    return CableRobot(f"3R3T {n}", "3R3T", _spools(rng, n, suspended), platform, mass, low, high, 0.4 * HALF, 0.4)


def rod(rng, n, suspended=False, bounds="equal"):
    """2R3T: attachment points along a line through the mass centre."""
    along = rng.normal(size=3)
    along /= np.linalg.norm(along)
    places = rng.permutation(np.linspace(-1.0, 1.0, n) * 0.6)
    mass = rng.uniform(1.0, 20.0)
    low, high = _bounds(rng, n, mass, bounds)
    base = _spools(rng, n, suspended)
    return CableRobot(f"2R3T {n}", "2R3T", base, places[:, None] * along, mass, low, high, 0.4 * HALF, 0.6)


def spherical(rng, n, bounds="equal"):
    """3R: a platform on a joint below its mass centre, attachment points around the centre."""
    platform = rng.normal(size=(n, 3))
    platform *= 0.6 / np.linalg.norm(platform, axis=1, keepdims=True)
    mass = rng.uniform(1.0, 20.0)
    low, high = _bounds(rng, n, mass, bounds)
    arm = (0.05, -0.02, 0.4)
    base = _spools(rng, n, suspended=False)
    return CableRobot(f"3R {n}", "3R", base, platform + np.array(arm), mass, low, high, np.zeros(3), 0.6, arm)


def any_robot(rng, pattern, n, suspended=False, bounds="equal"):
    """A robot of a pattern."""
    if pattern == "3R":
        return spherical(rng, n, bounds)
    if pattern in POINT_MASSES:
        return point_mass(rng, pattern, n, suspended, bounds)
    return {"1R2T": planar, "2R3T": rod, "3R3T": spatial}[pattern](rng, n, suspended, bounds)


def _named(name, pattern, base, platform, space=(0.0, 0.0, 0.0), middle=(0.0, 0.0, 0.0), bounds=(1.0, 200.0)):
    base = np.array(base, float)
    platform = np.zeros_like(base) if platform is None else np.array(platform, float)
    low, high = (np.full(len(base), value) for value in bounds)
    return CableRobot(name, pattern, base, platform, 5.0, low, high, np.array(space), 0.0, middle=middle)


def degenerate():
    """Robots without turn at poses where something vanishes: `pose` stays on a plane or an axis of symmetry."""
    box = HALF * np.array([[x, y, z] for z in (1, -1) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
    half = np.array([0.3, 0.25, 0.2])
    inner = box / HALF * half
    top = box[:4]
    square = np.array([[2, 0, 2], [-2, 0, 2], [-2, 0, -2], [2, 0, -2]], float)
    tilted = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    angles = np.arange(3) * 2.0 * np.pi / 3.0
    out = np.repeat(np.c_[np.cos(angles), np.sin(angles), np.zeros(3)], 2, 0)
    beside = np.c_[-out[:, 1], out[:, 0], np.zeros(6)] * np.tile([0.1, -0.1], 3)[:, None]
    return [
        _named("cross: null vectors in pairs", "2T", [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]], None),
        _named("one cable twice", "3T", [*top[:3], top[0]], None, space=(0.4, 0.0, 0.0)),
        _named("point mass level with its spools", "3T", top, None, space=(1.0, 1.0, 0.0), middle=(0, 0, HALF[2])),
        _named("level with its spools, one cable below", "3T", [*top, [0, 0, -2]], None, (1, 1, 0), (0, 0, HALF[2])),
        _named(
            "in a tilted plane of spools, one cable below it",
            "3T",
            (np.r_[top, [[0, 0, -2]]] - [0, 0, 2]) @ tilted.T,
            None,
        ),
        _named("point mass in a plane of symmetry", "3T", box, None, space=(0.0, 1.0, 1.0)),
        _named("too few cables, in their plane", "3T", top[:2], None, space=(1.0, 0.0, 0.5), middle=(0, HALF[1], 0)),
        _named("planar square", "1R2T", square, 0.2 * square, space=(0.0, 0.0, 1.0)),
        _named("planar square crossed", "1R2T", square, 0.2 * square[[1, 0, 3, 2]], space=(1.0, 0.0, 0.0)),
        _named("planar, one attachment point", "1R2T", square, np.zeros((4, 3)), space=(1.0, 0.0, 1.0)),
        _named("box", "3R3T", box, inner, space=(1.0, 0.0, 1.0)),
        _named("box crossed", "3R3T", box, inner[[4, 5, 6, 7, 0, 1, 2, 3]], space=(1.0, 0.0, 0.0)),
        _named("box suspended", "3R3T", np.r_[top, top], inner[[1, 2, 3, 0, 7, 4, 5, 6]], space=(0.0, 1.0, 0.5)),
        _named("four cables at a point", "3R3T", box, np.repeat([[0, 0, 0.3], [0, 0, -0.3]], 4, 0)),
        _named("all at two points of a rod", "2R3T", box, np.repeat([[0, 0, 0.3], [0, 0, -0.3]], 4, 0)),
        _named("rod of four", "2R3T", box, np.outer(np.repeat([-0.4, -0.1, 0.1, 0.4], 2), [1, 0, 0]), (0.5, 0.0, 0.5)),
        _named("seven, a plane of symmetry", "3R3T", [*box[:6], [0, -2, -2]], [*inner[:6], [0, -0.2, -0.2]], (0, 1, 1)),
        _named("parallel pairs", "3R3T", 2.0 * out + beside + [0, 0, 2], 0.3 * out + beside, space=(0.0, 1.0, 0.5)),
        _named("joint in the middle of a box", "3R", box, inner),
        _named("unequal ranges", "1T", [[0, 0, 2], [0, 0, -2]], None).with_bounds(1.0, np.array([200.0, 20.0])),
    ]

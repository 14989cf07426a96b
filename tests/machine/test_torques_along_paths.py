"""Least times along lines under limits of torque, power and load, beside a search over phase planes in NumPy."""

import numpy as np
import pytest

import cspr_jax

SPOOLS = np.array([[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]])
WINCH = {"drum_radius": 0.02, "gear_ratio": 3.0, "friction": 0.005, "efficiency": 0.9, "motor_inertia": 1e-5}
WINCH |= {"viscous_friction": 5e-6}
START, END = np.array([-0.1, 0.0, 1.2]), np.array([0.1, 0.08, 1.0])
MASS, GRAVITY, NODES = 0.2, 9.81, 1500
# Below 0.0183 N m, 1.37 W and 94 rad/s, which the fastest motion without limits of motors needs.
TORQUE, POWER, LINE = 0.0155, 0.7, {"motor_stall_torque": 0.027, "motor_no_load_speed": 140.0}
CASES = {
    "torque": ({"motor_torque_max": TORQUE}, {}),
    "power": ({"motor_power_max": POWER}, {}),
    "load": ({}, LINE),
    "all": ({"motor_torque_max": TORQUE, "motor_power_max": POWER, "motor_speed_max": 60.0}, LINE),
}
# The others run with `make soak`.
FEW = ("torque", "all")


def _planned(limits, line, **more):
    robot = {"name": "three", "base_points": SPOOLS.tolist(), "mass": MASS, "gravity": GRAVITY, "winch": WINCH | line}
    path = {"points": [START.tolist(), END.tolist()], "ramp_time": 0.0}
    plan = {"schema": 1, "family": "path", "robot": robot, "path": path, "limits": limits} | more
    return cspr_jax.plan(plan).to_dict()["segments"][0]


class _Line:
    """Cables and motors at points of the line, by path acceleration u and squared path speed x."""

    def __init__(self, limits, line):
        self.length = np.linalg.norm(END - START)
        self.s = np.linspace(0.0, self.length, NODES)
        self.limits, self.line = limits, line
        along = (END - START) / self.length
        rays = SPOOLS - (START + self.s[:, None] * along)[:, None]
        lengths = np.linalg.norm(rays, axis=2)
        units = np.moveaxis(rays / lengths[..., None], 1, 2)
        self.of_u = np.linalg.solve(units, MASS * np.broadcast_to(along, (NODES, 3))[..., None])[..., 0]
        self.held = np.linalg.solve(units, np.broadcast_to([0.0, 0.0, -MASS * GRAVITY], (NODES, 3))[..., None])[..., 0]
        rate = -np.einsum("kij,i->kj", units, along)
        radius = WINCH["drum_radius"] / WINCH["gear_ratio"]
        self.radius, self.turn, self.change = radius, -rate / radius, -(1.0 - rate**2) / lengths / radius

    def interval(self, k, x):
        """Smallest and largest path acceleration at node k, over all cables and motors."""
        speed = self.turn[k] * np.sqrt(x)
        if (np.abs(speed) > self.limits.get("motor_speed_max", np.inf)).any():
            return np.inf, -np.inf
        if x == 0.0:  # at standstill friction may act either way
            both = [self._side(k, x, side * np.ones(3)) for side in (1.0, -1.0)]
            return max(low for low, _ in both), min(high for _, high in both)
        return self._side(k, x, np.where(speed > 0.0, 1.0, -1.0))

    def _side(self, k, x, side):
        speed = self.turn[k] * np.sqrt(x)
        arm = self.radius * WINCH["efficiency"] ** -side
        # Tensions of lines in u stay above zero, and torques of lines in u within what all limits allow.
        of_u = arm * self.of_u[k] + WINCH["motor_inertia"] * self.turn[k]
        rest = arm * self.held[k] + WINCH["motor_inertia"] * self.change[k] * x
        rest = rest + side * WINCH["friction"] + WINCH["viscous_friction"] * speed
        allowed = np.full(3, self.limits.get("motor_torque_max", np.inf))
        if "motor_power_max" in self.limits:
            allowed = np.minimum(allowed, self.limits["motor_power_max"] / np.maximum(np.abs(speed), 1e-9))
        if self.line:
            left = 1.0 - np.abs(speed) / self.line["motor_no_load_speed"]
            allowed = np.minimum(allowed, self.line["motor_stall_torque"] * left)
        slopes = np.concatenate([-self.of_u[k], of_u, -of_u])
        sides = np.concatenate([self.held[k], allowed - rest, allowed + rest])
        if (sides[slopes == 0.0] < 0.0).any():
            return np.inf, -np.inf
        up, down = slopes > 0.0, slopes < 0.0
        return (sides[down] / slopes[down]).max(initial=-np.inf), (sides[up] / slopes[up]).min(initial=np.inf)

    def least_time(self):
        """Duration on the grid: the largest speeds from which the end can be reached, then as fast as these allow."""
        step = self.s[1]
        largest = np.zeros(NODES)
        for k in range(NODES - 2, -1, -1):
            low, high = 1e-12, 20.0
            for _ in range(50):
                x = 0.5 * (low + high)
                lower, upper = self.interval(k, x)
                is_possible = lower <= upper and x + 2.0 * step * lower <= largest[k + 1]
                low, high = (x, high) if is_possible else (low, x)
            largest[k] = low
        x = np.zeros(NODES)
        for k in range(NODES - 1):
            x[k + 1] = min(x[k] + 2.0 * step * self.interval(k, x[k])[1], largest[k + 1])
        return float((2.0 * step / (np.sqrt(x[1:]) + np.sqrt(x[:-1]))).sum())


@pytest.mark.quick("torque")
@pytest.mark.parametrize(
    "name", [name if name in FEW else pytest.param(name, marks=pytest.mark.soak) for name in CASES]
)
def test_least_times_beside_a_phase_plane(name):
    limits, line = CASES[name]
    segment = _planned(limits, line)
    assert segment["verdict"] == "feasible"
    assert segment["duration"] == pytest.approx(_Line(limits, line).least_time(), rel=4e-4)
    assert segment["lower_bound"] < segment["duration"]
    # Some limit of motors binds.
    largest = limits | ({"motor_load_max": 1.0} if line else {})
    used = [segment[name] / limit for name, limit in largest.items()]
    assert 0.999 < max(used) <= 1.0 + 1e-9
    assert any("motor" in row["criterion"] for row in segment["binding"])


def test_no_motion_names_the_motor():
    """A torque that cannot hold the mass prevents every motion."""
    held = np.abs(_Line({}, {}).held[0]).max() * WINCH["drum_radius"] / WINCH["gear_ratio"]
    segment = _planned({"motor_torque_max": 0.9 * held}, {})
    assert segment["verdict"] != "feasible"
    assert {cause["criterion"] for cause in segment["cause"]} & {"motor_over_torque"}


@pytest.mark.thorough
def test_ramps_and_redundant_cables_keep_torques():
    three = [
        _planned({}, {}),
        _planned({"motor_torque_max": TORQUE}, {}, path={"points": [START.tolist(), END.tolist()], "ramp_time": 0.05}),
    ]
    robot = {"name": "four", "base_points": [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]], "mass": 2.0}
    robot |= {"winch": WINCH | {"friction": 0.02, "motor_inertia": 1e-4}}
    how = {"robot": robot, "path": {"points": [[-0.4, 0, 1.6], [0.2, -0.3, 1.4], [0.5, 0.3, 1.2]]}}
    four = [_planned(limits, {}, **how) for limits in ({}, {"motor_torque_max": 0.41, "motor_power_max": 75.0})]
    for free, limited in (three, four):
        assert free["verdict"] == limited["verdict"] == "feasible"
        assert free["duration"] < limited["duration"]
    assert 0.41 * 0.999 < four[1]["motor_torque_max"] <= 0.41 and 0.99 * 75.0 < four[1]["motor_power_max"] <= 75.0

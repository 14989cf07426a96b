"""Kernels written by hand in C++ for the same work: they show how close XLA comes to them."""

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.bench import six_cables, three_cables
from cspr_jax.bench.timing import best
from cspr_jax.errors import ConfigError
from cspr_jax.families.platforms.from_rest_lanes import rest_table, swings
from cspr_jax.families.swings.proof import screen
from cspr_jax.numerics.linear.lanes import Vector

FLAGS = (
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-freciprocal-math",
    "-ffp-contract=fast",
    "-fopenmp",
)
ALIGNED = 64
AGREES = 0.99


class Kernels(NamedTuple):
    """Compiled C++ functions.

    Fields:
        six_cables: function of six_cables.cpp.
        three_cables: function of three_cables.cpp.
    """

    six_cables: Callable
    three_cables: Callable


def compiled(folder: Path) -> Kernels:
    """Compile the kernels of a folder."""
    return Kernels(_compiled(folder / "six_cables.cpp"), _compiled(folder / "three_cables.cpp"))


def rates(kernels: Kernels, six: six_cables.SixCableWork, three: three_cables.ThreeCableWork) -> dict[str, float]:
    """Checks a second of both kernels on all cores; their results must be the package's."""
    both = _six_cables(kernels.six_cables, six), _three_cables(kernels.three_cables, three)
    return dict(zip(("six_cable", "three_cable"), both, strict=True))


def _compiled(source: Path) -> Callable:
    compiler = os.environ.get("CXX") or shutil.which("c++") or "g++"
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / f"{source.stem}.so"
        try:
            command = [*shlex.split(compiler), *FLAGS, "-shared", "-fPIC", str(source), "-o", str(library)]
            done = subprocess.run(command, capture_output=True, text=True)
        except (OSError, ValueError) as error:
            raise ConfigError("--kernels", f"{compiler}: must be a C++ compiler ({error})") from error
        if done.returncode:
            reason = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
            raise ConfigError(source, f"{compiler} must accept it, but says: {reason}")
        try:
            return getattr(ctypes.CDLL(str(library)), source.stem)
        except (OSError, AttributeError) as error:
            raise ConfigError(
                source, f'must define {source.stem} as extern "C" and nothing outside: {error}'
            ) from error


def _lined(values) -> np.ndarray:
    # Copy values to float32, aligned to a cache line as vector instructions need it.
    array = np.ascontiguousarray(values, np.float32)
    buffer = np.zeros(array.size + ALIGNED // 4, np.float32)
    first = -buffer.ctypes.data % ALIGNED // 4
    lined = buffer[first : first + array.size].reshape(array.shape)
    lined[...] = array
    return lined


def _pointers(*arrays: np.ndarray) -> list[ctypes.c_void_p]:
    return [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]


def _three_cables(kernel: Callable, work: three_cables.ThreeCableWork) -> float:
    tau = (np.arange(screen.SAMPLES) + 0.5) / screen.SAMPLES
    calls, buffers = [], []
    for first, segments in ((0, work.segments[1]), (1, work.segments[0])):
        arcs = np.arange(1, three_cables.MAX_ARCS + 1)[first::2]
        s = jax.tree.map(np.asarray, segments)
        fields = [s.start_radius, s.end_radius - s.start_radius, s.precession, s.sense, *s.tilt.T]
        fields += [*s.coupling.reshape(-1, 6).T, *s.twist.T]
        table = screen.sample_table(work.problem.amplitude, arcs, tau, np.float32)
        inputs = [_lined(x) for x in (np.stack(fields), table, arcs, tau)]
        out = _lined(np.zeros((len(arcs), len(s.rate))))
        sizes = ctypes.c_size_t(len(s.rate)), ctypes.c_int(len(arcs)), ctypes.c_int(len(tau))
        calls.append(partial(kernel, *_pointers(*inputs), *sizes, *_pointers(out)))
        buffers.append((inputs, out))
        few = jax.tree.map(lambda x: x[: screen.BATCH], s)
        _compare("three_cables.cpp", out, calls[-1], screen.smallest_sampled(work.problem.amplitude, few, arcs, tau))
    return three_cables.checks(len(work.ends)) / best(lambda: [call() for call in calls])


def _six_cables(kernel: Callable, work: six_cables.SixCableWork) -> float:
    robot, tau = work.robot, np.linspace(0.0, 1.0, six_cables.SAMPLES)
    corners = sorted(set(robot.joints))
    points = np.asarray(robot.platform_points)[corners]
    joint = np.array([corners.index(k) for k in robot.joints], np.int32)
    constants = [_lined(np.asarray(robot.base_points)), _lined(points)]
    calls, buffers, count = [], [], 0
    for batch in six_cables.batches(work):
        swing = swings(batch.segments)
        inertia = np.asarray(robot.inertia / robot.mass) @ _stacked(swing.axis)
        fields = [
            _stacked(swing.end_offset),
            _stacked(swing.axis),
            inertia,
            np.stack([swing.angle, swing.end_beta_hat]),
        ]
        table = rest_table(six_cables.QUINTIC, jnp.asarray(float(batch.arcs)), jnp.asarray(tau), six_cables.FROM_REST)
        inputs = [_lined(np.concatenate(fields)), _lined(table)]
        out = _lined(np.zeros(six_cables.LANES))
        numbers = ctypes.c_float(six_cables.TARGET[2]), ctypes.c_float(float(robot.gravity))
        sizes = ctypes.c_size_t(six_cables.LANES), ctypes.c_int(len(tau))
        calls.append(partial(kernel, *_pointers(*inputs, *constants, joint), *numbers, *sizes, *_pointers(out)))
        buffers.append((inputs, out))
        count += batch.real
        expected = six_cables.tensions(robot, batch, single_precision=False) * float(batch.segments.rate[0]) / 6.0
        _compare("six_cables.cpp", out, calls[-1], expected)
    return count * six_cables.SAMPLES / best(lambda: [call() for call in calls])


def _stacked(vector: Vector) -> np.ndarray:
    return np.stack([np.asarray(x) for x in vector])


def _compare(name: str, out: np.ndarray, call: Callable, expected) -> None:
    # Refuse a kernel whose results differ from the package's. Near singularities float32 has no digits to compare.
    call()
    expected = np.asarray(expected, float)
    computed = out[..., : expected.shape[-1]]
    is_far = (computed < -1e20) | (expected < -1e20)
    agrees = np.where(is_far, (computed < 0.0) & (expected < 0.0), np.isclose(computed, expected, rtol=0.01, atol=0.01))
    if agrees.mean() < AGREES:
        raise ConfigError(name, f"must agree with the package, but differs in {1.0 - agrees.mean():.1%} of the cases")

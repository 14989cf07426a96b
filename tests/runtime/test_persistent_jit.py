"""Programs that persist from run to run: bit for bit what jax.jit gives, and made again whenever anything differs."""

import hashlib
import json
import os
import subprocess
import sys
import zlib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cspr_jax.motion import amplitudes
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.runtime import compile_cache
from cspr_jax.runtime import persistent_jit as programs
from cspr_jax.runtime.compile_cache import PROGRAMS
from cspr_jax.runtime.program_keys import Undescribed, described, described_tree, tree_of

QUINTIC = amplitudes.named("quintic")
TAU = np.linspace(0.0, 1.0, 7)


def of_package(function, **settings):
    """A function as if a module of the package had it, and the list of its traces."""
    traces = []

    def traced(*arguments, **keywords):
        traces.append(len(arguments))
        return function(*arguments, **keywords)

    traced.__signature__ = programs.inspect.signature(function)
    traced.__module__, traced.__qualname__ = "cspr_jax.somewhere", "function"
    return programs.persistent_jit(traced, **settings), traces


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(PROGRAMS, str(tmp_path))
    return tmp_path


RUN = """
import json, os
import numpy as np
from cspr_jax.runtime import xla
xla.prepare("cpu", quick=True)
if {off}: os.environ.pop(xla.compile_cache.PROGRAMS)
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.motion import amplitudes
traces, polynomial = [], amplitudes.polynomial
amplitudes.polynomial = lambda *arguments: traces.append(1) or polynomial(*arguments)
with double_precision():
    values = amplitudes.derivatives(amplitudes.named("effective", epsilon=0.1), np.linspace(0.0, 1.0, 50), order=3)
print(json.dumps([len(traces), [np.asarray(v).tobytes().hex() for v in values]]))
"""


@pytest.mark.thorough
def test_a_second_process_traces_nothing_and_gives_the_same_bits(tmp_path):
    def told(off):
        names = ("XLA_FLAGS", "JAX_COMPILATION_CACHE_DIR", PROGRAMS)
        here = {name: value for name, value in os.environ.items() if name not in names}
        here |= {"CSPR_CACHE_DIR": str(tmp_path), "XLA_FLAGS": "--xla_backend_optimization_level=1"}
        code = RUN.format(off=off)
        done = subprocess.run([sys.executable, "-c", code], env=here, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    plain, first, second = told(True), told(False), told(False)
    assert plain[0] and first[0] == plain[0] and second[0] == 0
    assert plain[1] == first[1] == second[1]
    (entry,) = tmp_path.glob("*/whole/derivatives-*")  # bears a checksum in its name, as compiled code does
    name, _, checksum = entry.name.rpartition("~")
    assert checksum == compile_cache.checksum_of(name, entry.read_bytes())
    assert not entry.stat().st_mode & 0o022 or entry.parent.stat().st_mode & 0o777 == 0o700


def test_what_decides_a_program_is_part_of_its_key(folder, monkeypatch):
    def function(x, *, power):
        return {"a": x**power, "b": (x + 1, None)}

    compiled, traces = of_package(function, static_argnames="power")
    cases = [(TAU, 2), (TAU, 3), (TAU[:3], 2), (TAU.astype(np.float32), 2), (TAU[:, None], 2), (TAU, np.float64(2.0))]
    for number, (x, power) in enumerate(cases, 1):
        got, wanted = compiled(x, power=power), jax.jit(function, static_argnames="power")(x, power=power)
        assert jax.tree.structure(got) == jax.tree.structure(wanted)
        pairs = zip(jax.tree.leaves(got), jax.tree.leaves(wanted), strict=True)
        assert all(np.array_equal(a, b) and a.dtype == b.dtype for a, b in pairs)
        assert len(list(folder.iterdir())) == len(traces) == number
    compiled(TAU, power=2)  # this process knows it
    again, traces = of_package(function, static_argnames="power")
    again(TAU, power=2)
    assert not traces
    for change in (
        lambda: monkeypatch.setattr(programs, "checksum_of_sources", lambda: "others"),
        lambda: monkeypatch.setattr(programs, "_versions", lambda: ("other", "versions")),
        lambda: jax.config.update("jax_numpy_rank_promotion", "warn"),
    ):
        change()
        again, traces = of_package(function, static_argnames="power")
        again(TAU, power=2)
        jax.config.update("jax_numpy_rank_promotion", "raise")
        assert traces


def test_sources_are_read_by_their_contents(tmp_path, monkeypatch):
    package = tmp_path / "package"
    (package / "runtime").mkdir(parents=True)
    monkeypatch.setattr(programs, "__file__", str(package / "runtime" / "persistent_jit.py"))
    seen = set()
    for name, text in (("a.py", "x = 1"), ("a.py", "x = 2"), ("b.py", "x = 2"), ("runtime/c.py", "")):
        (package / name).write_text(text)
        os.utime(package / name, (0, 0))
        seen.add(programs.checksum_of_sources.__wrapped__())
    assert len(seen) == 4


def test_a_program_that_is_not_whole_or_another_ones_is_made_again(folder):
    """With a right checksum of the file, too: what counts is what the file says inside."""

    def times(x, factor):
        return x * 3.0 if factor == 3 else x * 5.0

    def called(factor):
        compiled, traces = of_package(times, static_argnames="factor")
        np.testing.assert_array_equal(compiled(TAU, factor), TAU * factor)
        return bool(traces)

    assert called(3)
    (path,) = folder.iterdir()
    assert called(5) and not called(3)
    (others,) = {*folder.iterdir()} - {path}
    whole = path.read_bytes()
    data = zlib.decompress(whole)
    flipped = data[:-7] + bytes([data[-7] ^ 1]) + data[-6:]
    for fault in (b"", whole[:-5], zlib.compress(flipped), zlib.compress(b"no checksum"), others.read_bytes()):
        path.unlink()
        path.write_bytes(fault)
        assert called(3) and not called(3)


def _with(data, *, code=None, description=None):
    # A file as `_write` makes it, with right sums and the right key.
    head, _, program = zlib.decompress(data).partition(b"\n")[2].partition(b"\n")
    key, before = json.loads(head)
    content = json.dumps([key, before if description is None else description(before)]).encode() + b"\n"
    content += program if code is None else code(program)
    return zlib.compress(hashlib.sha256(content).hexdigest().encode() + b"\n" + content)


FAULTS = {
    "no code": {"code": lambda code: b"no code"},
    "half": {"code": lambda code: code[: len(code) // 2]},
    "empty": {"code": lambda code: b""},
    "more results": {"description": lambda parts: [*parts[:2], parts[2] * 2]},
    "other shapes": {"description": lambda parts: [*parts[:2], [[[3], "<f8"]]]},
    "no shapes": {"description": lambda parts: [*parts[:2], [[[-1], "x"]]]},
    "other tree": {"description": lambda parts: [["builtins:list", None, ["leaf", "leaf"]], *parts[1:]]},
    "no tree": {"description": lambda parts: [["os:nothing", None, []], *parts[1:]]},
    "nothing": {"description": lambda parts: []},
    "numbers": {"description": lambda parts: 3},
}


@pytest.mark.quick("half", "more results", "no shapes", "no tree")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_program_with_right_sums_that_cannot_be_used_is_made_again(folder, fault):
    """Once: what takes its place is used by the next run."""

    def called():
        compiled, traces = of_package(lambda x: x * 3.0)
        np.testing.assert_array_equal(compiled(TAU), TAU * 3.0)
        return bool(traces)

    assert called()
    (path,) = folder.iterdir()
    path.write_bytes(_with(path.read_bytes(), **FAULTS[fault]))
    assert called() and not called()


def test_a_program_that_grows_without_bound_is_made_again(folder, monkeypatch):
    compiled, traces = of_package(lambda x: x * 3.0)
    compiled(TAU)
    (path,) = folder.iterdir()
    path.write_bytes(_with(path.read_bytes(), code=lambda code: code + bytes(1 << 20)))
    monkeypatch.setattr(programs, "LARGEST_PROGRAM", 1 << 19)
    again, traces = of_package(lambda x: x * 3.0)
    np.testing.assert_array_equal(again(TAU), TAU * 3.0)
    assert traces


def test_damage_does_not_reach_what_others_link_to(folder):
    """The files of a run are links to those of all runs: a new one is put in place of the old one."""
    compiled, _ = of_package(lambda x: x * 3.0)
    compiled(TAU)
    (path,) = folder.iterdir()
    path.write_bytes(b"damaged")
    kept = folder / ".kept"
    os.link(path, kept)
    np.testing.assert_array_equal(of_package(lambda x: x * 3.0)[0](TAU), TAU * 3.0)
    assert kept.read_bytes() == b"damaged" != path.read_bytes()


def test_within_other_transformations_it_is_jax_jit(folder):
    def function(x, *, order):
        return jnp.sin(x) ** order

    compiled, _ = of_package(function, static_argnames="order")
    for transformed in (
        lambda f: jax.jit(lambda x: f(x, order=2)),
        lambda f: jax.vmap(lambda x: f(x, order=2)),
        lambda f: jax.vmap(jax.grad(lambda x: f(x, order=3))),
        lambda f: lambda x: jax.lax.map(lambda y: f(y, order=2), x),
    ):
        np.testing.assert_array_equal(transformed(compiled)(TAU), transformed(function)(TAU))
    assert not list(folder.iterdir())
    # What they hold besides their arguments is known, and a program may be called.
    held = jax.vmap(jax.grad(lambda x: x**2 * compiled(TAU, order=2).sum()))
    np.testing.assert_array_equal(held(TAU), jax.vmap(jax.grad(lambda x: x**2 * function(TAU, order=2).sum()))(TAU))


def _called_back(x):
    return jax.pure_callback(lambda y: y * 2.0, jax.ShapeDtypeStruct(x.shape, x.dtype), x)


@pytest.mark.parametrize(
    ("function", "settings"),
    [
        (_called_back, {}),  # an address of this process
        (lambda x: (x, 1.0), {}),  # a weak type
        (lambda x, scale: x * scale(2.0), {"static_argnames": "scale"}),
        (lambda x: jnp.linalg.cholesky(jnp.eye(2) + x[0]), {}),  # LAPACK
    ],
)
def test_what_a_program_cannot_say_is_not_kept(folder, function, settings):
    more = {"scale": lambda x: x + 1.0} if settings else {}
    compiled, _ = of_package(function, **settings)
    jax.tree.map(np.testing.assert_array_equal, compiled(TAU, **more), function(TAU, **more))
    assert not list(folder.iterdir())


def test_nothing_is_kept_where_nobody_asks_for_it(tmp_path, monkeypatch, folder):
    monkeypatch.delenv(PROGRAMS)
    compiled, _ = of_package(lambda x: x * 3.0)
    compiled(TAU)
    monkeypatch.setenv(PROGRAMS, str(folder))
    with jax.disable_jit():
        compiled(TAU)
    jax.config.update("jax_enable_compilation_cache", False)
    compiled(TAU)
    jax.config.update("jax_enable_compilation_cache", True)
    programs.persistent_jit(lambda x: x * 3.0)(TAU)  # of no module of the package
    assert not list(folder.iterdir())


def test_a_folder_that_is_gone_and_a_full_disk_change_nothing(folder, monkeypatch):
    monkeypatch.setenv(PROGRAMS, str(folder / "gone"))
    np.testing.assert_array_equal(of_package(lambda x: x * 3.0)[0](TAU), TAU * 3.0)
    monkeypatch.setenv(PROGRAMS, str(folder))

    def full(self, data):
        raise OSError(28, "no space left")

    monkeypatch.setattr(Path, "write_bytes", full)
    np.testing.assert_array_equal(of_package(lambda x: x * 3.0)[0](TAU), TAU * 3.0)
    assert not list(folder.iterdir())


def test_mistakes_of_arguments_are_told_as_jax_tells_them(folder):
    compiled, _ = of_package(lambda x, *, order: x**order, static_argnames="order")
    with pytest.raises(TypeError, match="missing"):
        compiled(order=2)
    with pytest.raises(ValueError, match="hashable"):
        compiled(TAU, order=[2])
    with pytest.raises(TypeError, match=r"incompatible shapes|broadcast"):
        of_package(lambda x, y: x + y)[0](TAU, TAU[:3])


def test_amplitudes_of_a_plan_persist(folder):
    amplitudes_of = amplitudes.derivatives(QUINTIC, TAU, order=4)
    os.environ.pop(PROGRAMS)
    jax.tree.map(np.testing.assert_array_equal, amplitudes_of, amplitudes.derivatives(QUINTIC, TAU, order=4))
    assert list(folder.iterdir())


def test_trees_and_static_values_are_described_completely():
    kind = PlatformMotionKind(variable=True, plain=False, from_rest=True)
    tree = jax.tree.structure({"a": QUINTIC, "b": (kind, [1.0, None])})
    assert tree_of(json.loads(json.dumps(described_tree(tree)))) == tree
    values = [0.0, -0.0, 0, False, "0", None, (0,), [0], {"a": 0}, np.float64(0), np.float32(0), np.zeros(1), kind]
    values += [amplitudes.named, np.dtype(float), PlatformMotionKind, kind._replace(plain=True)]
    assert len({json.dumps(described(value)) for value in values}) == len(values)
    for value in (lambda: 0, object(), json.dumps, {1}, (1, [lambda: 0])):
        with pytest.raises(Undescribed):
            described(value)


def test_settings_of_a_thread_are_part_of_the_key(folder):
    compiled, traces = of_package(lambda x: x * jnp.asarray(2.0))
    with double_precision():
        compiled(TAU)
    with jax.enable_x64(False):
        assert compiled(TAU).dtype == np.float32
    assert len(traces) == 2

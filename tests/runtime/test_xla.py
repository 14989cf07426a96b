"""What the command line sets before jax starts: flags, kept compiled code, device. In processes of their own."""

import errno
import json
import os
import platform
import shutil
import subprocess
import sys
import threading
import types
import warnings
import zlib
from contextlib import nullcontext
from pathlib import Path

import jax
import numpy as np
import pytest

from cspr_jax.cli import main
from cspr_jax.errors import ConfigError
from cspr_jax.numerics import batches, kept_nan
from cspr_jax.numerics.batches import in_batches
from cspr_jax.runtime import compile_cache, compile_options, packed, xla

ROOT = Path(__file__).parents[2]


def with_known_flags(folder):
    """A folder in which the record of flags lies that other tests have made: a process that tries them takes a second.

    Where none lies yet, what is started tries them itself.
    """
    for record in Path(os.environ["CSPR_CACHE_DIR"]).glob("*/flags.json"):
        place = Path(folder) / record.parent.name
        place.mkdir(parents=True, exist_ok=True)
        shutil.copy(record, place)
    return folder


def told(folder, code, **settings):
    """What a fresh process prints, with its cache in a folder."""
    names = ("XLA_FLAGS", "JAX_COMPILATION_CACHE_DIR", "JAX_PLATFORMS", "MALLOC_ARENA_MAX", "TF_CPP_MIN_LOG_LEVEL")
    here = {name: value for name, value in os.environ.items() if name not in names}
    here |= {"CSPR_CACHE_DIR": str(folder)} | settings
    done = subprocess.run([sys.executable, "-c", code], env=here, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


SEEN = """
import json, os
from cspr_jax.runtime import xla
xla.prepare({device})
print(json.dumps({{k: os.environ.get(k) for k in ("XLA_FLAGS", "JAX_COMPILATION_CACHE_DIR", "JAX_PLATFORMS",
    "TF_CPP_MIN_LOG_LEVEL")}}))
"""


def test_proofs_are_compiled_least_where_little_is_computed(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", " ".join(compile_options.QUICK))
    assert jax.jit(lambda x: x + 1.0, compiler_options=compile_options.proof_options())(1.0) == 2.0
    assert compile_options.proof_options() == {"xla_backend_optimization_level": 0}
    monkeypatch.setenv("XLA_FLAGS", xla.WIDE)
    assert compile_options.proof_options() is None


@pytest.mark.thorough
def test_settings_of_the_user_win(tmp_path):
    """Ours stand before theirs, so that XLA takes theirs; their folder and an empty CSPR_CACHE_DIR are left alone."""
    code = SEEN.format(device=None)
    plain = json.loads(told(with_known_flags(tmp_path), code))
    assert plain["XLA_FLAGS"] in (kept_nan.with_flag(""), kept_nan.with_flag(xla.WIDE))
    assert Path(plain["JAX_COMPILATION_CACHE_DIR"]).is_relative_to(tmp_path) and plain["JAX_PLATFORMS"] is None
    theirs = "--xla_cpu_prefer_vector_width=256"
    given = json.loads(told(tmp_path, code, XLA_FLAGS=theirs, JAX_COMPILATION_CACHE_DIR="/elsewhere"))
    assert given["XLA_FLAGS"].endswith(theirs) and given["JAX_COMPILATION_CACHE_DIR"] == "/elsewhere"
    assert plain["TF_CPP_MIN_LOG_LEVEL"] == "3"
    assert json.loads(told(tmp_path, code, TF_CPP_MIN_LOG_LEVEL="0"))["TF_CPP_MIN_LOG_LEVEL"] == "0"
    nothing = json.loads(told("", SEEN.format(device='"cpu"')))
    assert nothing.pop("TF_CPP_MIN_LOG_LEVEL") == "3"
    assert nothing == {"XLA_FLAGS": kept_nan.with_flag(""), "JAX_COMPILATION_CACHE_DIR": None, "JAX_PLATFORMS": "cpu"}


@pytest.mark.thorough
def test_plans_compile_in_less_time_and_flags_of_the_user_are_not_set_twice(tmp_path):
    """A flag that the user names is left to them, whatever its value."""
    code = SEEN.format(device="quick=True")
    plain = json.loads(told(with_known_flags(tmp_path), code))
    ours, device = plain["XLA_FLAGS"].split(), plain["JAX_PLATFORMS"]
    assert device == "cpu"  # a GPU would take longer, and may be asked for
    assert json.loads(told(tmp_path, code, JAX_PLATFORMS="cuda,cpu"))["JAX_PLATFORMS"] == "cuda,cpu"
    assert json.loads(told(tmp_path, SEEN.format(device='"gpu", quick=True')))["JAX_PLATFORMS"] is None
    assert json.loads(told(tmp_path, SEEN.format(device="prefers_cpu=True")))["JAX_PLATFORMS"] == "cpu"
    assert [flag for flag in ours if flag not in (xla.WIDE, kept_nan.FLAG)] == list(xla.QUICK)
    theirs = "--xla_backend_optimization_level=3"
    given = json.loads(told(tmp_path, code, XLA_FLAGS=theirs))["XLA_FLAGS"].split()
    assert given[-1] == theirs and sum("optimization_level" in flag for flag in given) == 1
    assert set(given) - {theirs, xla.WIDE, kept_nan.FLAG} == set(xla.QUICK[1:])


def test_a_flag_is_tried_once_and_refused_ones_are_left_out(tmp_path, monkeypatch):
    """XLA ends the process that names a flag it does not know; the record saves the second try."""
    tries = []
    whole = subprocess.run

    def counted(*arguments, **keys):
        tries.append(arguments)
        return whole(*arguments, **keys)

    monkeypatch.setattr(subprocess, "run", counted)
    assert not xla._is_accepted(tmp_path, "--xla_no_such_flag=1") and not xla._is_accepted(
        tmp_path, "--xla_no_such_flag=1"
    )
    assert len(tries) == 1
    (tmp_path / "flags.json").write_text("{ half a rec")
    assert not xla._is_accepted(tmp_path, "--xla_no_such_flag=1") and len(tries) == 2


@pytest.mark.thorough
def test_flags_that_another_xla_knows_do_not_take_ours_with_them(tmp_path, monkeypatch):
    """Versions of XLA drop flags; what the others are worth stays."""
    monkeypatch.setattr(xla, "QUICK", (xla.QUICK[0], "--xla_no_such_flag=1", xla.QUICK[2]))
    monkeypatch.setattr(xla, "_processor", lambda: ())
    assert xla._flags(tmp_path, "--xla_cpu_use_xnnpack=false ", quick=True).split() == [
        *(xla.QUICK[0], xla.QUICK[2]),
        "--xla_cpu_use_xnnpack=false",
    ]
    assert xla.accepted_flags(tmp_path, []) == []
    monkeypatch.setattr(xla, "_refusal", lambda folder, flags: None)
    assert xla.accepted_flags(tmp_path, xla.QUICK) == []  # nobody knows: each would be asked for as long again


def test_the_library_sets_nothing(tmp_path):
    """Where jax has been imported, somebody else has decided."""
    code = (
        'import os, jax, cspr_jax; from cspr_jax.runtime import xla; xla.prepare(); print(os.environ.get("XLA_FLAGS"))'
    )
    assert told(tmp_path, code).strip() == "None" and not list(tmp_path.iterdir())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "words", [pytest.param(["run", "sweeps/demo.toml", "-o", "{}"], marks=pytest.mark.soak), ["table", "1.1"]]
)
def test_commands_set_it_before_they_import_jax(tmp_path, words):
    """In the folder that other tests keep their compiled code in: a second run of it compiles nothing."""
    kept = os.environ["CSPR_CACHE_DIR"]
    words = [word.format(tmp_path / "out") for word in words]
    code = f"from cspr_jax import cli; assert cli.main({words}) == 0; import jax\n"
    seen = told(kept, code + "print(jax.config.jax_compilation_cache_dir)")
    assert Path(seen.splitlines()[-1]).is_relative_to(kept)


def keep(folder, name, data):
    """Write an entry as a run that ends keeps it."""
    data += compile_cache._ending(name)
    entry = folder / f"{name}~{compile_cache.checksum_of(name, data)}"
    entry.write_bytes(data)
    return entry


def content_of(entry):
    """What jax or the program of an entry has written, whatever the entry is called."""
    name, _, checksum = entry.name.rpartition("~")
    data = entry.read_bytes()
    assert checksum == compile_cache.checksum_of(name, data) and data.endswith(compile_cache._ending(name))
    return data.removesuffix(compile_cache._ending(name))


KEEP = """
import resource, sys
from cspr_jax.cli.command import warn
from cspr_jax.runtime import xla
{before}
xla.prepare(None, warn)
import jax, jax.numpy as jnp
found = [jax.jit(lambda x, k=k: jnp.sin(x @ x.T + k).sum())(jnp.ones((20, 20))) for k in range(3)]
print(float(found[-1]))
"""
EVERY = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}


def lines_told(folder, code, **settings):
    """What a fresh process prints, and the lines that people see."""
    code = "import sys, io; sys.stderr = io.StringIO()\n" + code + "\nprint(sys.stderr.getvalue(), end='')"
    first, *lines = told(folder, code, **EVERY, **settings).splitlines()
    return first, lines


@pytest.mark.thorough
def test_damaged_entries_are_removed_with_one_line(tmp_path):
    """Cut, flipped and without a checksum: one line, the same answer, and they are made again.

    A run hands its compiled code over when it ends and leaves nothing else; the next one compiles nothing.
    """
    code = KEEP.format(before="")
    first, lines = lines_told(with_known_flags(tmp_path), code)
    (whole,) = tmp_path.glob("*/whole")
    cut, flipped, old, *_ = sorted(whole.iterdir(), key=lambda entry: -entry.stat().st_size)
    names, data = {entry.name.partition("~")[0] for entry in whole.iterdir()}, bytearray(flipped.read_bytes())
    assert lines == [] and len(names) >= 3 and not list(tmp_path.glob("*/run-*"))
    data[len(data) // 2] ^= 4
    cut.write_bytes(cut.read_bytes()[:-10])
    flipped.write_bytes(data)
    old.rename(whole / old.name.partition("~")[0])
    told_line = f"cspr: {whole.parent}: 3 damaged entries of compiled code removed; it is compiled again"
    assert lines_told(tmp_path, code) == (first, [told_line])
    entries = {entry.name: entry.stat().st_mtime_ns for entry in whole.iterdir()}
    assert lines_told(tmp_path, code) == (first, []) and len(entries) == len(names)
    assert {entry.name: entry.stat().st_mtime_ns for entry in whole.iterdir()} == entries


@pytest.mark.soak
def test_a_disk_that_takes_no_entry_is_told_once(tmp_path):
    """Files may have a kilobyte: each write fails half-way, as on a full disk; no half is kept."""
    limit = "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    first, lines = lines_told(tmp_path, KEEP.format(before=limit))
    assert len(lines) == 1 and "compiled code cannot be kept" in lines[0] and "File too large" in lines[0]
    (whole,) = tmp_path.glob("*/whole")
    assert [entry for entry in whole.iterdir() if entry.stat().st_size == 1000] == []
    assert lines_told(tmp_path, KEEP.format(before="")) == (first, [])


LATE = "import jax; jax.jit(lambda x: x + 1.0)(1.0)"


@pytest.mark.parametrize(
    "first", [pytest.param("", marks=pytest.mark.thorough, id="before"), pytest.param(LATE, id="after")]
)
def test_python_users_keep_compiled_code(tmp_path, first):
    """Before and after jax was imported and has compiled."""
    code = """
{first}
import cspr_jax
own = cspr_jax.keep_compiled_code({place!r})
import jax, jax.numpy as jnp
jax.jit(lambda x: jnp.sin(x @ x.T).sum())(jnp.ones((20, 20)))
print(own is not None and jax.config.jax_compilation_cache_dir == str(own))
"""
    place = with_known_flags(tmp_path / "mine")
    assert told("", code.format(first=first, place=str(place)), **EVERY) == "True\n"
    (whole,) = place.glob("*/whole")
    assert list(whole.iterdir())


@pytest.mark.thorough
def test_another_cache_of_python_users_stays(tmp_path):
    theirs, ours = str(tmp_path / "theirs"), str(tmp_path / "ours")
    code = f"""
import jax
jax.config.update("jax_compilation_cache_dir", {theirs!r})
import cspr_jax
print(cspr_jax.keep_compiled_code({ours!r}), jax.config.jax_compilation_cache_dir)
"""
    assert told("", code) == f"None {theirs}\n"


@pytest.mark.soak
def test_xla_does_not_complain_of_slow_compiling(tmp_path):
    """Its alarm of folding constants is the one of slow compiling, after one second instead of two minutes."""
    code = """
import os
os.dup2(1, 2)
from cspr_jax.runtime import xla
xla.prepare({device!r})
import jax, jax.numpy as jnp
def slow(x):
    known = jnp.ones((150, 150)) * x.dtype.type(2)
    return x + jax.lax.reduce_window(known, 0.0, jax.lax.add, (12, 12), (1, 1), "SAME")
jax.jit(slow)(jnp.ones(()))
"""
    assert "Constant folding" in told(tmp_path, code.format(device="gpu"))
    assert told(tmp_path, code.format(device=None)) == ""


def test_what_killed_runs_left_is_swept(tmp_path, monkeypatch):
    gone = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    left = tmp_path / f"run-{compile_cache.socket.gethostname()}-{gone.stdout.strip()}"
    alive = tmp_path / f"run-{compile_cache.socket.gethostname()}-{os.getppid()}"
    for place in (left, alive):
        place.mkdir()
        (place / "entry").write_text("half")
    (tmp_path / "whole").mkdir()
    keep(tmp_path / "whole", "known", b"whole")
    monkeypatch.setattr(compile_cache, "_quiet", lambda *_: None)
    lines = []
    own = compile_cache.opened(tmp_path, lines.append)
    assert not left.exists() and alive.exists() and [entry.name for entry in own.iterdir()] == ["known"] and not lines
    (own / "new").write_bytes(zlib.compress(b"new"))
    (own / "half").write_bytes(zlib.compress(b"new")[:-3])
    compile_cache.hand_over()
    names = {entry.name.partition("~")[0] for entry in (tmp_path / "whole").iterdir()}
    assert names == {"known", "new"} and not own.exists()


@pytest.fixture
def entries(tmp_path, monkeypatch):
    """A folder of kept code with two whole entries, and what opens it."""
    folder = tmp_path / "kept"
    (folder / "whole").mkdir(parents=True, mode=0o700)
    folder.chmod(0o700)
    for name in ("one-cache", "two-cache"):
        keep(folder / "whole", name, zlib.compress(name.encode()))
    monkeypatch.setattr(compile_cache, "_quiet", lambda *_: None)
    monkeypatch.setattr(compile_cache, "_pending", [])
    lines: list[str] = []

    def opened():
        own = compile_cache.opened(folder, lines.append)
        return own, lines

    return types.SimpleNamespace(folder=folder, whole=folder / "whole", opened=opened)


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP, errno.EMLINK])
def test_entries_are_copied_where_there_are_no_links(entries, monkeypatch, code):
    """As on exFAT: nothing is compiled anew, and new entries are handed over all the same."""

    def refused(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "link", refused)
    own, lines = entries.opened()
    assert sorted(entry.name for entry in own.iterdir()) == ["one-cache", "two-cache"] and not lines
    assert (own / "one-cache").read_bytes() == next(entries.whole.glob("one-cache~*")).read_bytes()
    (own / "new-cache").write_bytes(zlib.compress(b"new"))
    compile_cache.hand_over()
    assert {entry.name.partition("~")[0] for entry in entries.whole.iterdir()} == {
        "one-cache",
        "two-cache",
        "new-cache",
    }


def test_what_jax_notes_beside_entries_is_no_entry(entries, monkeypatch):
    """With a largest size jax notes when each entry was used, in a file that it needs and writes again."""
    monkeypatch.setattr(compile_cache, "largest_size", lambda: 1_000_000)
    monkeypatch.setattr(compile_cache.importlib.util, "find_spec", lambda name: name)
    own, lines = entries.opened()
    assert not lines and len(list(entries.whole.iterdir())) == 2
    assert sorted(entry.name for entry in own.iterdir()) == ["one-atime", "one-cache", "two-atime", "two-cache"]
    used = int.from_bytes((own / "one-atime").read_bytes(), "little")
    assert used == next(entries.whole.glob("one-cache~*")).stat().st_mtime_ns
    (own / "one-atime").write_bytes(b"87654321")
    (own / ".lockfile").touch()
    compile_cache.hand_over()
    assert {entry.name.partition("~")[0] for entry in entries.whole.iterdir()} == {"one-cache", "two-cache"}
    entries.opened()
    assert not lines


def test_a_largest_size_is_that_of_all_that_is_kept(entries, monkeypatch):
    """The oldest entries go first; without filelock, which jax needs for it, one line says so."""
    old = next(entries.whole.glob("one-cache~*"))
    os.utime(old, (1.0, 1.0))
    monkeypatch.setattr(compile_cache, "largest_size", lambda: old.stat().st_size + 3)
    monkeypatch.setattr(compile_cache.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(OSError, match="jax needs filelock for JAX_COMPILATION_CACHE_MAX_SIZE"):
        entries.opened()
    monkeypatch.setattr(compile_cache.importlib.util, "find_spec", lambda name: name)
    entries.opened()
    compile_cache.hand_over()
    assert [entry.name.partition("~")[0] for entry in entries.whole.iterdir()] == ["two-cache"]


def test_pipes_and_links_in_the_folder_hold_up_nobody(entries, tmp_path):
    """Each is removed; a folder that lies there is left alone."""
    os.mkfifo(entries.whole / "pipe-cache~00000000")
    (entries.whole / "link-cache~00000000").symlink_to("/dev/zero")
    (entries.whole / "folder-cache~00000000").mkdir()
    with (entries.whole / "large-cache~00000000").open("wb") as file:
        file.truncate(compile_cache.LARGEST_ENTRY + 1)
    own, lines = entries.opened()
    assert len(lines) == 1 and "3 damaged entries of compiled code removed" in lines[0]
    assert sorted(entry.name for entry in own.iterdir()) == ["one-cache", "two-cache"]
    os.mkfifo(own / "pipe-cache")
    compile_cache.hand_over()
    names = {entry.name.partition("~")[0] for entry in entries.whole.iterdir()}
    assert {"one-cache", "two-cache"} <= names and "pipe-cache" not in names and not own.exists()


def test_an_entry_under_the_name_of_another_is_removed(entries):
    """With the checksum of its own name, or a new one: an entry says inside whose it is."""
    one, two = (next(entries.whole.glob(f"{name}-cache~*")) for name in ("one", "two"))
    data, content = one.read_bytes(), two.read_bytes()
    (entries.whole / f"three-cache~{one.name.partition('~')[2]}").write_bytes(data)
    (entries.whole / f"four-cache~{compile_cache.checksum_of('four-cache', data)}").write_bytes(data)
    two.write_bytes(data)
    own, lines = entries.opened()
    assert [entry.name for entry in own.iterdir()] == ["one-cache"]
    assert len(lines) == 1 and "3 damaged entries" in lines[0] and len(list(entries.whole.iterdir())) == 1
    (own / "two-cache").write_bytes(zlib.compress(b"two-cache"))
    compile_cache.hand_over()
    assert two.read_bytes() == content


def test_an_entry_that_cannot_be_used_gives_way(entries):
    """Of the entries of a function, all: jax does not say which one it could not read."""
    own, _ = entries.opened()
    assert compile_cache.set_aside("one-") == 1 == compile_cache.set_aside("two-ca")
    assert not list(own.iterdir()) and not compile_cache.set_aside("")
    (own / "one-cache").write_bytes(zlib.compress(b"anew"))
    compile_cache.hand_over()
    (entry,) = entries.whole.iterdir()
    assert entry.name.startswith("one-cache~") and content_of(entry) == zlib.compress(b"anew")


@pytest.mark.parametrize("is_program", [False, True])
def test_an_entry_that_is_replaced_is_handed_over(entries, is_program):
    own, _ = entries.opened()
    fresh = own / "fresh"
    fresh.write_bytes(zlib.compress(b"anew"))
    fresh.replace(own / ("two-cache" if is_program else "three-cache"))
    compile_cache.hand_over()
    kept = {entry.name for entry in entries.whole.iterdir()}
    names = ("one-cache", "two-cache") if is_program else ("one-cache", "three-cache", "two-cache")
    assert {name.partition("~")[0] for name in kept} == {*names} and len(kept) == len(names)


def test_entries_that_grow_without_bound_are_removed(entries, monkeypatch):
    """Packed zeros, and a frame of zstd that says what it holds; small entries are not inflated."""
    monkeypatch.setattr(packed, "LARGEST_CODE", 1 << 21)
    bomb, fits = zlib.compress(bytes(3 << 20), 9), zlib.compress(bytes(2 << 20), 9)
    frames = [b"\x28\xb5\x2f\xfd\xa0" + size.to_bytes(4, "little") for size in (1 << 20, 1 << 22)]
    for name, data in zip(("bomb", "fits", "frame", "large"), (bomb, fits, *frames), strict=True):
        keep(entries.whole, f"{name}-cache", data)
    own, lines = entries.opened()
    names = ["fits-cache", "frame-cache", "one-cache", "two-cache"]
    assert sorted(entry.name for entry in own.iterdir()) == names and "2 damaged entries" in lines[0]
    (own / "new-cache").write_bytes(bomb)
    compile_cache.hand_over()
    assert sorted(entry.name.partition("~")[0] for entry in entries.whole.iterdir()) == names
    with pytest.raises(ValueError, match="too large"):
        packed.inflated(bomb, 1 << 21)
    assert len(packed.inflated(fits, 1 << 21)) == 2 << 20


def test_what_jax_cannot_read_is_removed_unless_the_system_is_to_blame(entries, monkeypatch):
    shown, line = [], "Error reading persistent compilation cache entry for 'one': {}: because"
    monkeypatch.undo()  # of what the fixture leaves out
    monkeypatch.setattr(compile_cache, "_pending", [])
    monkeypatch.setattr(warnings, "showwarning", lambda *words: shown.append(words))
    lines: list[str] = []
    own = compile_cache.opened(entries.folder, lines.append)
    for kind in ("PermissionError", "MemoryError", "JaxRuntimeError", "error"):
        warnings.showwarning(line.format(kind), UserWarning, "jax", 1)
        assert (own / "one-cache").exists() is (kind in ("PermissionError", "MemoryError"))
    assert (own / "two-cache").exists() and len(lines) == 1 and not shown


@pytest.mark.thorough
def test_entries_that_are_not_code_are_made_again_once(tmp_path):
    """With right checksums: jax finds out. One line and the same answer; the next run has nothing to say."""
    code = KEEP.format(before="")
    first, _ = lines_told(with_known_flags(tmp_path), code)
    (whole,) = tmp_path.glob("*/whole")
    names = sorted(entry.name.partition("~")[0] for entry in whole.iterdir())
    for fault in (zlib.compress(b"\0\0\0\0no code"), b"no code"):
        for entry in list(whole.iterdir()):
            entry.unlink()
            keep(whole, entry.name.partition("~")[0], fault)
        answer, lines = lines_told(tmp_path, code)
        assert answer == first and len(lines) == 1 and "it is removed and compiled again" in lines[0]
        assert lines_told(tmp_path, code) == (first, [])
        assert sorted(entry.name.partition("~")[0] for entry in whole.iterdir()) == names


@pytest.mark.thorough
def test_code_of_another_function_that_claims_to_be_its_own_is_made_again(tmp_path):
    """Neither jax nor we can tell before it runs: the command begins anew, with one line and its usual answer."""
    words = [sys.executable, "-m", "cspr_jax", "plan", "sweeps/straight_line.toml", "--json"]

    def answer():
        here = os.environ | {"CSPR_CACHE_DIR": str(with_known_flags(tmp_path))}
        done = subprocess.run(words, env=here, cwd=ROOT, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    first, _ = answer()
    (whole,) = tmp_path.glob("*/whole")
    kept = sorted(entry for entry in whole.iterdir() if entry.name.partition("~")[0].endswith("-cache"))
    contents = [content_of(entry) for entry in kept]
    for entry, content in zip(kept, [*contents[1:], contents[0]], strict=True):
        entry.unlink()
        keep(whole, entry.name.partition("~")[0], content)
    line = "cspr: kept compiled code, which may be at fault, is removed: the command begins anew\n"
    assert len(kept) > 2 and answer() == (first, line)
    assert answer() == (first, "")


MANY = """
import os, sys, zlib
from pathlib import Path
from cspr_jax.runtime import compile_cache
lines = []
for turn in range({turns}):
    own = compile_cache.opened(Path({folder!r}), lines.append)
    for k in range(3):
        path = own / f"entry{{(os.getpid() + turn + k) % 40}}-cache"
        if not path.exists():
            path.write_bytes(zlib.compress(path.name.encode() * 1000))
    assert all(zlib.decompress(path.read_bytes()) == path.name.encode() * 1000 for path in own.iterdir())
    if turn % 3 == 0:
        compile_cache.set_aside(f"entry{{turn % 40}}-")
    compile_cache.hand_over()
print(lines)
"""


@pytest.mark.ci("4-10")
@pytest.mark.parametrize(("count", "turns"), [(4, 10), pytest.param(20, 100, marks=pytest.mark.thorough)])
def test_many_processes_share_one_folder(tmp_path, monkeypatch, count, turns):
    """While others take, hand over, trim and remove entries, each sees whole ones alone."""
    tmp_path.chmod(0o700)
    code = MANY.format(folder=str(tmp_path), turns=turns)
    words = [sys.executable, "-c", code]
    running = [subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True) for _ in range(count)]
    assert [process.communicate(timeout=300)[0] for process in running] == ["[]\n"] * count
    kept = list((tmp_path / "whole").iterdir())
    assert kept and all(zlib.decompress(content_of(entry))[:5] == b"entry" for entry in kept)
    assert not list(tmp_path.glob("run-*"))


@pytest.mark.soak
@pytest.mark.parametrize(
    "count", [pytest.param(3, marks=pytest.mark.thorough), pytest.param(20, marks=pytest.mark.soak)]
)
def test_many_commands_share_one_cold_folder(tmp_path, count):
    """All answer alike, without a word of kept code; what they leave is whole, and the next one has the same answer."""
    words = [sys.executable, "-m", "cspr_jax", "plan", "sweeps/straight_line.toml", "--json"]
    here = os.environ | {"CSPR_CACHE_DIR": str(with_known_flags(tmp_path))}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = [subprocess.Popen(words, env=here, cwd=ROOT, **pipes) for _ in range(count)]
    told_by_all = [process.communicate(timeout=1200) for process in running]
    done = subprocess.run(words, env=here, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert {(out, process.returncode) for (out, _), process in zip(told_by_all, running, strict=True)} == {
        (done.stdout, 0)
    }
    assert not [err for _, err in told_by_all if "compiled code" in err]  # others say at which stage they are
    (whole,) = tmp_path.glob("*/whole")
    assert len([content_of(entry) for entry in whole.iterdir()]) > 2 and not list(whole.parent.glob("run-*"))


@pytest.mark.parametrize("record", ["pipe", "deep", "large", "list"])
def test_a_record_of_flags_that_is_none(tmp_path, record, monkeypatch):
    """It is made again."""
    path = tmp_path / "flags.json"
    if record == "pipe":
        os.mkfifo(path)
    else:
        path.write_text({"deep": "[" * 50_000, "large": " " * 100_000 + "{}", "list": "[1]"}[record])
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: types.SimpleNamespace(returncode=0))
    assert xla._is_accepted(tmp_path, "--xla_flag=1") and json.loads(path.read_text()) == {"--xla_flag=1": True}


@pytest.mark.parametrize("which", ["CSPR_CACHE_DIR", "key", "whole"])
@pytest.mark.parametrize("fault", ["group", "all", "owner", "link"])
def test_a_folder_of_others_is_refused(tmp_path, monkeypatch, which, fault):
    """Entries are code that is executed: one line, and nothing is kept there or taken from there."""
    monkeypatch.setenv("CSPR_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setattr(compile_cache, "_pending", [])
    monkeypatch.setattr(compile_cache, "_quiet", lambda *_: None)
    lines: list[str] = []
    folder = xla._folder(None, lines.append)
    assert folder is not None and not lines
    (folder / "whole").mkdir(mode=0o700)
    bad = {"CSPR_CACHE_DIR": tmp_path / "kept", "key": folder, "whole": folder / "whole"}[which]
    if fault == "owner":
        status = os.stat(bad)
        monkeypatch.setattr(os, "geteuid", lambda: status.st_uid + 1)
    elif fault == "link":
        if which == "CSPR_CACHE_DIR":  # a link of the user's own choice
            return
        bad.rename(tmp_path / "elsewhere")
        bad.symlink_to(tmp_path / "elsewhere")
    else:
        bad.chmod(0o770 if fault == "group" else 0o757)
    found = xla._folder(None, lines.append)
    kept = None if found is None else xla._keep(found, lines.append)
    words = {"owner": "belongs to another user", "link": "is no folder"}.get(fault, "others may write into")
    assert kept is None and len(lines) == 1 and words in lines[0] and "compiled code cannot be kept" in lines[0]
    assert "JAX_COMPILATION_CACHE_DIR" not in os.environ


def test_a_folder_for_all_like_tmp_is_taken(tmp_path, monkeypatch):
    """There nobody can replace the folder inside it, which is ours alone whatever the umask."""
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(0o1777)
    monkeypatch.setenv("CSPR_CACHE_DIR", str(tmp_path / "tmp"))
    before = os.umask(0)
    try:
        lines: list[str] = []
        folder = xla._folder(None, lines.append)
    finally:
        os.umask(before)
    assert folder is not None and folder.stat().st_mode & 0o777 == 0o700 and not lines


def test_the_folder_is_that_of_the_jaxlib_that_runs(tmp_path, monkeypatch):
    """By its own version, not by what an installer has noted, which may be missing."""
    import jaxlib.version

    monkeypatch.setenv("CSPR_CACHE_DIR", str(tmp_path))
    here = xla._folder(None, print)
    monkeypatch.setattr(jaxlib.version, "__version__", "0.0.1")
    other = xla._folder(None, print)
    assert here != other

    def missing(name):
        raise xla.importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(xla.importlib.metadata, "version", missing)
    assert xla._folder(None, print) not in (here, other, None)


def test_a_device_that_is_not_there_is_refused(monkeypatch):
    for found, refused in (("cpu", True), ("gpu", False)):
        monkeypatch.setattr("jax.devices", lambda found=found: [types.SimpleNamespace(platform=found)])
        xla.check_device("cpu")
        xla.check_device(None)
        with pytest.raises(ConfigError, match="--device: gpu: must be cpu here") if refused else nullcontext():
            xla.check_device("gpu")


def test_workers_of_a_scheduler_choose_their_device(capsys):
    sweep = ROOT / "sweeps" / "demo.toml"
    assert main(["run", str(sweep), "--scheduler", "tcp://localhost:1", "--device", "cpu"]) == 2
    assert capsys.readouterr().err.startswith("cspr: --device: cpu: cannot be combined with --scheduler")


@pytest.mark.parametrize(("backend", "length"), [("cpu", 32), ("gpu", 512)])
def test_batches_are_larger_on_a_gpu(monkeypatch, backend, length):
    """The shapes of the calls, and that padding is trimmed."""
    shapes = []
    monkeypatch.setattr(batches, "LARGEST", 1 << 20)
    monkeypatch.setattr(jax, "default_backend", lambda: backend)

    def doubled(x):
        shapes.append(len(x))
        return 2.0 * x

    found = in_batches(doubled, np.arange(700.0), batch_size=32)
    np.testing.assert_array_equal(found, 2.0 * np.arange(700.0))
    assert set(shapes) == {length} and len(shapes) == -(-700 // length)


@pytest.mark.parametrize(("count", "lengths"), [(150, [64, 64, 16, 16]), (49, [64]), (48, [16] * 3), (3, [16])])
def test_short_batches_hold_what_is_left_over(monkeypatch, count, lengths):
    shapes = []
    monkeypatch.setattr(batches, "LARGEST", 1 << 20)

    def doubled(x):
        shapes.append(len(x))
        return 2.0 * x

    with batches.short_batches():
        found = in_batches(doubled, np.arange(float(count)), batch_size=64)
    np.testing.assert_array_equal(found, 2.0 * np.arange(count))
    assert shapes == lengths
    in_batches(doubled, np.arange(3.0), batch_size=64)
    assert shapes[-1] == 64


def test_threads_start_no_further_threads(monkeypatch):
    """And batches are short in them as they are outside."""
    monkeypatch.setattr(batches, "cores", lambda: 2)

    def name(_):
        return threading.current_thread().name, batches._has_short_batches.get()

    with batches.short_batches():
        seen = batches.in_threads(lambda _: (name(0), batches.in_threads(name, range(3))), range(4))
    assert all(inner == [outer] * 3 and outer[1] for outer, inner in seen)
    assert threading.current_thread().name not in {outer[0] for outer, _ in seen}
    assert {thread for thread, _ in batches.in_threads(name, range(2))} != {threading.current_thread().name}


@pytest.mark.parametrize("count", [1, 2, 7, 128])
def test_rows_on_a_gpu_give_what_they_give_on_a_cpu(monkeypatch, count):
    """Even and odd numbers of rows, and one."""
    lanes = np.linspace(0.1, 2.0, 50)

    def one(row):
        return {"sine": jax.numpy.sin(row[0] * lanes) + row[1]}

    rows = np.linspace(0.0, 3.0, count), np.arange(float(count))
    expected = np.sin(rows[0][:, None] * lanes) + rows[1][:, None]
    for backend in ("cpu", "gpu"):
        monkeypatch.setattr(jax, "default_backend", lambda backend=backend: backend)
        found = jax.jit(lambda some: batches.row_by_row(one, some))(rows)
        np.testing.assert_allclose(found["sine"], expected, rtol=1e-14)


@pytest.mark.thorough
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="arenas are glibc's")
def test_few_arenas_of_memory(tmp_path):
    """For this process (glibc tells by its statistics) and for those started from it; a user's setting stays."""
    code = """
import ctypes, os, threading
from cspr_jax.runtime import xla
xla.prepare()
hold = threading.Barrier(9)
def work():
    kept = [bytes(1000) for _ in range(1000)]
    hold.wait()
    hold.wait()
threads = [threading.Thread(target=work) for _ in range(8)]
[thread.start() for thread in threads]
hold.wait()
os.dup2(1, 2)
ctypes.CDLL(None).malloc_stats()
hold.wait()
print(os.environ.get("MALLOC_ARENA_MAX"))
"""
    found, theirs = told(with_known_flags(tmp_path), code), told(tmp_path, code, MALLOC_ARENA_MAX="7")
    tuned = told(tmp_path, code, GLIBC_TUNABLES="glibc.malloc.arena_max=7")
    assert tuned.count("Arena ") == 7
    assert found.count("Arena ") == 4 and found.endswith("4\n")
    assert theirs.count("Arena ") == 7 and theirs.endswith("7\n")

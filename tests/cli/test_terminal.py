"""Text on terminals of any encoding, foreign names, full and closed outputs, and what surrounds a process."""

import io
import math
import multiprocessing
import os
import subprocess
import sys
import threading
from pathlib import Path

import jax
import pytest
from rich.table import Table

from cspr_jax.errors import RefusedError, ResourceError, printable
from cspr_jax.numerics import cores, elementary
from cspr_jax.runtime import process_environment, terminal, xla

HOSTILE = [
    "Halle [nord] v2",
    "[/x]",
    "[link=a]b[/link]",
    "\x1b]0;pwn\x07red",
    "\x9b31m",
    "two\nlines",
    "a\u202eb",
    "\udc9b",
]


def cspr(words, **settings):
    """Exit code, bytes of standard output and of standard error of a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "cspr_jax", *words], capture_output=True, env=os.environ | settings, timeout=300
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("name", HOSTILE)
def test_foreign_text_is_one_plain_line(name):
    """No control character is left, nothing is markup, and what is safe stays as it is."""
    text = printable(name)
    assert text.isprintable() and printable(text) == text
    file = io.StringIO()
    table = Table(title=terminal.cell(name, style="table.title"))
    table.add_column(terminal.cell(name))
    table.add_row(terminal.cell(name))
    terminal.print_table(table, file)
    assert file.getvalue().count(text) == 3 and file.getvalue().replace("\n", "").isprintable()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "iso-8859-15", "utf-8"])
def test_tables_fit_the_encoding(encoding):
    """Signs become plainer, columns stay straight, and bytes of file names pass."""
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, errors="strict")
    terminal.encodable(file)
    table = Table()
    for head in ("p → ∞", "margin (m/s²)", "H\u00fclle \u4e2d"):
        table.add_column(terminal.cell(head))
    table.add_row(*map(terminal.cell, ("1 ± 2", "∞", "x")))
    terminal.print_table(table, file)
    file.write("caf\udce9\n")
    file.flush()
    lines = raw.getvalue().splitlines()
    assert lines[-1] == b"caf\xe9"
    texts = [line.decode(encoding) for line in lines[:-1]]
    if encoding != "utf-8":
        assert "p -> inf" in texts[1] and len({len(text) for text in texts}) == 1


@pytest.mark.quick("settings0-words0", "settings1-words1", "settings1-words4")
@pytest.mark.parametrize("words", [["robots"], ["quantities"], ["examples"], ["--help"], ["table", "--list"]])
@pytest.mark.parametrize(
    "settings", [{"PYTHONIOENCODING": "latin-1:strict"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}]
)
def test_commands_print_in_any_encoding(words, settings):
    code, out, err = cspr(words, **settings)
    assert (code, err) == (0, b"") and out


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux")
@pytest.mark.quick("words0", "words3", "words4")
@pytest.mark.parametrize("words", [["robots"], ["examples"], ["--help"], ["--version"], ["robots", "--json"]])
def test_a_full_output_is_one_line(words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "cspr_jax", *words], stdout=full, stderr=subprocess.PIPE, timeout=300
        )
    assert (done.returncode, done.stderr) == (4, b"cspr: standard output: No space left on device\n")


@pytest.mark.quick("words0", "words3")
@pytest.mark.parametrize("words", [["robots"], ["quantities"], ["--help"], ["robots", "--json"]])
def test_a_closed_pipe_is_silent(words):
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as pipe:
        done = subprocess.run(
            [sys.executable, "-m", "cspr_jax", *words], stdout=pipe, stderr=subprocess.PIPE, timeout=300
        )
    assert (done.returncode, done.stderr) == (0, b"")


def test_each_line_of_an_error_is_an_argument():
    error = RefusedError("a", "b")
    assert (str(error), error.args) == ("a\nb", ("a", "b"))


def test_quotas_of_control_groups(tmp_path):
    """The least of all levels counts, of both versions; paths of the machine are not found in a container."""
    groups = tmp_path / "groups"
    assert cores.quota(groups, tmp_path) == math.inf
    (tmp_path / "job" / "step").mkdir(parents=True)
    groups.write_text("0::/job/step\n")
    (tmp_path / "job" / "step" / "cpu.max").write_text("max 100000\n")
    assert cores.quota(groups, tmp_path) == math.inf
    (tmp_path / "job" / "cpu.max").write_text("150000 100000\n")
    assert cores.quota(groups, tmp_path) == 1.5
    first = tmp_path / "cpu,cpuacct"
    first.mkdir()
    groups.write_text("4:memory:/x\n3:cpu,cpuacct:/docker/abc\n")
    (first / "cpu.cfs_quota_us").write_text("-1\n")
    (first / "cpu.cfs_period_us").write_text("100000\n")
    assert cores.quota(groups, tmp_path) == math.inf
    (first / "cpu.cfs_quota_us").write_text("50000\n")
    assert cores.quota(groups, tmp_path) == 0.5


def test_a_quota_bounds_the_cores(monkeypatch):
    monkeypatch.delenv(cores.VARIABLE, raising=False)
    monkeypatch.setattr(cores, "quota", lambda: 0.5)
    assert cores.cores() == 1


def test_threads_that_cannot_be_started(monkeypatch):
    """A line before anything is computed, since libraries would end the process."""

    def start(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", start)
    with pytest.raises(ResourceError, match="no more threads can be started"):
        process_environment.check_threads()


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "memory"),
        (RuntimeError("can't start new thread"), "threads"),
        (BlockingIOError(11, "Resource temporarily unavailable"), "processes"),
        (ValueError("a mistake of ours"), None),
    ],
)
def test_what_the_machine_lacks(error, words):
    line = process_environment.shortage(error)
    assert line is None if words is None else words in line


def _forked(queue):
    try:
        with elementary.double_precision():
            queue.put("computed")
    except RuntimeError as error:
        queue.put(str(error))


@pytest.mark.filterwarnings("ignore")
def test_a_call_in_a_forked_child_fails_at_once():
    with elementary.double_precision():
        pass
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    child = context.Process(target=_forked, args=(queue,))
    child.start()
    child.join()
    assert "was forked from one that had used jax" in queue.get()


def test_flags_of_the_user_that_xla_refuses(tmp_path, monkeypatch):
    with pytest.raises(xla.ConfigError, match=r"XLA_FLAGS.*no_such_flag"):
        xla._check_flags(tmp_path, "--xla_no_such_flag=1")
    with pytest.raises(xla.ConfigError, match=r"XLA_FLAGS.*no_such_flag"):  # from the record
        monkeypatch.setattr(subprocess, "run", None)
        xla._check_flags(tmp_path, "--xla_no_such_flag=1")
    assert xla._flags(tmp_path, "flags.txt", quick=True) == "flags.txt"


def test_a_platform_that_is_not_there(monkeypatch):
    def devices():
        raise AssertionError

    monkeypatch.setattr(jax, "devices", devices)
    monkeypatch.setenv("JAX_PLATFORMS", "cuda")
    with pytest.raises(xla.ConfigError, match="JAX_PLATFORMS: cuda"):
        xla.check_device(None)


def test_settings_of_a_notebook_and_no_home(monkeypatch):
    def home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("HOME", "/nowhere")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("CSPR_CACHE_DIR", raising=False)
    monkeypatch.setattr(Path, "home", home)
    process_environment.configure()
    assert os.environ["MPLBACKEND"] == "Agg" and os.environ["HOME"] == os.devnull
    assert xla._folder(None, lambda line: None) is None


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3"), ({"OMP_NUM_THREADS": "4"}, None)],
)
def test_threads_of_linear_algebra_do_not_wait_busily(given, expected):
    """The setting is made before NumPy is loaded, and those of the user win."""
    code = (
        "import os, sys\nfrom cspr_jax.cli import main\nassert 'numpy' not in sys.modules\n"
        "sys.argv = ['cspr', '--version']\ntry: main()\n"
        "except SystemExit: print(os.environ.get('OPENBLAS_NUM_THREADS'))"
    )
    kept = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=kept | given, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1] == str(expected)


def test_fortran_is_loaded_where_it_is_used():
    """SciPy asks NumPy for all names that it has; who uses one of them gets it."""
    code = (
        "import sys; from cspr_jax.runtime import process_environment; process_environment.defer_fortran(); "
        "import scipy.interpolate, numpy; print('numpy.f2py.crackfortran' in sys.modules); "
        "print(callable(numpy.f2py.get_include), 'numpy.f2py.crackfortran' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines() == ["False", "True True"]


@pytest.mark.parametrize("place", ["folder", "variable"])
def test_settings_of_matplotlib_that_cannot_be_read(tmp_path, place):
    """One of the variable is not used; one in the working folder, where matplotlib looks first, is named."""
    settings = tmp_path / ("matplotlibrc" if place == "folder" else "theirs")
    settings.write_bytes("font.family: Größe\n".encode("latin-1"))
    environment = os.environ | ({"MATPLOTLIBRC": str(settings)} if place == "variable" else {})
    code = "import sys; from cspr_jax.cli import main; sys.argv = ['cspr', 'plot', 'no.h5']; sys.exit(main())"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert len(done.stderr.splitlines()) == 1
    if place == "folder":
        assert done.returncode == 2 and done.stderr.startswith("cspr: matplotlibrc: must be UTF-8 text")
    else:
        assert done.returncode == 4 and done.stderr.startswith("cspr: no.h5: ")


def test_matplotlib_may_be_asked_for_a_locale_that_is_not_there(tmp_path):
    """The locale of programs is C then, as everywhere else."""
    (tmp_path / "matplotlibrc").write_text("axes.formatter.use_locale: True\n")
    code = "import sys; from cspr_jax.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, "plot", "no.h5"],
        **{"cwd": tmp_path, "env": os.environ | {"LC_ALL": "xx_XX.UTF-8"}},
        **{"capture_output": True, "text": True, "timeout": 60},
    )
    assert (done.returncode, done.stderr.count("\n")) == (4, 1) and done.stderr.startswith("cspr: no.h5: ")


def test_a_wrong_sweep_is_refused_before_dask_is_imported(tmp_path):
    (tmp_path / "wrong.toml").write_text("schema = 1\nmap = 3\n")
    code = "import sys; from cspr_jax.cli import main; print(main(sys.argv[1:]), 'distributed' in sys.modules)"
    words = ["run", str(tmp_path / "wrong.toml"), "--scheduler", "tcp://127.0.0.1:1"]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=60)
    assert done.stdout == "2 False\n" and len(done.stderr.splitlines()) == 1


def test_commands_set_jax_up_before_they_import_it():
    """Later jax keeps no compiled code."""
    code = """
import sys
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError
from cspr_jax.runtime import xla
def prepare(*words, **options):
    raise ConfigError("jax", "imported" if "jax" in sys.modules else "not yet")
xla.prepare, sys.modules["mujoco"] = prepare, sys
for words in ("plan", "replay", "report", "check --robot prototype"):
    main([*words.split(), "no.toml"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stderr == 4 * "cspr: jax: not yet\n"

"""Maps of searches go on where the machine went off, and end with the bytes of one run; names may be anybody's."""

import html
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.commands import cspr

from cspr_jax.errors import printable
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.engine import Run
from cspr_jax.sweep.executors import ThisProcess
from cspr_jax.sweep.tile import TileMap
from reliability.support import Crash, FaultyDisk

LEAST_TIME = """schema = 1
map = "least-time"
robot = "boralugoda-rectangle"
[axes]
x = [5.0, 20.0, 60.0]
y = [5.0, 20.0]
z = [3.0]
[trajectory]
family = "s-curve"
max_acceleration = 10.0
from = { position = [1.0, 20.0, 7.0] }
[run]
tile = [1, 2, 1]
"""
SWING_RANGE = """schema = 1
map = "swing-range"
robot = "prototype"
[axes]
x = [-2.0, 0.5, 6.0]
y = [1.0]
z = [3.0]
[trajectory]
family = "ellipse"
from = { position = [0.0, 0.0, 2.0] }
[launch]
release_x = [-1.5, 1.5]
release_y = [-1.5, 1.5]
release_z = [1.2, 2.4]
[limits]
floor = 3.0
[run]
tile = [1, 1, 1]
"""
TEXTS = {"least-time": LEAST_TIME, "swing-range": SWING_RANGE}
# The other kind of map is searched in the soak.
MARKS = {"least-time": [], "swing-range": [pytest.mark.soak]}
MAPS = pytest.mark.parametrize("text", [pytest.param(TEXTS[name], marks=MARKS[name], id=name) for name in TEXTS])
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module", params=[pytest.param(name, marks=MARKS[name]) for name in TEXTS])
def job(request, tmp_path_factory):
    """Words of a command that lack a directory, and the bytes of its result."""
    folder = tmp_path_factory.mktemp("job")
    (folder / "map.toml").write_text(TEXTS[request.param])
    words = [sys.executable, "-m", "cspr_jax", "run", str(folder / "map.toml"), "-o"]
    subprocess.run([*words, str(folder / "whole")], check=True, cwd=ROOT, capture_output=True)
    return words, (folder / "whole" / "map.h5").read_bytes()


@pytest.mark.thorough
@MAPS
def test_a_map_of_searches_goes_on(tmp_path, text):
    """With the machine off while the first tile, the second and the result are written."""
    (tmp_path / "map.toml").write_text(text)
    sweep = read_sweep(tmp_path / "map.toml")
    executor = ThisProcess(TileMap(sweep))
    counting = FaultyDisk()
    whole = Run(sweep, tmp_path / "whole", disk=counting).go(executor).result.read_bytes()
    for part in (0.3, 0.5, 0.9):
        directory = tmp_path / str(part)
        with pytest.raises(Crash):
            Run(sweep, directory, disk=FaultyDisk(int(part * counting.count), "power")).go(executor)
        assert Run(sweep, directory).go(executor).result.read_bytes() == whole


@pytest.mark.thorough
def test_a_command_that_is_killed_goes_on(job, tmp_path):
    """After the first tile, and after the second."""
    words, result = job
    killed = [*words, str(tmp_path / "killed")]
    for tile in range(2):
        process = subprocess.Popen(killed, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        while process.poll() is None and not (tmp_path / "killed" / "shards" / f"{tile:05d}.h5").exists():
            time.sleep(0.01)
        process.kill()
        process.communicate()
        assert process.returncode in (-signal.SIGKILL, 0)
    subprocess.run(killed, check=True, cwd=ROOT, capture_output=True)
    assert (tmp_path / "killed" / "map.h5").read_bytes() == result


@pytest.mark.soak
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs unshare")
def test_a_disk_that_fills_between_tiles(job, tmp_path):
    """A disk of four megabytes, which another program fills: one line; with room again the run goes on."""
    words, result = job
    disk = tmp_path / "disk"
    disk.mkdir()
    run = " ".join([*words, str(disk / "run")])
    script = f"""mount -t tmpfs -o size=4m none {disk} || exit 77
        {run} 2> {tmp_path}/err &
        until [ -e {disk}/run/shards/00000.h5 ]; do sleep 0.01; done
        head -c 9000000 /dev/zero > {disk}/filler 2> {tmp_path}/filled
        wait $!; first=$?
        rm {disk}/filler; {run} || exit 78
        cp -r {disk}/run {tmp_path}/copy; exit $first"""
    done = subprocess.run(["unshare", "-m", "sh", "-c", script], cwd=ROOT, capture_output=True, text=True)
    if not (tmp_path / "copy").exists() and done.returncode in (1, 77):
        pytest.skip("no private mounts here: " + done.stderr.strip())
    (line,) = (tmp_path / "err").read_text().splitlines()
    assert done.returncode == 4 and "cannot be written: No space left on device" in line
    assert (tmp_path / "copy" / "map.h5").read_bytes() == result


# Names of a robot, and of the file of its map.
NAMES = [
    ("</script><script>throw 1</script>", "<b>&amp;'.toml"),
    ("<img src=x onerror=throw(1)>", "a\nb.toml"),
    ("../../etc/passwd", "$x_{.toml"),
    ("two\nlines\x1b[2J", "-o.toml"),
    ("$x^2$ \\frac{", "x\x1b[31m.toml"),
]


@pytest.mark.soak
@MAPS
def test_maps_of_hostile_names(tmp_path, text):
    """What is written lies in its folder; pages show the names; lines for people have no escapes."""
    known = re.search('robot = "(.*)"', text)[1]
    robot = (ROOT / "cspr_jax" / "catalogue" / f"{known}.toml").read_text()
    text = re.sub("^x = .*", "x = [0.5, 6.0]" if known == "prototype" else "x = [5.0]", text, flags=re.MULTILINE)
    for number, (name, file) in enumerate(NAMES):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "robot.toml").write_text(robot.replace(f'name = "{known}"', f"name = {json.dumps(name)}"))
        (folder / file).write_text(text.replace(known, "robot.toml"))
        assert cspr("run", folder / file, "-o", folder / "out")[0] == 0
        page = folder / "page.html"
        for words in (
            ("report", folder / "out", "-o", page, "--trajectories", "0"),
            ("plot", folder / "out", "-o", folder / "map.png", "--dpi", "30"),
            ("status", folder / "out"),
            ("verify", folder / "out"),
        ):
            code, out, err = cspr(*words)
            assert code == 0 and "\x1b" not in out + err
        assert {one.name for one in folder.iterdir()} == {"robot.toml", file, "out", "page.html", "map.png"}
        written = page.read_text("utf-8")
        content = re.search(r'<script type="application/json" id="content">(.*?)</script>', written, re.DOTALL)[1]
        shown = re.search("<title>(.*?)</title>", written, re.DOTALL)[1]
        assert "<" not in content + shown and json.loads(content)["title"] == html.unescape(shown)
        assert printable(name) in html.unescape(shown)
        assert written.count("<script") == 3

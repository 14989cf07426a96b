"""Make the pictures of the documents, each by the commands that the page of pictures shows, into docs/images.

python docs/make_images.py             all of them, as `make images` does
python docs/make_images.py poses       one of them
"""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
RESULTS = "results/images"
PICTURES = "docs/images/"
FILE_COMMANDS = ("size", "stops")


class Image(NamedTuple):
    """A picture.

    Fields:
        caption: what it shows.
        seconds: that its commands took, on 2 cores that had other work too.
        plot: arguments of `cspr plot` after the results.
        sources: sweeps or plans in `sweeps`, one result each; empty: the one of the picture's name.
        command: "run" for sweeps, "plan" for plans, "draw" for a script of its own, "design", or a command that draws
            a file.
        suffix: of the file.
    """

    caption: str
    seconds: int
    plot: str = ""
    sources: tuple[str, ...] = ()
    command: str = "run"
    suffix: str = ".png"


IMAGES = {
    "minimum_arcs": Image("Smallest number of arcs at six heights; P0 and the start are marked at their own.", 20),
    "spool_triangle": Image("Smallest number of arcs on triangles of spools of six sizes.", 30, "--best z0"),
    "cogiro_arrangements": Image(
        "Share of 1,000 poses that CoGiRo holds with 500 kg in each of the 40,320 arrangements of its cables.",
        60,
        command="draw",
    ),
    "design_motors": Image(
        "Largest power of a motor over the height of three winches, and the winches in their hall.",
        60,
        command="design",
    ),
    "design_triangle": Image(
        "Arcs and total time of Table 2.1's targets for 600 triangles and depths z0, and the best ones.",
        400,
        command="design",
    ),
    "design_orientations": Image(
        "Attained orientations over the distance of the two spools of each pair, and the best spools.",
        120,
        command="design",
    ),
    "design_rails": Image(
        "Positions of two spools on a rail for three shelves, with one change.", 20, command="design"
    ),
    "poses": Image(
        "Smallest number of arcs from rest to poses of a rigid platform, tilted by 46° in four directions.",
        40,
        "--at torsion=0 --at tilt=0.8",
    ),
    "orientation_envelope": Image("Orientations of one place: accessible, and attained from rest.", 15, "--envelope"),
    "orientations": Image("Smallest number of arcs from rest to the orientations of one place.", 15),
    "transitions": Image(
        "Oscillations for a horizontal transition, as a real number; integers on the white hexagons (thesis Fig. 1.6).",
        12,
        "--quantity least_oscillations",
        ("transition_level",),
    ),
    "figure_1_9": Image(
        "Lower envelopes of the lowest pseudotension of four amplitude functions (thesis Fig. 1.9).",
        20,
        "--quantity lower_envelope --size 16x10",
        ("figure_1_9_a1", "figure_1_9_a2", "figure_1_9_a3", "figure_1_9_effective"),
    ),
    "table_2_1": Image("The motion of Table 2.1: path and tensions.", 12, command="plan"),
    "trajectory": Image(
        "A platform on eight cables in space, where segments begin and end; its cables coloured by tension.",
        15,
        "--quantity trajectory",
        ("cogiro",),
        "plan",
    ),
    "tensions": Image(
        "Tensions of the eight cables over time: the band that they fill, and the limits.",
        15,
        "--quantity tensions",
        ("cogiro",),
        "plan",
    ),
    "summary": Image(
        "The launch on a page: path in space, tensions, speeds of the cables, and a table of its segments.",
        20,
        "--quantity summary",
        ("launch",),
        "plan",
    ),
    "straight_line": Image(
        "Boralugoda's test case: path, tensions kept as far from zero as possible, accelerations, tension couples.",
        10,
        command="plan",
    ),
    "path_acceleration": Image(
        "The same line: acceleration over the path, and the bounds that taut cables set (Boralugoda Fig. 4.1).",
        10,
        "--quantity path_acceleration",
        ("straight_line",),
        "plan",
    ),
    "acceleration_plane": Image(
        "Accelerations that three cables in a plane can give where the margin is smallest (Boralugoda Fig. 2.4).",
        10,
        "--quantity acceleration",
        ("planar_lines",),
        "plan",
    ),
    "acceleration_sections": Image(
        "Accelerations that four cables can give at one time of the line: sections of a cone (Boralugoda Fig. 2.8).",
        10,
        "--quantity acceleration --at t=0.5",
        ("straight_line",),
        "plan",
    ),
    "tolerances": Image(
        "Displacement of the spools, in mm, within which the motion to each target is proved feasible for every robot.",
        90,
        "--quantity tolerated",
    ),
    "least_time": Image("Least duration of the S-model from one place to each target.", 10),
    "least_time_ratio": Image(
        "Least duration by free motions over that by hypocycloids: 1 where a closed form is as fast as any motion.",
        260,
        "--ratio --quantity duration",
        ("least_time_free", "least_time_arcs"),
    ),
    "active_bounds": Image(
        "What holds back the acceleration on the way to each target: cables, or max_acceleration.",
        10,
        "--quantity active_up",
        ("least_time",),
    ),
    "orientation_workspace": Image("How far the MSSM can be tilted at places 1.7 m below its spools.", 10),
    "attainable": Image(
        "Part of the accessible orientations that a motion from rest attains, on a coarse grid of them.",
        130,
        "--quantity attainable_fraction",
    ),
    "feasible_acceleration": Image("Margin of rest, tensions from 1 to 300 N: positive where the mass can rest.", 10),
    "bezier_sequence": Image(
        "Bezier segments through places outside the footprint, the least total time.", 10, command="plan"
    ),
    "free_obstacle": Image("A free motion over a sphere: path and tensions.", 15, command="plan"),
    "launch": Image("The launch of the paper: path, flight, tensions, velocity, acceleration.", 20, command="plan"),
    "landing": Image(
        "Landings of 10,000 throws with errors of the release and of the cables (the paper's Fig. 15 has 30).",
        20,
        "--quantity landing",
        ("launch",),
        "plan",
    ),
    "launch_scatter": Image(
        "Distance from the target over the jitter of the release, beside the paper's 30 throws; nothing is fitted.",
        60,
        command="draw",
    ),
    "workspace": Image(
        "Wrench-feasible workspace of CoGiRo at four heights: distance of the tensions from their limits, N.",
        20,
        "--quantity wrench_margin",
    ),
    "workspace_solid": Image(
        "The wrench-feasible workspace of CoGiRo, and the robot at its centroid; lines at the heights of the ticks.",
        5,
        "--solid",
    ),
    "workspace_conditions": Image(
        "Workspaces of CoGiRo: for any tensions, for 100 to 5000 N, and for these with accelerations required as well.",
        15,
        sources=("workspace_static", "workspace", "workspace_accelerations"),
    ),
    "wrench_closure": Image(
        "Where the cables of IPAnema 2 resist every wrench if they are pulled hard enough.", 10, "--solid"
    ),
    "launch_sensitivity": Image(
        "Largest displacement of the launch robot over the largest error of a cable; infinite on z = 0.", 10
    ),
    "swing_range": Image(
        "Where the prototype can throw to from a swing about its place of rest, and the least speed of the release.", 20
    ),
    "launch_range": Image(
        "Where the launch robot can throw to, 1.675 m below its spools, and the least speed of the release.", 40
    ),
    "ellipse_frequencies": Image(
        "Frequencies at which the prototype can turn on level circles of any radius about P0, with taut cables.", 6
    ),
    "ellipse": Image(
        "Largest margin of turns on circles of radius 0.5 m about centres below the spools, level and inclined.", 8
    ),
    "swing": Image(
        "A load on three cables swings far outside of its posts, with taut cables: a plan, and its tensions.",
        60,
        command="draw",
        suffix=".gif",
    ),
    "motor_sizes": Image(
        "What a plan asks of three motors: torque over speed, and the motor's line.",
        15,
        sources=("docs/examples/camera_plan.toml",),
        command="size",
    ),
    "stops": Image(
        "Proved stops from instants of a plan, and how long they take.",
        60,
        "--instants 25",
        sources=("docs/examples/camera_plan.toml",),
        command="stops",
    ),
    "concepts": Image("From start to target in five arcs, and the pseudotensions.", 8, command="draw"),
}


def commands_of(name: str, folder: str = "") -> list[str]:
    """What makes a picture, to be called from the root of a checkout.

    Args:
        name: of the picture.
        folder: where `cspr plot` writes it, "" or ending in /; scripts write to docs/images.

    Returns:
        command lines.
    """
    image = IMAGES[name]
    sources = image.sources or (name,)
    if image.command == "draw":
        return [f"python docs/draw_{name}.py"]
    if image.command == "design":
        directory = f"-o {RESULTS}/{name} --picture {folder}{name}.png"
        return [f"cspr design sweeps/{name}.toml --dpi 90 {directory}"]
    if image.command in FILE_COMMANDS:
        return [" ".join(["cspr", image.command, *sources, *image.plot.split(), f"--dpi 90 -o {folder}{name}.png"])]
    if image.command == "plan":
        results = [f"{RESULTS}/{source}.h5" for source in sources]
        made = [f"cspr plan sweeps/{s}.toml -o {r}" for s, r in zip(sources, results, strict=True)]
    else:
        results = [f"{RESULTS}/{source}/{source}.h5" for source in sources]
        made = [f"cspr run sweeps/{source}.toml -o {RESULTS}/{source}" for source in sources]
    words = ["cspr plot", *results, *image.plot.split(), f"--dpi 90 -o {folder}{name}.png"]
    return [*made, " ".join(words)]


def page_text() -> str:
    """The page of pictures, which is built with the site."""
    parts = [
        "# Pictures\n\n`make images` remakes all pictures, `python docs/make_images.py NAME` one of them, in "
        "`docs/images`. The seconds\nwere measured on 2 cores that had other work too.\n"
    ]
    for name, image in IMAGES.items():
        lines = "\n".join(commands_of(name))
        parts.append(
            f"## {name}\n\n![{image.caption}](../images/{name}{image.suffix})\n\n{image.caption} {image.seconds} s:\n"
        )
        parts.append(f"```sh\n{lines}\n```\n")
    return "\n".join(parts)


def make(name: str) -> None:
    """Compute and draw a picture; earlier results of it are removed first.

    Args:
        name: of the picture.
    """
    for source in IMAGES[name].sources or (name,):
        shutil.rmtree(ROOT / RESULTS / source, ignore_errors=True)
    (ROOT / RESULTS).mkdir(parents=True, exist_ok=True)
    for line in commands_of(name, PICTURES):
        print(line, flush=True)  # noqa: T201
        program, *words = shlex.split(line)
        module = [] if program == "python" else ["-m", "cspr_jax"]
        subprocess.run([sys.executable, *module, *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    if set(sys.argv[1:]) <= set(IMAGES):
        for wanted in sys.argv[1:] or IMAGES:
            make(wanted)
    else:
        sys.exit(f"{' '.join(sys.argv[1:])}: must be some of {', '.join(IMAGES)}")

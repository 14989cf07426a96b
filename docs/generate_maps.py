"""A page for each kind of map, with its sweep file, picture, keys and quantities, from the rows."""

import textwrap
from pathlib import Path
from typing import NamedTuple

import make_images
from generate_reference import kind_text, quantities_text

from cspr_jax.schema.map_kinds import MAP_KINDS, quantity_of

HERE = Path(__file__).parent


class MapPage(NamedTuple):
    """What a page says that no row knows.

    Fields:
        image: a picture of `make_images.IMAGES`; its first source is the sweep that is shown.
        text: which question the map answers, and what to look at.
    """

    image: str
    text: str


PAGES = {
    "minimum-arcs": MapPage(
        "minimum_arcs",
        "With how many arcs does a point mass on three cables come to a stop at each target, from rest or from another "
        "target? Every number is proved feasible. "
        "`margin` says how far the cable of least tension is from going slack, `verdict` why a target is not reached.",
    ),
    "minimum-oscillations": MapPage(
        "transitions",
        "How many oscillations does a transition from rest need, until the effector oscillates at the target? The "
        "targets are at the depth of the start, at a given inclination of the line of the swing, or at the best "
        "inclination.",
    ),
    "transition-envelopes": MapPage(
        "figure_1_9",
        "How low do the pseudotensions fall in the course of a transition? Their lower envelope over normalised time "
        "compares amplitude functions: the higher it stays, the fewer oscillations are needed.",
    ),
    "poses": MapPage(
        "poses",
        "With how many arcs does a platform on six cables reach each pose of a grid of positions and tilts? A motion "
        "counts only if it is proved that its cables stay taut, its determinant stays away from zero, and no cable "
        "touches another cable or the platform.",
    ),
    "orientations": MapPage(
        "orientation_envelope",
        "Which orientations does a platform attain from rest at one place or several, and with how many arcs? "
        "`--envelope` draws them in the space of orientations.",
    ),
    "orientation-workspace": MapPage(
        "orientation_workspace",
        "How far can a platform be turned at each place at all, before a pose is singular or cables meet? No motion is "
        "required; [`attainability`](attainability.md) gives the part of these orientations that a motion from rest "
        "attains.",
    ),
    "attainability": MapPage(
        "attainable",
        "Which part of the orientations that are accessible at a place does a motion from rest attain? Tables 3.3 and "
        "3.4 of the thesis are such maps.",
    ),
    "feasible-acceleration": MapPage(
        "feasible_acceleration",
        "Which accelerations can redundant cables give a point mass at each place, with tensions within their limits? "
        "`acceleration_margin` is positive inside the wrench-feasible workspace, `static_margin` inside the static "
        "one; `level_acceleration` says how large a level acceleration may be, whatever its direction.",
    ),
    "least-time": MapPage(
        "least_time",
        "How fast can a point mass get to each target in a straight line, by the S-model with its best parameters, and "
        "by any motion along the line? `active_up` and `active_down` name what holds it back. With "
        '`family = "path"`: how fast does any robot get there, a platform too, by the fastest motion along a straight '
        "or a lifted path, and how much faster could any motion be, at most? With "
        '`family = "free"`: how fast does it get there along any path, by the fastest motion that a search finds?',
    ),
    "launch-range": MapPage(
        "launch_range",
        "Where can an object be thrown to, by one Bezier segment from rest, and with which least speed of release? "
        "A launch that is found is proved feasible; finding none proves nothing.",
    ),
    "swing-range": MapPage(
        "swing_range",
        "Where can an object be thrown to from an ellipse about a place of rest, `trajectory.from`, at its natural "
        "frequency, and with which least speed of release? No static workspace limits such throws; `swing_amplitude` "
        "says how far the effector swings.",
    ),
    "ellipse": MapPage(
        "ellipse_frequencies",
        "At which frequencies can a point mass turn on an ellipse, a circle or to and fro on a line about each centre, "
        "however large it is? Without limits the frequencies, the margin and the cable that gets slack first are "
        "formulas; with limits the verdict at each frequency is proved. Over one axis, such as the radius of circles, "
        "a picture shows the band of feasible frequencies, the natural frequency in it, and the static limit, beyond "
        "which the mass cannot go slowly.",
    ),
    "sensitivity": MapPage(
        "launch_sensitivity",
        "By how much do errors of the cable lengths displace and turn the effector, at worst? The robot is a point "
        "mass on three cables, or on two in a plane, or a platform on six.",
    ),
    "workspace": MapPage(
        "workspace",
        "Where can a robot on any number of cables hold its platform or point mass: still, against given wrenches, "
        "against every wrench, without interference among cables, platform and obstacles? Whole cells can be proved "
        "inside or outside.",
    ),
}


def page_text(name: str) -> str:
    """The page of a kind of map.

    Args:
        name: of the kind.

    Returns:
        Markdown.
    """
    kind, page = MAP_KINDS[name], PAGES[name]
    image = make_images.IMAGES[page.image]
    sweep = (image.sources or (page.image,))[0]
    commands = "\n".join(make_images.commands_of(page.image))
    own = {each: quantity_of(name, each) for form in kind.forms for each in form.quantities}
    asked = [kind_text(form) for form in kind.forms]
    return "\n".join(
        [
            f"# {name}\n",
            f"{kind.description[0].upper()}{kind.description[1:]}.\n",
            textwrap.fill(page.text, 118) + "\n",
            f"![{image.caption}](../../images/{page.image}.png)\n",
            f"*{image.caption}*\n\n```sh\n{commands}\n```\n",
            f"## Its sweep file\n\n`sweeps/{sweep}.toml`:\n",
            f"```toml\n{(HERE.parent / 'sweeps' / f'{sweep}.toml').read_text('utf-8').strip()}\n```\n",
            "## What it asks and gives\n\n" + "\n".join([asked[0].partition("\n\n")[2], *asked[1:]]),
            "Every key is explained in the [reference](../../reference.md#sweep-files).\n",
            f"## Its quantities\n\n{quantities_text(own)}",
        ]
    )


def index_text() -> str:
    """The page that leads to all kinds of map."""
    rows = "".join(f"| [{kind}]({kind}.md) | {page.text.partition('?')[0]}? |\n" for kind, page in PAGES.items())
    pages = "\n".join(PAGES)
    return (
        "# Kinds of map\n\nA sweep file names one of them, `map = ...`; `cspr run` computes it over a grid.\n\n"
        f"| map | question |\n|---|---|\n{rows}\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"
    )

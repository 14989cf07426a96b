"""Robots of WireX: XML named .wcrfx, metres, kilogrammes, z up; platforms and cables are numbered from 1.

A pulley swivels about the z axis of its base point, along which the cable enters. Inertia is about the mass centre.

The library of WireX writes mass, mass centre and inertia but never reads them: robots that nobody weighed have its
default values, which are treated as placeholders.
"""

import math
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cspr_jax.config.formats import cdpyr
from cspr_jax.config.formats.model import LARGEST_NUMBER, Body, Cable
from cspr_jax.config.formats.model import SAME as UPRIGHT
from cspr_jax.config.formats.xml_text import child, number, read_xml
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.robots.model.patterns import PATTERNS

VERSIONS = ("0.31", "0.32")
_MASS, _CENTRE = 25.0, [0.0, 1.0, 0.2]  # default values, kg and m
# Default tensors: version 0.31 writes one number instead of the tensor, 0.32 the tensor.
_TENSORS = (np.diag([14.0, 0.0, 0.0]), np.diag([2.0, 3.0, 4.0]))  # kg m^2


def read(path: Path) -> Body:
    """A robot."""
    root = read_xml(path)
    if root.tag != "models":
        raise ConfigError(path, f"<{root.tag}>: must be <models>, a file of WireX")
    robot = child(root, "robot", path)
    chains = child(robot, "geometry", path).findall("chain")
    used = {chain.get("platform_id", "1") for chain in chains}
    if not chains or len(used) != 1:
        raise ConfigError(path, f"geometry: {len(chains)} chains to {len(used)} platforms: must be one platform")
    platforms = robot.findall("platform")
    number_of = used.pop()
    platform = next((one for one in platforms if one.get("id") == number_of), platforms[0] if platforms else None)
    pattern = (None if platform is None else platform.get("motionpattern")) or robot.get("motionpattern") or ""
    if pattern not in cdpyr.PATTERNS.values():
        raise ConfigError(path, f"motionpattern = {shown(pattern)}: must be {either(cdpyr.PATTERNS.values())}")
    cables = [_cable(chain, k, path) for k, chain in enumerate(chains)]
    body = Body(path, robot.get("name") or path.stem, pattern, cables, f"WireX robot {path.name}")
    body.axes = cdpyr.AXES.get(pattern, UPRIGHT)
    if root.get("version") not in (None, *VERSIONS):
        body.warnings.append(f"version = {shown(root.get('version'))}: read as {either(VERSIONS)}")
    if platform is not None:
        _weigh(platform, body, path)
        _replace_defaults(body)
    _limit(root, body, path)
    sizes = [_of(cable, "radius", path, "cable") for cable in root.findall("cable")]
    body.cable_diameter = 2.0 * max(sizes, default=0.0) or None
    if len(set(sizes)) > 1:
        body.warnings.append(f"cables of several diameters: the largest, {body.cable_diameter:g} m, stands for all")
    return body


def _of(element: Element, key: str, file: Path, label: str, missing: float = 0.0) -> float:
    text = element.get(key)
    return missing if text is None else number(text, file, f"{label}.{key}")


def _cable(chain: Element, k: int, file: Path) -> Cable:
    label = f"chain {k + 1}"
    base, end = child(chain, "base", file, label), child(chain, "platform", file, label)
    points = [[_of(one, key, file, f"{label}.{one.tag}") for key in "xyz"] for one in (base, end)]
    axis = [_of(base, f"a{i}3", file, f"{label}.base", float(i == 3)) for i in (1, 2, 3)]
    return Cable(points[0], points[1], radius=_of(base, "radius", file, f"{label}.base"), axis=axis)


def _weigh(platform: Element, body: Body, file: Path) -> None:
    mass = platform.get("mass")
    body.mass = None if mass is None else number(mass, file, "platform.mass", infinite=True)
    body.mass = None if body.mass == float("inf") else body.mass
    centre, tensor = platform.find("centerofgravity"), platform.find("inertiatensor")
    if centre is not None:
        body.centre = [_of(centre, key, file, "centerofgravity") for key in "xyz"]
    if tensor is not None:
        parts = [
            [number(tensor.get(f"I{a}{b}", "0"), file, f"inertiatensor.I{a}{b}", infinite=True) for b in "xyz"]
            for a in "xyz"
        ]
        matrix = np.array(parts)
        body.inertia = matrix if (np.abs(matrix) <= LARGEST_NUMBER).all() and matrix.any() else None


def _replace_defaults(body: Body) -> None:
    is_body, defaults = PATTERNS[body.pattern].is_body, []
    is_tensor = body.inertia is not None and any(np.array_equal(body.inertia, tensor) for tensor in _TENSORS)
    is_centre = body.centre == _CENTRE
    # A robot may really weigh 25 kg, but hardly have such a tensor or mass centre too.
    if body.mass == _MASS and (is_centre or is_tensor):
        defaults.append(f"the mass of {_MASS:g} kg")
        body.notes.append(f"placeholder mass of {_MASS:g} kg")
    if is_centre and is_body:
        defaults.append(f"the mass centre {shown(_CENTRE)}")
        body.centre = np.mean([cable.platform for cable in body.cables], axis=0).round(9).tolist()
        body.notes.append("placeholder mass centre at the mean of the platform's points")
    if is_tensor and is_body:
        defaults.append("the inertia tensor")
        body.inertia = None
    if defaults:
        body.warnings.append(f"placeholders stand for what is a default of WireX: {', '.join(defaults)}")


def _limit(root: Element, body: Body, file: Path) -> None:
    # The limits allow every application of the file; a largest load of zero means that it is not known.
    applications = list(root.iter("application"))
    cables = [(one, "minimum_load", "cable") for one in root.findall("cable")]
    minimum = [
        _load(*one, file) for one in [*((one, "min_cable_load", "application") for one in applications), *cables]
    ]
    maximum = [_load(one, "max_cable_load", "application", file) or math.inf for one in applications]
    for cable in body.cables:
        cable.tension_min = max(minimum, default=0.0) or None
        cable.tension_max = min(maximum, default=math.inf)


def _load(element: Element, key: str, label: str, file: Path) -> float:
    text = element.get(key)
    load = 0.0 if text is None else number(text, file, f"{label}.{key}", infinite=True)
    if load < 0.0:
        raise ConfigError(file, f"{label}.{key} = {shown(text)}: must be a number >= 0")
    return load

"""Models of CASPR: NAME_bodies.xml and NAME_cables.xml, metres, newtons, z up.

Points are in the frame of their link. A link's mass centre lies at com_location from its joint; points of cables whose
attachment_reference is "com" are relative to it. Off-diagonal entries of an inertia tensor keep their sign.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cspr_jax.config.formats import model
from cspr_jax.config.formats.model import Body, Cable
from cspr_jax.config.formats.xml_text import child, number, read_xml, text_of, vector
from cspr_jax.config.reading import other_case
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.shapes import Float


@dataclasses.dataclass(frozen=True)
class _Joint:
    pattern: str
    axes: np.ndarray = dataclasses.field(default_factory=lambda: model.SAME)
    is_level: bool = False


_JOINTS = {
    "SPATIAL_EULER_XYZ": _Joint("3R3T"),
    "S_EULER_XYZ": _Joint("3R"),
    "S_FIXED_XYZ": _Joint("3R"),
    "T_XYZ": _Joint("3T"),
    "PLANAR_XZ": _Joint("1R2T"),
    "PLANAR_YZ": _Joint("1R2T", model.OF_YZ),
    "PLANAR_XY": _Joint("1R2T", model.OF_XY, is_level=True),
    "P_XZ": _Joint("2T"),
    "P_YZ": _Joint("2T", model.OF_YZ),
    "P_XY": _Joint("2T", model.OF_XY, is_level=True),
}
_ENDINGS = ("_bodies.xml", "_cables.xml")
_RIGID = "cable_ideal"
_CABLES = "cable_"  # prefix of the tags of all kinds of cables
_PULLEY = "base_rotating_pulley"


def read(path: Path, cable_set: str | None) -> Body:
    """A model."""
    bodies, cables = _both(path)
    joint, body = _body(bodies)
    centre, base_shift = body.centre, _joint_position(bodies, joint)
    chosen = _cable_set(cables, cable_set)
    tags = [element for element in chosen if isinstance(element.tag, str)]
    body.cables = [_cable(element, k, cables, centre, base_shift) for k, element in enumerate(tags)]
    body.file = cables
    elastic = sorted({element.tag for element in tags} - {_RIGID})
    if elastic:
        body.warnings.append(f"cables are taken as rigid: {', '.join(elastic)}")
    name = path.name[: -len(_ENDINGS[0])]
    body.name = name
    body.source = f'CASPR model {name}, cable set "{chosen.get("id", "")}"'
    return body


def _both(path: Path) -> tuple[Path, Path]:
    ending = next((ending for ending in _ENDINGS if path.name.endswith(ending)), None)
    if ending is None or path.name == ending:
        raise ConfigError(path, f"must be named NAME{_ENDINGS[0]} or NAME{_ENDINGS[1]}, as models of CASPR are")
    stem = path.name.removesuffix(ending)
    files = path.with_name(stem + _ENDINGS[0]), path.with_name(stem + _ENDINGS[1])
    for file in files:
        if not file.is_file():
            raise ConfigError(path, f"no such file beside it: {file.name}{other_case(file)}")
    return files


def _root(file: Path, tag: str) -> Element:
    root = read_xml(file)
    if root.tag != tag:
        raise ConfigError(file, f"<{root.tag}>: must be <{tag}>, a file of CASPR")
    return root


def _link(file: Path) -> Element:
    links = child(_root(file, "bodies_system"), "links", file)
    elements = [element for element in links if isinstance(element.tag, str)]
    if len(elements) != 1:
        raise ConfigError(file, f"links: {len(elements)} links: must be one, which the cables move")
    if elements[0].tag != "link_rigid":
        raise ConfigError(file, f"<{elements[0].tag}>: must be <link_rigid>")
    return elements[0]


def _joint_of(link: Element, file: Path) -> _Joint:
    kind = child(link, "joint", file).get("type", "")
    if kind not in _JOINTS:
        raise ConfigError(file, f"joint.type = {shown(kind)}: must be {either(_JOINTS)}")
    return _JOINTS[kind]


def _body(file: Path) -> tuple[_Joint, Body]:
    link = _link(file)
    joint, physical = _joint_of(link, file), child(link, "physical", file)
    mass = number(text_of(child(physical, "mass", file)), file, "physical.mass")
    if mass < 0.0:
        raise ConfigError(file, f"physical.mass = {mass:g}: must be a number >= 0")
    centre = vector(child(physical, "com_location", file), file, "physical")
    inertia = child(physical, "inertia", file)
    parts = {axes: number(text_of(child(inertia, f"I{axes}", file)), file, f"inertia.I{axes}") for axes in _PARTS}
    tensor = np.array([[parts["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    reference = inertia.get("ref", "")
    if reference not in ("com", "joint"):
        raise ConfigError(file, f'inertia.ref = {shown(reference)}: must be "com" or "joint"')
    if reference == "joint":
        tensor = model.about_centre(tensor, mass, centre)
    body_inertia = tensor if tensor.any() else None
    body = Body(file, "", joint.pattern, [], "", mass or None, centre, body_inertia, joint.axes, joint.is_level)
    return joint, body


_PARTS = ("xx", "yy", "zz", "xy", "xz", "yz")


def joint_position(file: Path) -> tuple[str, Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Kind, axes and position of the joint of a model."""
    link = _link(file)
    joint = _joint_of(link, file)
    location = vector(child(child(link, "parent", file), "location", file), file, "parent")
    return child(link, "joint", file).get("type", ""), joint.axes, np.array(location) - _joint_position(file, joint)


def _joint_position(file: Path, joint: _Joint) -> list[float]:
    # Base points are relative to a joint that does not move; planar robots move in the plane of the joint.
    parent = child(_link(file), "parent", file)
    if text_of(child(parent, "num", file)) != "0":
        raise ConfigError(file, "parent.num: must be 0, the base")
    position = np.array(vector(child(parent, "location", file), file, "parent"))
    if joint.pattern == "3R":
        return position.tolist()
    normal = joint.axes[1] if joint.pattern in ("1R2T", "2T") else np.zeros(3)
    return (normal * float(normal @ position)).tolist()


def _cable_set(file: Path, set_name: str | None) -> Element:
    root = _root(file, "cables")
    sets = {element.get("id", ""): element for element in root.findall("cable_set")}
    name = root.get("default_cable_set", "") if set_name is None else set_name
    if name not in sets:
        key = "default_cable_set" if set_name is None else "--set"
        allowed = either(sets) if sets else "absent: the file has no cable_set"
        raise ConfigError(file, f"{key} = {shown(name)}: {did_you_mean(name, list(sets))}must be {allowed}")
    return sets[name]


def _cable(element: Element, k: int, file: Path, centre: list[float], shift: list[float]) -> Cable:
    name = element.get("name", "")
    label = f"cable {k + 1}" + f' ("{name[:40]}")' * bool(name)
    if not str(element.tag).startswith(_CABLES):
        raise ConfigError(file, f"{label}: <{element.tag}>: must be a cable, such as <{_RIGID}>")
    reference = element.get("attachment_reference", "")
    if reference not in ("com", "joint"):
        raise ConfigError(file, f'{label}.attachment_reference = {shown(reference)}: must be "com" or "joint"')
    base, end = _ends(child(element, "attachments", file, label), file, label)
    point = np.array(vector(child(end, "location", file, label), file, label))
    cable = Cable([], (point + (centre if reference == "com" else 0.0)).tolist(), name)
    if base.tag == _PULLEY:
        start = vector(child(base, "fixed_location", file, label), file, label)
        cable.radius = number(text_of(child(base, "pulley_radius", file, label)), file, f"{label}.pulley_radius")
        cable.axis = vector(child(base, "cable_entry_vector", file, label), file, label)
    else:
        start = vector(child(base, "location", file, label), file, label)
    cable.base = (np.array(start) - shift).tolist()
    limits = child(element, "properties", file, label)
    for key, limit in (("tension_min", "force_min"), ("tension_max", "force_max")):
        bound = limits.find(limit)
        if bound is not None:
            setattr(cable, key, number(text_of(bound), file, f"{label}.{limit}", infinite=key == "tension_max"))
    return cable


def _ends(attachments: Element, file: Path, label: str) -> tuple[Element, Element]:
    # Return the attachment on the base, which may be a pulley, and the one on the body.
    ends = [element for element in attachments if isinstance(element.tag, str)]
    allowed = f"one attachment on link 0, or a <{_PULLEY}>, and one on link 1"
    links = []
    for element in ends:
        if element.tag not in ("attachment", _PULLEY):
            raise ConfigError(file, f"{label}: <{element.tag}>: must be {allowed}")
        links.append("0" if element.tag == _PULLEY else text_of(child(element, "link", file, label)))
    if sorted(links) != ["0", "1"]:
        raise ConfigError(file, f"{label}: attachments on links {', '.join(links) or 'none'}: must be {allowed}"[:300])
    return ends[links.index("0")], ends[links.index("1")]

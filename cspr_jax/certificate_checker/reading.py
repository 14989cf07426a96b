"""Strict reading of JSON by tables of keys, and the statement of a file: numbers as fmpq, SI units."""

import hashlib
import json
import re
from math import prod
from typing import Any

from flint import fmpq

MAX_CHARACTERS, MAX_COEFFICIENTS, MAX_POINTS = 4000, 100, 10000  # of a number, of a step, of one body times another
NUMBER = re.compile(r"(-?[0-9]+)(?:\.([0-9]+))?(?:[eE]([+-]?[0-9]{1,4}))?|(-?[0-9]+)/([0-9]+)")
Fields = dict[str, Any]
WINCHES = dict.fromkeys(["drum_radius", "gear_ratio", "stall_torque?", "no_load_speed?"], "positive n")
WINCHES |= dict.fromkeys(["motor_inertia", "friction", "viscous_friction"], "nonnegative n") | {"efficiency": "share n"}
ROBOT: Fields = dict.fromkeys(["base_points", "platform_points?"], "number n 3")
ROBOT |= {"mass": "positive", "gravity": "positive", "forces": "<3 *", "moments": "<3 *"}
ROBOT |= {"inertia?": "number 3 3", "line_axes?": "number 2 3", "joint_arm?": "number 3"}
ROBOT |= {"pulleys?": {"radius": "nonnegative n", "axes": "number n 3"}, "winches?": WINCHES}
FLAGS = {  # of the limits of cables
    "tension_min": "slack_cable",
    "tension_max": "over_tension",
    "cable_length_max": "cable_too_long",
    "cable_speed_max": "cable_too_fast",
    "cable_acceleration_max": "cable_over_acceleration",
    "motor_speed_max": "motor_too_fast",
    "motor_torque_max": "motor_over_torque",
    "motor_power_max": "motor_over_power",
    "motor_load_max": "motor_over_load",
}
MOTORS, OTHERS = list(FLAGS)[5:], ["speed_max?", "acceleration_max?", "touched?"]
LIMITS = {**{f"{name}?": "nonnegative n" for name in FLAGS}, **dict.fromkeys(OTHERS, "nonnegative"), "floor?": "number"}
BODIES = {"cable": "<n", "points": "number + 3", "spool": "<n", "body": "true", "cone": "number + 3"}
SIZES = {"*": 0, "+": 1, "2": 2, "3": 3, "4": 4}
OPERANDS = {**dict.fromkeys("+-*/", 2), **dict.fromkeys(["sin_pi", "cos_pi", "sin", "cos", "acos", "sqrt"], 1)}


class NotACertificate(ValueError):
    """The file has a mistake of form; the message names the key."""


def refuse(mistake: Any, message: str) -> None:
    """Raise NotACertificate if there is a mistake."""
    if mistake:
        raise NotACertificate(message)


def read(text: str) -> Fields:
    """Parse the text of a file and compare its checksum; raises NotACertificate."""
    try:
        content: Fields = json.loads(text, object_pairs_hook=_unique)
        refuse(not isinstance(content, dict), "no JSON object")
        refuse(content.get("sha256") != checksum(content), "sha256: truncated or altered")
    except json.JSONDecodeError as error:
        raise NotACertificate(f"the file: no JSON from line {error.lineno}, column {error.colno} on") from None
    except NotACertificate:
        raise
    except (ValueError, RecursionError):  # an integer of thousands of digits, half of a character, or too deep a nest
        raise NotACertificate("the file: no JSON that can be read") from None
    return content


def checksum(content: Fields) -> str:
    """Return the SHA-256 of the canonical form without the key sha256."""
    signed = {key: value for key, value in content.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(signed, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _unique(pairs: list[tuple[str, Any]]) -> Fields:
    fields: Fields = {}
    for key, value in pairs:
        refuse(key in fields, f"the file: the key {key[:40]!a} stands twice in an object")
        fields[key] = value
    return fields


def _number(value: Any, key: str) -> Any:
    """Read a string that holds a rational number as an fmpq."""
    match = NUMBER.fullmatch(value) if isinstance(value, str) and len(value) <= MAX_CHARACTERS else None
    if not match or (match[5] and not int(match[5])):
        raise NotACertificate(f"{key}: no string with a rational number")
    integer, decimals, exponent, numerator, denominator = match.groups("")
    if denominator:
        return fmpq(int(numerator), int(denominator))
    return fmpq(int(integer + decimals)) * fmpq(10) ** (int(exponent or 0) - len(decimals))


def parse(value: Any, table: Any, key: str, sizes: dict[str, int]) -> Any:
    """Read a value by a table; raises NotACertificate.

    A table is an object of keys, `?` marks optional ones, or a pair of a table and the length of a list, or a function,
    or a kind and the sizes of lists, such as `positive n 3`; `+` is 1 or more, `*` 0 or more, `<n` an index below n.
    """
    if isinstance(table, dict):
        refuse(not isinstance(value, dict), f"{key}: no JSON object")
        entries = {name.rstrip("?"): entry for name, entry in table.items()}
        for name in [*(name for name in table if name[-1] != "?"), *value]:
            wrong = name not in value or name not in entries
            refuse(wrong, f"{key}: key {str(name)[:40]!a} is missing, unknown or of no use here")
        return {name: parse(entry, entries[name], f"{key}.{name}", sizes) for name, entry in value.items()}
    if isinstance(table, str) and " " in table:
        kind, length, *rest = table.split()
        table = " ".join([kind, *rest]), length
    if isinstance(table, tuple):
        inner, length = table
        minimum = sizes[length]
        right = isinstance(value, list) and (len(value) >= minimum if length in "+*" else len(value) == minimum)
        refuse(not right, f"{key}: no list of {minimum} entries{' or more' if length in '+*' else ''}")
        return [parse(entry, inner, f"{key}[{k}]", sizes) for k, entry in enumerate(value)]
    if callable(table):
        return table(value, key, sizes)
    if table in ("number", "positive", "nonnegative", "share"):
        value = _number(value, key)
        right = {"positive": value > 0, "nonnegative": value >= 0, "share": 0 < value <= 1}.get(table, True)
    elif table[0] == "<":
        right = type(value) is int and 0 <= value < sizes[table[1:]]
    else:
        right = {"text": isinstance(value, str), "true": value is True, "any": True}[table]
    refuse(not right, f"{key}: not of the kind {table}")
    return value


def read_statement(content: Fields) -> Fields:
    """Return robot with corners, limits, pairs, duration, pieces, and sizes: n cables, d balanced components."""
    raw = content["robot"] if isinstance(content["robot"], dict) else {}
    count, body = raw.get("base_points"), "platform_points" in raw
    sizes = {**SIZES, "n": max(1, len(count)) if isinstance(count, list) else 1, "body": int(body)}
    robot = parse(content["robot"], ROBOT, "robot", sizes)
    limits = parse(content["limits"], LIMITS, "limits", sizes)
    sizes["d"] = len(robot["forces"] + robot["moments"] + robot.get("line_axes", []))
    lines, joint, rows = "line_axes" in robot, "joint_arm" in robot, robot.get("inertia", [])
    winches, motors = robot.get("winches", {}), [name for name in MOTORS if name in limits]
    pulleys = zip(*(robot.get("pulleys", {}).get(name, []) for name in ("radius", "axes")), strict=True)
    for mistake, message in [
        (any(axes != sorted(set(axes)) for axes in (robot["forces"], robot["moments"])), "axes do not ascend"),
        (bool(body) != bool(rows), "platform_points without inertia, or inertia without them"),
        ((lines or joint or robot["moments"]) and not body, "a point mass has no moments"),
        (lines and robot["moments"], "moments are not empty beside line_axes"),
        (joint and robot["forces"], "forces are not empty, though the joint bears them"),
        (not 0 < sizes["d"] <= sizes["n"], "fewer cables than balanced components, or no components"),
        (not all(map(any, robot.get("line_axes", []))), "an axis of line_axes is zero"),
        (any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)), "inertia is not symmetric"),
        (any(row[i] < 0 for i, row in enumerate(rows)), "inertia is negative"),
        (any(radius and not any(axis) for radius, axis in pulleys), "the axis of a pulley is zero"),
        (motors and not winches, "limits of motors, but no winches"),
        (sizes["n"] > sizes["d"] and motors not in ([], MOTORS[:1]), "limits of motors, but undetermined tensions"),
        (MOTORS[3] in motors and not {"stall_torque", "no_load_speed"} <= set(winches), "motor_load_max of no motor"),
    ]:
        refuse(mistake, f"robot: {message}")
    hull = {"body?": {"corners": "number + 3"}} if body else {}
    scene = parse(content.get("scene", {"pairs": []}), {"pairs": ((_body, "2"), "*"), **hull}, "scene", sizes)
    kinds = {entry["kind"] for pair in scene["pairs"] for entry in pair}
    refuse(("cone" in kinds and not body) or ("body" in kinds and "body" not in scene), "scene.pairs: no such body")
    robot["corners"] = scene.get("body", {}).get("corners", [])
    count, work = {"cable": 2, "spool": 1, "body": len(robot["corners"])}, 100 * (sizes["n"] + len(robot["corners"]))
    for k, (one, two) in enumerate(scene["pairs"]):
        one["flat"] = two["flat"] = robot["forces"] == [0, 2] and one["kind"] == two["kind"] == "cable"
        points = prod(count.get(body["kind"]) or len(body[body["kind"]]) for body in (one, two))
        refuse(points > MAX_POINTS, f"scene.pairs[{k}]: more than {MAX_POINTS} points of one body times the other")
        work += points
    motion = parse(content["motion"], {"duration": "positive", "pieces": (_piece, "+")}, "motion", sizes)
    check_order(motion["pieces"], "motion.pieces", motion["duration"])
    limits = {"tension_min": [fmpq(0)] * sizes["n"], **limits, "touched": limits.get("touched", fmpq(0))}
    for piece in motion["pieces"]:
        piece["work"] = work + sum(len(step[1]) if step[0] == "poly" else 1 for step in piece["program"])
    return {"robot": robot, "limits": limits, "pairs": scene["pairs"], **motion, "sizes": sizes, "work": 0}


def _body(value: Any, key: str, sizes: dict[str, int]) -> Fields:
    """Read a body of a scene; it turns if its directions are in platform axes."""
    kind = next((name for name in BODIES if isinstance(value, dict) and name in value), "cable")
    table = {kind: BODIES[kind]} | ({"corner": "number 3"} if kind == "cone" else {"radius": "nonnegative"})
    body = parse(value, table | ({"leave?": "nonnegative"} if kind == "cable" else {}), key, sizes)
    return {"radius": fmpq(0), **body, "kind": kind, "turns": kind in ("body", "cone") or "leave" in body}


def _piece(value: Any, key: str, sizes: dict[str, int]) -> Any:
    """Read a piece of a motion."""
    program = value.get("program") if isinstance(value, dict) else None
    table = {"start": "number", "end": "number", "position": "<steps 3", "speed_max?": "nonnegative"}
    table |= {"quaternion": "<steps 4"} if sizes["body"] else {}
    sizes = {**sizes, "steps": len(program) if isinstance(program, list) else 0}
    return parse(value, {**table, "program": _program}, key, sizes)


def _program(value: Any, key: str, sizes: dict[str, int]) -> list[list[Any]]:
    """Read steps, which can only use those before them."""
    steps: list[list[Any]] = []
    for k, step in enumerate(parse(value, "any +", key, sizes)):
        name, *operands = step if isinstance(step, list) and step else [None]
        poly = name == "poly" and len(operands) == 1
        refuse(not poly and (not isinstance(name, str) or len(operands) != OPERANDS.get(name)), f"{key}[{k}]: no step")
        table = "number +" if poly else "<steps"
        steps.append([name, *(parse(entry, table, f"{key}[{k}]", {**sizes, "steps": k}) for entry in operands)])
        refuse(poly and len(steps[-1][1]) > MAX_COEFFICIENTS, f"{key}[{k}]: more than {MAX_COEFFICIENTS} coefficients")
    return steps


def check_order(spans: list[Fields], key: str, duration: Any) -> None:
    """Refuse pieces or blocks that leave gaps, overlap or have no length."""
    ends = [fmpq(0)] + [span["end"] for span in spans]
    gaps = [span["start"] for span in spans] != ends[:-1] or ends[-1] != duration
    refuse(gaps or any(span["start"] >= span["end"] for span in spans), f"{key}: not one after the other, 0 to the end")

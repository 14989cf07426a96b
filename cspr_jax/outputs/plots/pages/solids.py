"""Content of a page about a workspace in space: its boundary, and the robot in it."""

import itertools
from typing import Any

import numpy as np

from cspr_jax.outputs.plots.maps.boundary import boundary, sides_of
from cspr_jax.outputs.plots.maps.solid import SPACE, is_solid, middle_of, volume_words
from cspr_jax.outputs.plots.pages.page import packed
from cspr_jax.outputs.plots.robots.obstacles import faces_of, obstacles
from cspr_jax.outputs.plots.robots.robot_at import posed
from cspr_jax.store.reading.result import Result

# Largest number of boundaries, one for each point of the other axes; with more points, a page shows the first alone.
LARGEST_COUNT = 16


def solids_content(result: Result, names: list[str], points: list[np.ndarray]) -> dict[str, Any] | None:
    """The boundaries of a workspace, for the points of all axes other than x, y and z."""
    if not is_solid(result):
        return None
    others = [k for k, name in enumerate(names) if name not in SPACE and len(points[k]) > 1]
    if np.prod([len(points[k]) for k in others]) > LARGEST_COUNT:
        others = []
    solids = []
    for chosen in itertools.product(*(points[k].tolist() for k in others)):
        index = {axis: 0 for axis in result.axes if axis not in SPACE}
        solids.append(_solid(result, index | {names[k]: i for k, i in zip(others, chosen, strict=True)}))
    return {
        "axes": others,
        "counts": [len(points[k]) for k in others],
        "solids": solids,
        "isDown": result.attributes.get("z_axis", "down") == "down",
        "bodies": [_mesh(faces_of(body)) | {"name": "obstacle", "lines": []} for body in obstacles(result)],
        "section": next((k for k, name in enumerate(names[:-2]) if name in SPACE), None)
        if set(names[-2:]) <= set(SPACE)
        else None,
        "plane": [SPACE.index(name) for name in names[-2:] if name in SPACE],
    }


def _solid(result: Result, index: dict[str, int]) -> dict[str, Any] | None:
    sides = sides_of(result, SPACE, index)
    if not (sides.verdict == 0).any():
        return None
    surface = boundary(sides)
    robot = posed(result, middle_of(sides), {axis: float(result.axes[axis][i]) for axis, i in index.items()})
    return {
        "corners": packed(surface.corners),
        "pieces": packed(surface.pieces.astype(np.int32)),
        "isEnd": packed(surface.is_end.astype(np.uint8)),
        "volume": volume_words(result, index),
        "ways": np.round(robot.cable_points, 6).tolist(),
        "edges": np.round(robot.edges, 6).tolist(),
    }


def _mesh(triangles: np.ndarray) -> dict[str, Any]:
    corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return {"corners": np.round(corners, 6).tolist(), "triangles": numbers.reshape(-1, 3).tolist()}

"""Bodies that can meet while a robot moves, as arrays for compiled functions: cables, obstacles, platform."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts import clearance
from cspr_jax.robots.contacts.clearance import ContactPair, Scene
from cspr_jax.robots.contacts.convex_gaps import BOX, BOX_SIGNS, FacePlanes
from cspr_jax.robots.contacts.interference import contacts
from cspr_jax.robots.model.platform import RIGID, PlatformRobot
from cspr_jax.robots.model.shapes import Box, Cylinder, Hull, is_flat

# Lengths over the extent of a scene:
DEEPEST = 1e-4  # deeper penetrations are not distinguished
THINNEST = 1e-9  # thickness given to flat boxes


class Shape(NamedTuple):
    """Convex body with faces, in axes that move with it.

    Fields:
        corners: (m, 3) m.
        edges: (n_edges, 2) indices of corners.
        faces: (n_faces, 3) corners of triangles, counterclockwise as seen from outside.
        planes: planes of the faces.
    """

    corners: Any
    edges: Any
    faces: Any
    planes: FacePlanes


class Bodies(NamedTuple):
    """Bodies of a scene, as compiled functions take them.

    Fields:
        pairs: (n_pairs, 2) cables that can meet.
        points: (n_cables, 3) attachment points, platform axes, m.
        radii: (n_cables,) halves of the diameters of the cables, m.
        rods: (n_rods, 2, 3) ends of the axes of spheres and cylinders, m.
        rod_radii: (n_rods,) m.
        boxes: boxes, leaves (n_boxes, ...).
        order: (n_obstacles,) index of each obstacle in the list of all rods followed by all boxes.
        body: shape of the platform in its axes; None: not known.
        leave: () length of each cable next to its attachment point that may touch the platform, m.
        sectors: (n_cables, 2, 3) sides and (3,) normal of `interference.Contacts`; None: not checked.
        extent: () largest coordinate, m.
        deepest: () deeper penetrations are not distinguished, m.
    """

    pairs: Any
    points: Any
    radii: Any
    rods: Any
    rod_radii: Any
    boxes: Shape | None
    order: Any
    body: Shape | None
    leave: Any
    sectors: Any
    extent: Any
    deepest: Any


def has_sectors(robot: AnyRobot, scene: Scene) -> bool:
    """Tell whether the criterion of the thesis replaces the shape of the platform."""
    return scene.body is None and robot.pattern == RIGID and is_flat(np.asarray(scene.platform_points))


def contact_pairs(robot: AnyRobot, scene: Scene) -> tuple[ContactPair, ...]:
    """Pairs of bodies in the order of the bounds of their clearances."""
    over = range(robot.n_cables) if has_sectors(robot, scene) else ()
    return scene.contact_pairs + tuple(ContactPair("platform", k, -1) for k in over)


def default_scene(robot: AnyRobot) -> Scene:
    """Scene of a robot without obstacles and without a shape of its platform."""
    return clearance.scene(robot, diameter=0.0 if robot.cable_diameter is None else np.asarray(robot.cable_diameter))


def bodies_of(robot: AnyRobot, scene: Scene) -> Bodies:
    """Bodies of a scene, as compiled functions take them."""
    rods = [k for k, shape in enumerate(scene.obstacles) if not isinstance(shape, Box)]
    boxes = [k for k, shape in enumerate(scene.obstacles) if isinstance(shape, Box)]
    axes = [_axis(scene.obstacles[k]) for k in rods]
    radii = np.array([scene.obstacles[k].radius for k in rods])  # type: ignore[union-attr]
    extent = max(float(np.abs(x).max()) for x in (scene.base_points, scene.platform_points))
    corners = [np.abs(scene.obstacles[k].centre).max() + scene.obstacles[k].half.sum() for k in boxes]  # type: ignore
    largest = [float(np.abs(axis).max() + radius) for axis, radius in zip(axes, radii, strict=True)]
    extent = max([extent, *largest, *corners])
    thinnest = THINNEST * extent
    shapes = [_shape(scene.obstacles[k], thinnest) for k in boxes]  # type: ignore[arg-type]
    near = contacts(robot) if has_sectors(robot, scene) and isinstance(robot, PlatformRobot) else None
    return Bodies(
        pairs=np.array(scene.pairs, int).reshape(-1, 2),
        points=np.asarray(scene.platform_points),
        radii=0.5 * scene.diameters,
        rods=np.array(axes).reshape(-1, 2, 3),
        rod_radii=radii,
        boxes=jax.tree.map(lambda *leaves: np.stack(leaves), *shapes) if shapes else None,
        order=np.argsort(np.array(rods + boxes, int)),
        body=None if scene.body is None else _shape(scene.body, thinnest),
        leave=np.asarray(scene.leave),
        sectors=None
        if near is None
        else (near.sides - (near.sides @ near.normal)[..., None] * near.normal, near.normal),
        extent=np.asarray(extent),
        deepest=np.asarray(DEEPEST * extent),
    )


def shape_corners(robot: AnyRobot, scene: Scene) -> Float[np.ndarray, "m 3"] | None:
    """Corners of the shape of a platform."""
    body = bodies_of(robot, scene).body
    return None if body is None else np.asarray(body.corners)


def platform_corners(robot: AnyRobot, bodies: Bodies) -> Any:
    """Points among which the lowest of a platform is found: attachment points, and corners of its shape."""
    corners = [bodies.points] if isinstance(robot, PlatformRobot) else []
    corners += [] if bodies.body is None else [bodies.body.corners]
    return jnp.concatenate(corners) if corners else None


def _axis(shape) -> np.ndarray:
    return np.stack([shape.start, shape.end] if isinstance(shape, Cylinder) else [shape.centre, shape.centre])


def _shape(shape: Box | Hull, thinnest: float) -> Shape:
    if isinstance(shape, Box):
        corners = shape.centre + (BOX_SIGNS * np.maximum(shape.half, thinnest)) @ shape.rotation.T
        edges, faces = BOX
        outward = np.stack([-shape.rotation.T, shape.rotation.T], axis=1).reshape(6, 3)
        normals = np.repeat(outward, 2, axis=0)
        offsets = np.einsum("fi,fi->f", normals, corners[faces[:, 0]])
        return Shape(corners, edges, faces, FacePlanes(normals, offsets))
    points = np.concatenate([shape.triangles.reshape(-1, 3), shape.edges.reshape(-1, 3)])
    corners, indices = np.unique(points, axis=0, return_inverse=True)
    faces, edges = np.split(indices.ravel(), [3 * len(shape.triangles)])
    faces, edges = faces.reshape(-1, 3), edges.reshape(-1, 2)
    a, b, c = np.moveaxis(shape.triangles, 1, 0)
    flipped = np.einsum("fi,fi->f", np.cross(b - a, c - a), shape.normals) < 0.0
    faces = np.where(flipped[:, None], faces[:, ::-1], faces)
    return Shape(corners, edges, faces, FacePlanes(shape.normals, shape.offsets))

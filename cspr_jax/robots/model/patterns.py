"""Table of motion patterns: how an effector can move, with R for rotations and T for translations; no jax here."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Pattern:
    """Motion pattern of an effector.

    Fields:
        name: name in files.
        description: text about the robots with this pattern.
        forces: fixed axes, 0 to 2, along which the cables balance forces; guides or a joint carry all other forces.
        moments: fixed axes about which the cables balance moments; empty with `along_line`, where the axes are two axes
            of the platform, normal to the line of its attachment points.
        along_line: whether all cables are attached on one line of the platform, about which it does not turn.
        is_jointed: whether the effector turns about a fixed joint, the origin of its frame; moments are about it.
    """

    name: str
    description: str
    forces: tuple[int, ...]
    moments: tuple[int, ...] = ()
    along_line: bool = False
    is_jointed: bool = False

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return len(self.forces) + len(self.moments) + 2 * self.along_line

    @property
    def is_planar(self) -> bool:
        """Tell whether the robot lies in the plane y = 0."""
        return self.forces == (0, 2)

    @property
    def is_body(self) -> bool:
        """Tell whether the effector is a body that turns, and not a point."""
        return bool(self.moments) or self.along_line


PATTERNS: dict[str, Pattern] = {
    row.name: row
    for row in (
        Pattern("1T", "a point mass on a vertical guide", (2,)),
        Pattern("2T", "planar = true", (0, 2)),
        Pattern("3T", "a point mass", (0, 1, 2)),
        Pattern("1R2T", "a planar platform", (0, 2), (1,)),
        Pattern("2R3T", "a rod, its cables attached along a line", (0, 1, 2), along_line=True),
        Pattern("3R3T", "a rigid platform, with platform_points and inertia", (0, 1, 2), (0, 1, 2)),
        Pattern("3R", "a platform on a spherical joint", (), (0, 1, 2), is_jointed=True),
    )
}

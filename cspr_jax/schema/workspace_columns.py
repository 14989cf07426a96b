"""Columns of maps of workspaces, and the keys of sweep files that ask for them."""

OF_WORKSPACES = ("verdict", "wrench_margin", "closure_margin", "clearance", "orientation_fraction", "cell_side")
AMONG_OBSTACLES = ("nearest_bodies", "clearance_cables", "clearance_obstacles")
LIMITED = ("floor_margin", "length_margin", "speed_margin")
MORE_OF_WORKSPACES = (
    *AMONG_OBSTACLES,
    *("clearance_platform", *LIMITED, "capacity_margin", "cell_open"),
)
_SUPPLIED = ("workspace.conditions.static", "workspace.conditions.wrench-feasible")
_FREE = "workspace.conditions.interference-free"
_SHAPES = ("workspace.platform_box", "workspace.platform_hull")
ONLY_WITH = (
    (("wrench_margin",), _SUPPLIED),
    (("closure_margin",), ("workspace.conditions.wrench-closure",)),
    (("capacity_margin",), ("workspace.capacity_length",)),
    (("clearance", "clearance_cables", "nearest_bodies"), (_FREE,)),
    (("clearance_obstacles",), ("workspace.obstacle",)),
    (("clearance_platform",), _SHAPES),
    (("floor_margin",), ("limits.floor",)),
    (("length_margin",), ("limits.cable_length_max",)),
    (("speed_margin",), ("workspace.speed", "workspace.angular_speed")),
    (("cell_side", "cell_open"), ("workspace.prove",)),
    (("orientation_fraction",), ("workspace.orientations",)),
)
OF_SHAPES = ("nearest_bodies", "clearance_cables", "clearance_platform")

QUANTITIES = (*OF_WORKSPACES, *MORE_OF_WORKSPACES)
STORED = (*OF_WORKSPACES, *LIMITED)
STORED_WITH = (
    ("workspace.obstacle", AMONG_OBSTACLES),
    ("workspace.platform_box", OF_SHAPES),
    ("workspace.platform_hull", OF_SHAPES),
    ("workspace.capacity_length", ("capacity_margin",)),
    ("workspace.prove", ("cell_open",)),
)

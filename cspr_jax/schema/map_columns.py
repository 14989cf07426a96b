"""Columns that kinds of maps have in common, columns of workspaces, and keys of sweep files that request them."""

from cspr_jax.schema.quantities import REFUSALS

TOLERATED = ("tolerated", "not_tolerated")
OBSTACLE_KEYS = ("obstacle", "platform_box", "platform_hull")
UNCERTAIN = (("limits.uncertainty", TOLERATED),)
COMMON = ("verdict", "duration", "margin", "margin_bound", "limit_margin", "feasible_at_infinity")
OF_TRANSITIONS = ("least_oscillations", "inclination_gain", "used_inclination", "used_z0")
OF_OSCILLATIONS = (
    *("oscillations", "tried_oscillations", "envelope_oscillations", *OF_TRANSITIONS),
    *(*COMMON, *TOLERATED),
)
OSCILLATIONS_STORED = (
    *("oscillations", "envelope_oscillations", "least_oscillations", "verdict", "duration", "margin"),
    *("inclination_gain", "used_inclination", "used_z0"),
)
OF_INSTANTS = ("squared_oscillations", "lower_envelope", "least_oscillations", "used_inclination", "used_z0")
OF_POSES = (
    *("arcs", "tried_arcs", "verdict", "duration", "margin", "margin_bound", "det_margin", "cable_distance"),
    *("limit_margin", "refuted_at", "beta_hat", *TOLERATED),
)
POSES_STORED = ("arcs", "verdict", "duration", "margin", "det_margin", "cable_distance", "beta_hat")
OF_POSITIONS = ("accessible", "accessible_points", "accessible_volume", "accessible_error", "largest_tilt")
OF_ATTAINED = (
    *("attainable", "attainable_fraction", "attainable_volume", "attainable_error", "mean_arcs"),
    *("undecided_fraction", "main_reason", *REFUSALS),
)
OF_ACCELERATIONS = (
    *("verdict", "acceleration_margin", "static_margin", "closure_margin", "level_acceleration"),
    *("level_acceleration_max", "upward_acceleration", "downward_acceleration"),
)
OF_LINES = (
    *("verdict", "duration", "acceleration_time", "least_duration", "duration_ratio", "rest_margin"),
    *("active_up", "active_down"),
)
OF_PATHS = ("verdict", "duration", "lower_bound", "tension_margin", "tension_margin_bound")
OF_LAUNCHES = (
    *("verdict", "release_speed", "largest_margin", "duration", "release_time", "flight_time"),
    *("release_x", "release_y", "release_z"),
)
OF_SWINGS = (
    *("verdict", "release_speed", "largest_margin", "swing_amplitude", "flight_time"),
    *("release_x", "release_y", "release_z"),
)
OF_ELLIPSES = (
    *("verdict", "margin", "used_frequency", "lowest_frequency", "highest_frequency", "natural_frequency"),
    *("binding_cable", "duration", "tension_margin", "limit_margin"),
)
ELLIPSES_STORED, OF_LIMITED_ELLIPSES = OF_ELLIPSES[:-2], OF_ELLIPSES[-2:]
ELLIPSE_KEYS = (
    *("axes.circle_radius", "axes.scale", "axes.tilt_azimuth", "axes.tilt", "axes.frequency"),
    *("ellipse", "limits"),
)
OF_LENGTHS = ("sigma_p", "sigma_r")

OF_WORKSPACES = ("verdict", "wrench_margin", "closure_margin", "clearance", "orientation_fraction", "cell_side")
AMONG_OBSTACLES = ("nearest_bodies", "clearance_cables", "clearance_obstacles")
LIMITED = ("floor_margin", "length_margin", "speed_margin")
MORE_OF_WORKSPACES = (
    *AMONG_OBSTACLES,
    *("clearance_platform", *LIMITED, "capacity_margin", "cell_open", "worst_cable", "natural_frequency_min"),
)
_SUPPLIED = ("workspace.conditions.static", "workspace.conditions.wrench-feasible")
_FREE = "workspace.conditions.interference-free"
_SHAPES = ("workspace.platform_box", "workspace.platform_hull")
WORKSPACES_ONLY_WITH = (
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
    (("worst_cable",), ("without.any-one",)),
    (("natural_frequency_min",), ("robot.axial_stiffness",)),
)
OF_SHAPES = ("nearest_bodies", "clearance_cables", "clearance_platform")

WORKSPACE_QUANTITIES = (*OF_WORKSPACES, *MORE_OF_WORKSPACES)
WORKSPACES_STORED = (*OF_WORKSPACES, *LIMITED)
WORKSPACES_STORED_WITH = (
    ("workspace.obstacle", AMONG_OBSTACLES),
    ("workspace.platform_box", OF_SHAPES),
    ("workspace.platform_hull", OF_SHAPES),
    ("workspace.capacity_length", ("capacity_margin",)),
    ("workspace.prove", ("cell_open",)),
    ("without.any-one", ("worst_cable",)),
)

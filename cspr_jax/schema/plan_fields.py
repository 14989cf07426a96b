"""Fields of the object that `cspr plan --json` prints, with units and meanings; the reference is made from these."""

from cspr_jax.schema.limits import LIMITS

_POINT = '"mass-centre" or "origin": point of the platform whose poses files hold; null of a point mass.'
# Fields that --rate adds.
_ROWS = {
    "rows": (
        "",
        "With `--rate`, without `-o`: the motion over time, by the names of motion files; null of one that is not "
        "feasible (`--anyway` gives it).",
    ),
    "units": ("", "With `rows`: their units."),
    "last_step": ("s", "With `--rate`: time between the last two rows, of which the last is the end of the motion."),
}
_WITHOUT = {
    "without": (
        "",
        "Cables that are gone, from 0 on; absent where all are there. All other numbers of cables are those of a robot "
        "without them.",
    )
}
# Fields of segments and of checks.
_EXTREMES = {
    **{row.name: (row.unit.replace("/s", " s-1").replace("-1^", "-"), row.extreme) for row in LIMITS if row.peak},
    "z_lowest": ("m", "z of the lowest point, of all of a platform: mass centre, attachment points, shape."),
    "natural_frequency_min": (
        "rad s-1",
        "Lowest natural frequency on elastic cables, with the tensions of the motion; 0 where it is not stable, null "
        "without `axial_stiffness` or where a cable is not taut.",
    ),
    "natural_frequency_t": ("s", "Time after the start of the segment at which it is the lowest."),
}
PLAN_OBJECT = {
    "schema": ("1", "Version of these fields."),
    "robot": ("", "Name of the robot."),
    **_WITHOUT,
    "family": ("", "Trajectory family of the plan."),
    "amplitude": ("", "Amplitude function; null for families that have a law of their own."),
    "z0": ("m", "Depth of P0 below the centroid of the spools, given or chosen; null without P0."),
    "point": ("", _POINT),
    "z_axis": ("", '"down" or "up", as in the robot file; all coordinates are in its axes.'),
    "gravity": ("m s-2", "Gravity."),
    "segments": ("", "One object for each segment, below."),
    "total_duration": ("s", "Sum of all durations."),
    "feasible": ("", "Whether every segment is feasible."),
    "launch": ("", "Release and flight of an object, below; absent if the plan releases none."),
    **_ROWS,
}
SEGMENT = {
    "from": ("1", "Number of the pose where the segment starts, from 0 on."),
    "to": ("1", "Number of the pose where the segment ends."),
    "family": ("", "Trajectory family of the segment."),
    "arcs": ("1", "Smallest feasible number of arcs, or the number in the plan; null: none, or a family without arcs."),
    "tried_arcs": ("1", "Number of arcs that all other fields belong to: `arcs`, else that of the best candidate."),
    "duration": ("s", "Duration."),
    "tension_min": (
        "N",
        "Smallest tension of any cable on the way; for redundant cables by the plan's rule `tensions`.",
    ),
    "tension_max": ("N", "Largest tension of any cable on the way."),
    "mu_min": ("s-2", "Smallest tension over mass and cable length."),
    "margin": (
        "1",
        "Smallest margin, as `segment_margin` of a motion file; of lines in m/s^2, of splines and over pulleys in N.",
    ),
    "margin_bound": ("1", "Proved lower bound of `margin`; null where nothing is proved."),
    "limit_margin": (
        "1",
        "Smallest slack of the limits; null without limits. Of splines, and over pulleys, that of all criteria beside "
        "tensions, contacts too.",
    ),
    "tolerated": (
        "1",
        "Multiple of `limits.uncertainty` for which the segment is proved feasible; null without uncertainty.",
    ),
    "not_tolerated": (
        "1",
        "Smallest multiple for which a robot was found that fails; null: none, or without uncertainty.",
    ),
    "tension_margin": ("N", "Smallest margin of tensions, as `segment_tension_margin` of a motion file."),
    "det_sign_constant": ("", "Whether the structure matrix keeps the sign of its determinant."),
    "verdict": ("", '"feasible", "undecided", or names of flags joined by "+" (verdicts, below).'),
    "cause": (
        "",
        "Causes why the segment is not feasible, the worst first: `criterion` (name of a flag), `cable` (from 0 on; "
        "null: none), `t` (s from the start of the segment), `needed` (the worst there is, at `t`) and `allowed` (both "
        "of `unit`), and `cables` where two touch; null where the segment is feasible. Paths without a motion: also "
        "`s`, m, and `position`, m, of the "
        "place that no path speed passes, where the criterion needs an acceleration along the path, `needed`, and "
        "`against` (`criterion` and `cable`; null: the speeds from which the way on is possible) allows no more than "
        '`allowed`, or, with `needs` false, the other way round; or `end` ("start" or "end") with its possible '
        "`speeds`, smallest and largest.",
    ),
    "fewer_arcs_undecided": (
        "",
        "Whether a smaller number of arcs could not be refuted, or, over pulleys, was refuted without them only.",
    ),
    "feasible_at_infinity": ("1", "Point masses: left-hand side of thesis (2.55)."),
    **_EXTREMES,
    "samples": ("1", "Number of samples of tensions, lengths and speeds."),
    "oscillations": ("1", "Transitions: smallest feasible number of oscillations; null: none."),
    "tried_oscillations": ("1", "Transitions: half of `tried_arcs`; absent in other families."),
    "envelope_oscillations": ("1", "Transitions: number of oscillations that the envelopes allow; null: none."),
    "least_oscillations": ("1", "Transitions: number of oscillations that the envelopes require, a real number."),
    "inclination": ("1", "Transitions: inclination v."),
    "det_margin": (
        "1",
        "Platforms, not over pulleys: smallest determinant of the structure matrix over that at rest in P0.",
    ),
    "cable_interference": ("", "Platforms: whether two cables touch."),
    "cable_distance_min": ("m", "Platforms: smallest distance between cables that share no end."),
    "platform_interference": ("", "Platforms: whether a cable touches the platform."),
    "refuted_at": ("s", "Platforms: time after the start of the segment that refutes it; null: none."),
    "beta_hat": ("1", "Platforms: beta-hat at both ends."),
    "acceleration_time": ("s", "Straight lines: time of acceleration p."),
    "active": ("", "Straight lines: names of the bounds that hold the motion back."),
    "least_duration": (
        "s",
        "Straight lines: least duration of any motion; Bezier segments: least duration with taut cables.",
    ),
    "control_points": ("m", "Bezier segments: the three control points."),
    "taut_durations": ("s", "Bezier segments: intervals of durations with all cables taut; null: without end."),
    "margin_unit": (
        "",
        'Unit of `margin` and `margin_bound`: "m/s^2" of lines, "N" of splines and over pulleys, "1" elsewhere.',
    ),
    "failing": (
        "s",
        "Intervals of time in which the segment fails, since its start, of segments that are not feasible, splines, "
        "paths, ellipses and free motions, among bodies and over pulleys; null elsewhere.",
    ),
    "failing_by_criterion": ("s", "Likewise, by the criterion that fails, the name of its flag; null elsewhere."),
    "frequency": ("rad s-1", "Ellipses: frequency of the ellipse on which the segment ends; to rest, starts."),
    "frequency_intervals": (
        "rad s-1",
        "Ellipses, point masses on spools in one plane: frequencies at which all cables stay taut on that ellipse, "
        "[low, high] each; null: without end.",
    ),
    "pseudotension_margin": (
        "1",
        "Likewise: smallest normalised pseudotension, or depth over that of the centre, on the ellipse itself.",
    ),
    "rotation_frequencies": (
        "rad s-1",
        "Ellipses of platforms: the three natural frequencies of rotation at rest in its centre; null: not stable.",
    ),
    "rotation_modes": (
        "",
        "Ellipses of platforms: for each of these the displacement of the mass centre, m, beside a rotation of length "
        "1, rad; six numbers.",
    ),
    "lower_bound": (
        "s",
        "Paths: proved lower bound of the time of any motion forward along the segment, from stop to stop; null where "
        "a section without a stop runs on through a pose, or has no motion. Free motions: of the time of any motion "
        "between both poses.",
    ),
    "gap": ("1", "Paths, free motions of least time: 1 - `lower_bound` / `duration`."),
    "binding": (
        "",
        "Paths: limits that bind, those that do so longest first: `criterion` (name of a flag), `cable` (from 0 on; "
        "null: none), `share` of the time of the segment.",
    ),
    "sections": ("", "Paths: one object for each section, from stop to stop, that ends in the segment, below."),
    "objective": (
        "",
        'Free motions: what the motion is the best in, "time", "energy", "tension" or "margin"; null elsewhere.',
    ),
    "energy": ("N^2 s", "Free motions: integral of the sum of the squares of the tensions; null elsewhere."),
    "source": (
        "",
        'Free motions: family whose motion it is: "free", or the one than which the search found nothing faster; null '
        "elsewhere.",
    ),
    "planned_duration": ("s", "Retimed plans: duration of the motion that was planned; null elsewhere."),
    "gain": ("1", "Retimed plans: 1 - `duration` / `planned_duration`."),
    "retimed": ("", "Retimed plans: whether the motion is the faster one; the planned one stays where none is proved."),
    "path_deviation": ("m", "Retimed plans: largest distance of the motion from the planned path at samples."),
}
# Fields of each section of a path, from stop to stop.
SECTION = {
    "segments": ("1", "Numbers of the segments in which it begins and ends."),
    "length": ("m", "Length of the way of the mass centre."),
    "duration": ("s", "Duration."),
    "lower_bound": ("s", "Proved lower bound of the time of any motion forward along it; null without a motion."),
    "gap": ("1", "1 - `lower_bound` / `duration`."),
    "ramp_time": (
        "s",
        "Time in which accelerations rise and fall, `path.ramp_time` or shorter; 0: they jump; null: no motion.",
    ),
    "ramp_cost": ("1", "Duration over that of the fastest motion without ramps, less 1; null without ramps."),
    "path_deviation": ("m", "Largest distance of the motion from the path at samples."),
    "least_speed": ("m s-1", "Speed along the path that is needed somewhere to come to the end; null: none is."),
    "binding": ("", "As of a segment."),
    "jumps": (
        "1",
        "Number of jumps of the acceleration by more than 1 % of the largest one, those at the start and the end of a "
        "motion from or to rest included.",
    ),
}
LAUNCH = {
    "segment": ("1", "Number of the segment on which the object is released, of ellipses at its end, from 0 on."),
    "release": ("", "`position`, m, `velocity`, m/s, and `time`, s, after the start of the plan."),
    "control_points": ("m", "Control points of the segment; null on an ellipse."),
    "half_axes": (
        "m",
        "Ellipses: from the centre to the release, and to the place a quarter of a turn later; null elsewhere.",
    ),
    "landing": ("m", "Place of the landing."),
    "flight_time": ("s", "Duration of the flight."),
    "tension_min": ("N", "Smallest tension of any cable on the segment."),
    "scatter": ("", "Scatter of a sample of throws, below; absent without `[launch.errors]`."),
}
SCATTER = {
    "throws": ("1", "Number of throws."),
    "missed": ("1", "Number of throws that never come to the height of the target."),
    "mean": ("m", "Mean landing (x, y), relative to the target."),
    "covariance": ("m2", "Covariance of the landings."),
    "covariance_first_order": ("m2", "Covariance of the landings for small errors, by derivatives."),
    "mean_error": ("m", "Mean distance from the target."),
    "standard_deviation": ("m", "Standard deviation of the distance from the target."),
    "largest_error": ("m", "Largest distance from the target."),
}
# The object that `cspr check --json` prints.
CHECK = {
    "schema": ("1", "Version of these fields."),
    "robot": ("", "Name of the robot."),
    "verdict": ("", '"feasible" (proved), "undecided", or names of flags joined by "+" (verdicts, below).'),
    "feasible": ("", "Whether the motion is proved feasible."),
    "duration": ("s", "Duration."),
    "margin": (
        "N",
        "Smallest distance of a tension from its limits; of redundant cables that of all together.",
    ),
    "margin_unit": ("", '"N".'),
    "margin_bound": ("N", "Proved lower bound of `margin`; null where nothing is proved."),
    "limit_margin": (
        "1",
        "Smallest slack of all other criteria, over the limit, or the size of the robot; null without any.",
    ),
    "tolerated": (
        "1",
        "Multiple of `limits.uncertainty` for which the motion is proved feasible; null without uncertainty.",
    ),
    "not_tolerated": (
        "1",
        "Smallest multiple for which a robot was found that fails; null: none, or without uncertainty.",
    ),
    "cause": ("", "As of a segment of a plan; empty where the motion is feasible."),
    "failing": (
        "s",
        "All intervals of time in which it fails, to 1e-6 s; of a function from sample to sample.",
    ),
    "failing_by_criterion": ("s", "Likewise, by the criterion that fails, the name of its flag."),
    "tension_min": ("N", "Smallest tension of any cable, as of a segment of a plan."),
    "tension_max": ("N", "Largest tension of any cable, likewise."),
    "tension_margin": ("N", "`margin`."),
    **_EXTREMES,
    "demands": (
        "",
        "By limit or condition: `value` of the worst cable, `bound` that is proved for all (null: of tensions that a "
        "rule chooses, and of what has no limit), what is `allowed`, `unit`, `cable` (from 0 on; null: none), `t`, s, "
        'and `sense`: "at least" or "at most" what is allowed, in the axes of the robot file.',
    ),
    "on_limit": (
        "",
        "Criteria that the motion meets or misses by less than its samples tell: as `cause`, and `tolerance`, what "
        "samples leave open, in its unit; empty where there are none.",
    ),
    "interpolation": ("", '"cubic", "quintic", "hermite", "pieces" (polynomials), or "function" (sampled).'),
    "point": ("", _POINT),
    "ends": ("", '"rest", "natural" or "periodic"; null where the motion has its own ends.'),
    "blocks": ("1", "Number of blocks of time that were looked at."),
    "slower": (
        "",
        "With --slower: `factor` by which time is stretched (null: none is feasible), `static` (whether the robot can "
        "stand still at every place), `check` of the stretched motion.",
    ),
    "retimed": (
        "",
        "With --retime: this object again, of the motion that runs along its path in the least time, with "
        "`planned_duration`, `gain`, `lower_bound`, `gap`, `retimed` and `path_deviation` of a retimed plan.",
    ),
    **_ROWS,
}

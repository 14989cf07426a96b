"""The public names for type checkers and editors, as `__init__.py` loads them."""

from cspr_jax.api.checks import check as check
from cspr_jax.api.elasticity import natural_frequencies as natural_frequencies
from cspr_jax.api.elasticity import stiffness as stiffness
from cspr_jax.api.families.beziers import bezier as bezier
from cspr_jax.api.families.beziers import bezier_durations as bezier_durations
from cspr_jax.api.families.beziers import bezier_verdicts as bezier_verdicts
from cspr_jax.api.families.beziers import launch_range as launch_range
from cspr_jax.api.families.ellipses import ellipse as ellipse
from cspr_jax.api.families.ellipses import ellipse_frequencies as ellipse_frequencies
from cspr_jax.api.families.ellipses import ellipse_margins as ellipse_margins
from cspr_jax.api.families.lines import least_time as least_time
from cspr_jax.api.families.lines import straight_line as straight_line
from cspr_jax.api.families.motions import amplitude as amplitude
from cspr_jax.api.families.motions import hypocycloid as hypocycloid
from cspr_jax.api.families.motions import make_problem as make_problem
from cspr_jax.api.families.motions import platform_motion as platform_motion
from cspr_jax.api.families.motions import sampled_margin as sampled_margin
from cspr_jax.api.families.motions import slacks as slacks
from cspr_jax.api.families.motions import spline as spline
from cspr_jax.api.families.motions import tensions as tensions
from cspr_jax.api.families.motions import transition as transition
from cspr_jax.api.families.paths import least_time_paths as least_time_paths
from cspr_jax.api.families.platform_searches import accessible as accessible
from cspr_jax.api.families.platform_searches import attainable as attainable
from cspr_jax.api.families.platform_searches import minimum_pose_arcs as minimum_pose_arcs
from cspr_jax.api.families.searches import minimum_arcs as minimum_arcs
from cspr_jax.api.families.searches import minimum_oscillations as minimum_oscillations
from cspr_jax.api.families.swing_ranges import swing_range as swing_range
from cspr_jax.api.files.imports import ImportedRobot as ImportedRobot
from cspr_jax.api.files.imports import import_robot as import_robot
from cspr_jax.api.files.listings import copy_examples as copy_examples
from cspr_jax.api.files.listings import list_examples as list_examples
from cspr_jax.api.files.listings import list_quantities as list_quantities
from cspr_jax.api.files.listings import list_robots as list_robots
from cspr_jax.api.files.listings import new_file as new_file
from cspr_jax.api.files.pictures import plot as plot
from cspr_jax.api.files.published import benchmark as benchmark
from cspr_jax.api.files.published import list_tables as list_tables
from cspr_jax.api.files.published import table as table
from cspr_jax.api.files.replays import Replay as Replay
from cspr_jax.api.files.replays import replay as replay
from cspr_jax.api.files.reports import report as report
from cspr_jax.api.forward_kinematics import forward as forward
from cspr_jax.api.many_checks import check_many as check_many
from cspr_jax.api.plans import plan as plan
from cspr_jax.api.retiming import retime as retime
from cspr_jax.api.robots import load_robot as load_robot
from cspr_jax.api.robots import parallel_pair_robot as parallel_pair_robot
from cspr_jax.api.robots import platform as platform
from cspr_jax.api.robots import point_mass as point_mass
from cspr_jax.api.robots import point_mass_robot as point_mass_robot
from cspr_jax.api.robots import three_cable_equivalent as three_cable_equivalent
from cspr_jax.api.robots import with_cables as with_cables
from cspr_jax.api.sweeps import compute_sweep as compute_sweep
from cspr_jax.api.sweeps import keep_compiled_code as keep_compiled_code
from cspr_jax.api.sweeps import merge as merge
from cspr_jax.api.sweeps import open_result as open_result
from cspr_jax.api.sweeps import run as run
from cspr_jax.api.sweeps import status as status
from cspr_jax.api.sweeps import verify as verify
from cspr_jax.api.sweeps import workspace_volume as workspace_volume
from cspr_jax.api.workspaces import available_accelerations as available_accelerations
from cspr_jax.api.workspaces import encoder_error as encoder_error
from cspr_jax.api.workspaces import sensitivity as sensitivity
from cspr_jax.api.workspaces import workspace as workspace
from cspr_jax.launch.landings import LaunchErrors as LaunchErrors
from cspr_jax.outputs.volumes import WorkspaceVolume as WorkspaceVolume
from cspr_jax.robots.model.limits import Limits as Limits
from cspr_jax.robots.model.limits import Uncertainty as Uncertainty
from cspr_jax.schema.verdicts import Verdict as Verdict

__version__: str

compute = compute_sweep
table_names = list_tables

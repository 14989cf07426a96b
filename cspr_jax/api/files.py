"""Commands from Python: plans, sweeps, results, pictures, tables and lists, as the command line has them."""

from pathlib import Path

from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.plans import planning
from cspr_jax.plans.planning import Plan


def plan(path: str | Path) -> Plan:
    """Plan the sequence of a plan file; see `cspr_jax.reports.plan_object` for plain values.

    Args:
        path: the file.

    Returns:
        the plan, feasible or not.

    Raises:
        ConfigError: a mistake in the file.
    """
    with double_precision():
        return planning.plan(Path(path))

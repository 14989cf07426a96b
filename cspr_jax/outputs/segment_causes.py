"""The worst cause of each segment: as columns of motion files, and as words from these columns."""

from collections.abc import Mapping, Sequence

import numpy as np

from cspr_jax.motion.cause import UNITS, Cause
from cspr_jax.schema.verdicts import Verdict


def cause_columns(each: Sequence[tuple[Cause, ...]]) -> dict[str, np.ndarray]:
    """The worst cause of each segment, as motion files have it."""

    def is_usual(cause: Cause) -> bool:
        return cause.unit == UNITS.get(Verdict[cause.criterion.upper()], cause.unit)

    worst = [segment_causes[0] if segment_causes else Cause("feasible") for segment_causes in each]
    return {
        "segment_cause": np.array([Verdict[cause.criterion.upper()].value for cause in worst]),
        "segment_cause_cable": np.array([cause.cables[0] + 1 if len(cause.cables) == 1 else 0 for cause in worst]),
        "segment_cause_time": np.array([cause.t for cause in worst]),
        # Files have no unit of causes: leave out numbers whose unit is not the usual one of their flag.
        "segment_needed": np.array([cause.needed if is_usual(cause) else np.nan for cause in worst]),
        "segment_allowed": np.array([cause.allowed if is_usual(cause) else np.nan for cause in worst]),
    }


def cause_text(columns: Mapping[str, np.ndarray], i: int) -> str:
    """The worst cause of a segment in words."""
    flag = Verdict(int(columns["segment_cause"][i])) if "segment_cause" in columns else Verdict.FEASIBLE
    if flag.name is None or not flag:
        return ""
    t, needed, allowed = (float(columns[f"segment_{name}"][i]) for name in ("cause_time", "needed", "allowed"))
    cable = int(columns["segment_cause_cable"][i])
    return Cause(flag.text, (cable - 1,) if cable else (), t, needed, allowed, UNITS.get(flag, "m")).text

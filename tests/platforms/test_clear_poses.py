"""Maps of arcs to poses among obstacles: cells are what plans say, whose contacts samples confirm."""

import json

import numpy as np
import pytest

import cspr_jax
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

BALL = {"kind": "sphere", "centre": [0.25, 0.1, 1.62], "radius": 0.1}
SWEEP = {
    "schema": 1,
    "map": "poses",
    "robot": "laval-mssm",
    "axes": {"x": [0.3, 0.5], "y": [0.2], "z": [1.3], "tilt": [0.3], "tilt_azimuth": [0.4], "z0": [1.4]},
    "trajectory": {
        "family": "hypocycloid",
        "amplitude": {"name": "effective-c3", "epsilon": 0.1},
        "max_arcs": 8,
        "from": {"rest": True},
        "beta_hat": "preferred",
    },
    "obstacle": [BALL],
    "platform_box": [[-0.16, -0.18, -0.01], [0.16, 0.09, 0.05]],
}


@pytest.mark.thorough
def test_cells_are_what_plans_say():
    """Beta-hat is that of the cell; of a plan and of a map margins are narrowed down from other samples."""
    result = cspr_jax.compute_sweep(SWEEP)
    settings = json.loads(result.attrs["settings"])
    free = cspr_jax.compute_sweep({key: value for key, value in SWEEP.items() if key not in ("obstacle",)})
    more = []
    for index in np.ndindex(*result["arcs"].shape):
        place = {name: float(result[name].values[i]) for name, i in zip(result["arcs"].dims, index, strict=True)}
        cell = {name: result[name].values[index].item() for name in result.data_vars}
        plan = cspr_jax.plan(cell_plan(settings, place, {"beta_hat": cell["beta_hat"]}))
        answers = plan.answers
        assert (cell["arcs"], cell["verdict"]) == (answers.arcs[0], answers.verdict[0])
        assert cell["duration"] == pytest.approx(answers.duration[0], rel=1e-9)
        assert cell["margin"] == pytest.approx(answers.margin[0], rel=1e-3)
        proof = plan.legs[0].answers.proofs[0]
        assert cell["clearance"] == pytest.approx(float(proof.proof.high.min()), rel=0.01, abs=1e-5)
        assert (cell["clearance"] > 0.0) == (cell["arcs"] > 0)
        more.append(cell["arcs"] - int(free["arcs"].values[index]))
        if not cell["arcs"]:
            assert Verdict(cell["verdict"]) & Verdict.OBSTACLE
    assert any(more)

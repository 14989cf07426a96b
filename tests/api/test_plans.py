"""Plans from Python: those of the command, from a path and from a dictionary."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from outputs.test_outputs import cspr, strict_json
from support.folder import PLAN, folder, same, values

import cspr_jax
from cspr_jax.errors import ConfigError

__all__ = ["folder"]  # a fixture


def test_plans(folder, capsys):
    """From a path, and from a dictionary with arrays in it; rows and files as the command writes them."""
    data = tomllib.loads(PLAN)
    data["pose"][1]["position"] = np.array([0.3, 0.2, 1.6])
    data["samples"], data["robot"] = np.int64(30), Path("mine.toml")
    plan, same_plan = cspr_jax.plan("plan.toml"), cspr_jax.plan(data)
    printed = strict_json(cspr(capsys, "plan", "plan.toml", "--json", "-o", "told.h5", "--rate", 20))
    last_step = printed.pop("last_step")
    assert plan.to_dict() == same_plan.to_dict() == printed and plan.feasible
    assert plan.text == PLAN and json.loads(same_plan.text)["samples"] == 30
    assert plan.save("mine.h5", 20.0) == Path("mine.h5")
    same(values("mine.h5"), values("told.h5"))
    rows = plan.rows(20.0)
    assert last_step == pytest.approx(rows["t"][-1] - rows["t"][-2], abs=1e-12)
    types = dict.fromkeys(rows, "float64") | {"binding": "uint32", "binding_cable": "int16"}
    assert {name: str(rows[name].dtype) for name in rows} == types
    assert len(plan.rows()["t"]) == 60
    same(rows, {name: values("told.h5")[name] for name in rows})
    cspr(capsys, "plan", "plan.toml", "-o", "told.csv")
    plan.save("mine.csv")
    assert Path("mine.csv").read_bytes() == Path("told.csv").read_bytes()


def test_a_plan_that_is_not_feasible(folder):
    data = tomllib.loads(PLAN) | {"max_arcs": 1}
    data["pose"][1]["position"] = [1.8, 0.2, 0.4]
    plan = cspr_jax.plan(data)
    assert not plan.feasible and plan.to_dict()["segments"][0]["arcs"] is None
    with pytest.raises(ConfigError, match="not proved feasible"):
        plan.save("motion.csv")
    assert not Path("motion.csv").exists()
    assert plan.save("motion.csv", anyway=True).read_text().splitlines()[0].endswith(",feasible")


def test_a_motion_for_xarray(folder):
    """The same from the plan and from its file."""
    xarray = pytest.importorskip("xarray")
    plan = cspr_jax.plan("plan.toml")
    found = plan.to_xarray(20.0)
    xarray.testing.assert_equal(found, cspr_jax.open_result(plan.save("motion.h5", 20.0)).to_xarray())
    assert found.attrs.keys() == cspr_jax.open_result("motion.h5").to_xarray().attrs.keys()
    assert found.position.dims == ("t", "axis") and found.tension.dims == ("t", "cable")
    assert found.segment_margin.dims == ("segment",) and found.tension.attrs["units"] == "N"
    assert "flag_masks" in found.segment_verdict.attrs and "component" not in found.dims
    assert found.position.sel(axis="z").values[0] == pytest.approx(1.5)


def test_a_motion_of_a_platform_for_xarray():
    from cspr_jax.schema import labelled

    arrays = {"t": np.arange(4.0), "quaternion": np.ones((4, 4)), "omega": np.ones((4, 3)), "tension": np.ones((4, 6))}
    found = labelled.motion(arrays, {})
    assert (found.quaternion.dims, found.omega.dims) == (("t", "component"), ("t", "axis"))
    assert found.component.values.tolist() == list("wxyz") and found.cable.values.tolist() == [1, 2, 3, 4, 5, 6]

"""What plans, checks, answers and results show of themselves."""

import base64
import dataclasses
import re

import numpy as np
import pytest

import cspr_jax
from cspr_jax.outputs.plots import draw

TIMES = np.linspace(0.0, 6.0, 7)
POINTS = np.array([0.0, 0.0, 1.0]) + 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (7, 3))


def image_of(html):
    """The one picture of a notebook's cell."""
    (text,) = re.findall('<img alt="" src="data:image/png;base64,([^"]*)">', html)
    return base64.b64decode(text, validate=True)


@pytest.fixture(scope="module")
def check():
    return cspr_jax.check("prototype", TIMES, POINTS, limits={"cable_speed_max": 0.09})


def test_checks_and_plans_show_a_few_lines_and_a_picture(check, monkeypatch):
    """The lines of the command; nothing is drawn before a notebook asks."""
    with monkeypatch.context() as patch:
        patch.setattr(draw, "drawn", lambda *_, **__: pytest.fail("drawn"))
        assert repr(check).splitlines()[0].startswith("Check of prototype: motion of 6 s")
        assert check.lines()[1] in repr(check)
        assert repr(check.plan).startswith("Plan of prototype: spline, 1 segments in 6 s: not proved feasible")
    assert len(repr(check).splitlines()) <= 9 and len(repr(check.plan).splitlines()) <= 9
    for shown in (check, check.plan):
        html = shown._repr_html_()
        assert html.startswith("<pre>") and image_of(html)[:8] == b"\x89PNG\r\n\x1a\n" and len(html) < 300_000


def test_names_are_escaped(check):
    named = check.plan.robot_file.model_copy(update={"name": "<script>\x1b$x$"})
    html = dataclasses.replace(check.plan, robot_file=named)._repr_html_()
    assert "<script>" not in html and "&lt;script&gt;\\x1b$x$" in html


def test_answers_name_each_column_once():
    robot = cspr_jax.load_robot("prototype")
    lines = repr(cspr_jax.check_many(robot, TIMES, POINTS[None])).splitlines()
    assert lines[0] == "ManyChecks of 1 cases" and "  verdict: [0]" in lines and len(lines) <= 9


def test_results_show_their_axes_and_a_picture(tmp_path, check):
    motion = cspr_jax.open_result(check.plan.save(tmp_path / "motion.h5", anyway=True))
    assert repr(motion).startswith("Result: motion") and len(repr(motion).splitlines()) <= 9
    assert image_of(motion._repr_html_())

"""Designs as tests make them."""

from pathlib import Path

import pytest

from cspr_jax.config.design import checked_design
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.synthesis.problem import DesignProblem


@pytest.fixture(scope="session")
def evaluator():
    """A function that gives the evaluator of the content of a design file, each time a new one."""

    def make(data):
        with double_precision():
            design, content = checked_design(data, Path("design.toml"))
            return DesignProblem(design, content, Path("design.toml")).evaluator()

    return make

"""The notebooks of the gallery: whole, shown as they ran, and named on its page. `make gallery` runs them."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
NOTEBOOKS = sorted(GALLERY.glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="needs cspr_jax[gallery]")


@pytest.fixture(scope="module")
def runner():
    spec = importlib.util.spec_from_file_location("gallery", GALLERY / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.prose
def test_there_are_six():
    named = re.findall(r"\]\((\w+)\.ipynb\)", (GALLERY / "README.md").read_text("utf-8"))
    assert sorted(named) == [path.stem for path in NOTEBOOKS] and len(named) >= 6


@pytest.mark.prose
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_shown_as_it_ran(path):
    """From its first cell to its last, without an error; it ends with a picture, and names nothing of a machine."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert notebook.cells[0].source.startswith("# ")
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell.outputs]
    assert {output.output_type for output in outputs} <= {"stream", "display_data", "execute_result"}
    assert all(output.name == "stdout" for output in outputs if output.output_type == "stream")
    assert any("image/png" in output.data for output in code[-1].outputs if "data" in output)
    assert all("execution" not in cell.metadata for cell in notebook.cells)
    assert not re.search(r"/(?:home|root|tmp|work|Users)/", path.read_text("utf-8"))


@pytest.mark.prose
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_code_of_a_notebook_can_be_read(path):
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        lines = cell.source.splitlines()
        assert max(map(len, lines)) <= 120, cell.source
        if cell.cell_type == "code":
            ast.parse("\n".join(line for line in lines if not line.startswith("%")))


def test_other_words_and_other_numbers_are_noticed(runner):
    text = "y = 0.3 m: 99% of 441 directions\n"
    assert runner.alike(text, "y = 0.3 m: 98% of 442 directions\n")
    assert not runner.alike(text, "y = 0.3 m: 90% of 441 directions\n")
    assert not runner.alike(text, "y = 0.3 m: 99% of 441 places\n")
    assert not runner.alike(text, text + text)
    assert not runner.alike("1 2", "1")


@pytest.mark.thorough
def test_a_notebook_that_prints_something_else_is_named(runner, tmp_path):
    cell = nbformat.v4.new_code_cell("print(2.0)")
    cell.outputs = [nbformat.v4.new_output("stream", name="stdout", text="3.0\n")]
    path = tmp_path / "study.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), path)
    (wrong,) = runner.run(path, store=False)
    assert "3.0" in wrong and "2.0" in wrong
    assert runner.run(path, store=True) == [] and runner.run(path, store=False) == []
    cell.source = "raise ValueError('no such robot')"
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), path)
    (wrong,) = runner.run(path, store=False)
    assert "no such robot" in wrong

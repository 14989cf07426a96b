"""What the documents show works: Python, commands, sweep files, links, and the generated reference."""

import functools
import importlib
import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import mypy.api
import pytest

import cspr_jax
from cspr_jax import cli
from cspr_jax.config.design import read_design
from cspr_jax.config.plan import PlanFile, read_plan
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.config.robot import read_robot
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.style.options import with_widths
from cspr_jax.published import tables
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import QUANTITIES
from cspr_jax.sweep.definition import read_sweep

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "docs" / "built"
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "results/README.md")),
    *(path for path in sorted((ROOT / "docs").rglob("*.md")) if not path.is_relative_to(BUILT)),
]
COLUMNS = 120
FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def script(name: str):
    """A program of docs, as a module."""
    sys.path.insert(0, str(ROOT / "docs"))  # some of them import others
    try:
        return importlib.import_module(name)
    finally:
        sys.path.pop(0)


@functools.cache
def texts() -> dict[Path, str]:
    """All pages: those that are committed, and those that are built with the site."""
    built = {BUILT / name: text for name, text in script("build_pages").page_texts().items()}
    return {page: page.read_text("utf-8") for page in PAGES} | built


def fenced(text: str, *languages: str) -> list[str]:
    """Fenced blocks of a text, in some languages."""
    return [block for language, block in FENCE.findall(text) if language in languages]


def blocks(page: Path, *languages: str) -> list[str]:
    """Fenced blocks of a committed page, in some languages."""
    return fenced(page.read_text("utf-8"), *languages)


def commands(text: str) -> list[list[str]]:
    """The words of every `cspr` command of a page's shell blocks, comments left out."""
    lines = [line.removeprefix("$ ") for block in fenced(text, "sh", "console", "bash") for line in block.splitlines()]
    words = [shlex.split(line, comments=True) for line in lines]
    return [line for line in words if line[:1] == ["cspr"]]


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A working directory with the files that documents name, free to be written to."""
    for name in ("sweeps", "results/reference", "docs/examples"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.prose
def test_fences_are_seen():
    """Every fence opens and closes a block, so no block escapes the tests below."""
    for page, text in texts().items():
        assert len(re.findall(r"^\s*```", text, re.MULTILINE)) == 2 * len(FENCE.findall(text)), page
    assert blocks(ROOT / "README.md", "python")
    assert sum(len(commands(text)) for text in texts().values()) > 100


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["README.md", "docs/get_started.md", "docs/ellipses.md"])
def test_python_of_the_first_pages_runs(name, checkout, capsys):
    namespace: dict[str, object] = {"__name__": "first"}
    for text in blocks(ROOT / name, "python"):
        exec(compile(text, name, "exec"), namespace)
    assert capsys.readouterr().out.strip()


@pytest.mark.thorough
def test_the_page_of_python_runs(checkout, capsys, small_bench):
    """One block after another; a block of text under one is what it prints."""
    page = ROOT / "docs" / "python.md"
    shown = FENCE.findall(page.read_text("utf-8"))
    namespace: dict[str, object] = {"__name__": "python"}
    assert len(blocks(page, "python")) >= 8
    for i, (language, text) in enumerate(shown):
        if language == "python":
            exec(compile(text, page.name, "exec"), namespace)
            printed = capsys.readouterr().out
            following = shown[i + 1] if i + 1 < len(shown) else ("", "")
            assert printed == (following[1] if following[0] == "text" else ""), text


@pytest.mark.thorough
def test_types_of_the_python_of_the_documents(tmp_path):
    """Type checkers accept what the documents show, as one module a page."""
    modules = []
    for page in PAGES:
        if shown := blocks(page, "python"):
            modules.append(tmp_path / f"page_{len(modules)}.py")
            modules[-1].write_text("\n".join(shown), "utf-8")
    assert len(modules) > 5
    settings = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(ROOT / ".mypy_cache")]
    found, _, code = mypy.api.run([*settings, *map(str, modules)])
    assert code == 0, found


@pytest.mark.prose
def test_commands_of_the_documents_parse(checkout):
    for words in (words for text in texts().values() for words in commands(text)):
        options = cli._parser().parse_args(with_widths(words[1:]))
        named = getattr(options, "sweep", None) or getattr(options, "plan", None)
        if named is not None:
            assert (ROOT / named).is_file(), words
        if words[1] == "table" and options.name:
            assert options.name in tables.TABLES


@pytest.mark.prose
def test_sweeps_of_the_documents_are_read(checkout):
    for text in (block for page in texts().values() for block in fenced(page, "toml")):
        path = checkout / "shown.toml"
        path.write_text(text, "utf-8")
        if "map" in read_toml(path):
            assert read_sweep(path).grid.n_cells > 0


@pytest.mark.thorough
def test_the_first_robot_and_plan(checkout, capsys):
    """They are shown as they are, and what the page shows of them is what the program prints."""
    page = ROOT / "docs" / "first_robot.md"
    files = [checkout / "docs" / "examples" / name for name in ("hall.toml", "hall_plan.toml")]
    assert blocks(page, "toml") == [path.read_text("utf-8") for path in files]
    assert read_robot(files[0]).z_axis == "up"
    assert cli.main(["plan", str(files[1])]) == 0
    printed = capsys.readouterr()
    shown, line = blocks(page, "text")
    assert [text.rstrip() for text in printed.out.splitlines()] == shown.splitlines() and printed.err == ""
    namespace: dict[str, object] = {"__name__": "first_robot"}
    for text in blocks(page, "python"):
        exec(compile(text, page.name, "exec"), namespace)
    assert capsys.readouterr().out.startswith("[3 1 3] [1.12")
    files[1].write_text(files[1].read_text("utf-8").replace("tension_min = 1.0", "max_tension = 40.0"), "utf-8")
    with pytest.raises(ConfigError) as caught:
        read_plan(files[1].read_text(), files[1])
    assert line == f"cspr: {str(caught.value).replace(str(files[1]), 'hall_plan.toml')}\n"


@pytest.mark.prose
def test_sources_are_named_as_what_they_are():
    texts = [
        path for folder in ("cspr_jax", "docs", "sweeps", "tests", "benchmarks") for path in (ROOT / folder).rglob("*")
    ]
    texts = [path for path in [*texts, *PAGES] if path.suffix in (".md", ".py", ".toml")]
    word = re.compile("the " + "seeds")
    assert [str(path) for path in texts if word.search(path.read_text("utf-8").lower())] == []


def test_files_in_sweeps_are_read():
    for path in sorted((ROOT / "sweeps").rglob("*.toml")):
        if {"pose", "path"} & set(read_toml(path)):
            assert len(checked(PlanFile, read_toml(path), path).pose) > 1
        elif "objective" in read_toml(path):
            assert read_design(path)[0].objective
        else:
            assert read_sweep(path).grid.n_cells > 0


@pytest.mark.prose
def test_pages_of_commands_and_functions_are_generated():
    text = (ROOT / "docs" / "command_line.md").read_text("utf-8")
    assert script("generate_command_line").page_text() == text, "call `make docs`"
    assert all(f"## cspr {row.name}\n" in text for row in cli.COMMANDS)
    assert all(f"\n## {name}\n" in texts()[BUILT / "api.md"] for name in cspr_jax.__all__)


@pytest.mark.prose
def test_pages_that_are_read_first_stay_short():
    """And the film of the README loads at once."""
    lines = {name: len((ROOT / name).read_text("utf-8").splitlines()) for name in ("README.md", "docs/performance.md")}
    assert lines["README.md"] <= 80 and lines["docs/performance.md"] <= 150
    assert (ROOT / "docs" / "images" / "swing.gif").stat().st_size < 2_000_000


@pytest.mark.prose
def test_every_kind_of_map_has_its_page():
    assert set(script("generate_maps").PAGES) == set(MAP_KINDS)
    assert all(f'map = "{name}"' in texts()[BUILT / "maps" / f"{name}.md"] for name in MAP_KINDS)


@pytest.mark.thorough
def test_the_page_of_accuracy_shows_what_is_computed():
    """The numbers that are stored are those of the program, and every table is there."""
    accuracy, text = script("generate_accuracy"), texts()[BUILT / "accuracy.md"]
    for name in ("2.1", "4.1"):
        assert accuracy.section(name, accuracy.record(name, cspr_jax.table(name))) in text
    assert re.findall(r"^## Table (\S+)$", text, re.MULTILINE) == [each for each in tables.TABLES if each != "peers"]


@pytest.mark.prose
def test_the_reference_is_generated():
    text = script("generate_reference").reference_text()
    assert text == (ROOT / "docs" / "reference.md").read_text("utf-8"), "call `make docs`"
    wanted = [*QUANTITIES, "schema", "from_x", "cable_speed_max", "epsilon", "z_axis", "max_arcs", "samples", "tile"]
    assert all(f"`{name}`" in text for name in wanted)


@pytest.mark.prose
def test_every_picture_has_its_commands():
    """None is left of an older way to make it, and the README gives the arguments that made those it shows."""
    images = script("make_images")
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} == {
        f"{name}{image.suffix}" for name, image in images.IMAGES.items()
    }
    text = "\n".join((ROOT / name).read_text("utf-8") for name in ("README.md", "docs/usage.md"))
    shown = re.findall(r"!\[[^]]*\]\((?:docs/)?images/(\w+)\.png\)\n\n\*(.*?)\*\n\n", text, re.DOTALL)
    assert len(shown) >= 3
    for name, caption in shown:
        image = images.IMAGES[name]
        run, plot = (shlex.split(words)[1:] for words in re.findall(r"`(cspr (?:run|plot) [^`]*)`", caption))
        assert cli._parser().parse_args(run).sweep == Path(f"sweeps/{(image.sources or (name,))[0]}.toml")
        drawn, wanted = cli._parser().parse_args(plot), cli._parser().parse_args(["plot", "x", *image.plot.split()])
        assert drawn.result[0].parent == cli._parser().parse_args(run).output
        assert {**vars(drawn), "result": 0} == {**vars(wanted), "result": 0}, name


def long_lines(text: str) -> list[str]:
    """Lines of prose above `COLUMNS`: without code blocks and tables, and with links counted without their targets."""
    lines = [re.sub(r"\]\([^)\s]+\)", "]", line) for line in FENCE.sub("", text).splitlines()]
    return [line for line in lines if len(line) > COLUMNS and not line.startswith("|")]


@pytest.mark.prose
def test_prose_is_wrapped():
    assert {page: lines for page in PAGES if (lines := long_lines(page.read_text("utf-8")))} == {}


@pytest.mark.prose
def test_long_lines_of_prose_are_noticed():
    long = "word " * COLUMNS
    text = f"# Page\n\n| {long} |\n\n```sh\n{long}\n```\n\n[short]({'x' * COLUMNS})\n\n- {long}\n"
    assert long_lines(text) == [f"- {long}"]


@pytest.mark.prose
def test_links_lead_somewhere():
    """In a checkout, where pages that are built with the site are not there, and in these pages."""
    known = {*texts(), BUILT / "rates.png"}
    for page, text in texts().items():
        for target in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", text)):
            if re.match(r"[a-z]+://|mailto:", target):
                continue
            name, _, anchor = target.partition("#")
            path = Path(os.path.normpath(page.parent / name)) if name else page
            assert path in known or (path.is_relative_to(ROOT) and path.exists()), (page, target)
            assert page.is_relative_to(BUILT) or not path.is_relative_to(BUILT), (page, target)
            if anchor:
                heads = re.findall(r"^#+ (.*)$", texts()[path], re.MULTILINE)
                slugs = [re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads]
                assert anchor in slugs, (page, target)


@pytest.mark.prose
def test_what_the_readme_names_is_there():
    names = ("README.md", "docs/usage.md", "docs/comparisons.md", "docs/limits_of_the_program.md")
    text = "\n".join((ROOT / name).read_text("utf-8") for name in names)
    named = re.findall(r"\b(?:tests|docs|sweeps|benchmarks)/[\w/-]+(?:\.\w+)?", text)
    assert len(named) > 5 and all((ROOT / name).exists() for name in named)
    assert not re.search(r"@[A-Z0-9]+@", text), "a number that was never filled in"


@pytest.mark.prose
def test_modules_that_documents_name_exist():
    """Names such as `families.platforms.orientations.accessible` end a module's path, or name what a module holds."""
    modules = {
        "." + ".".join(path.relative_to(ROOT / "cspr_jax").with_suffix("").parts).removesuffix(".__init__"): path
        for path in (ROOT / "cspr_jax").rglob("*.py")
    }
    folders = {part for name in modules for part in name.split(".")}
    pages = [
        ROOT / "docs" / f"{name}.md" for name in ("architecture", "add_family", "add_map", "reliability", "theory")
    ]
    missing, count = [], 0
    for page in [*pages, *(ROOT / "docs" / "theory").glob("*.md")]:
        for name in re.findall(r"`((?:[a-z_0-9]+\.)+\w+)`", page.read_text("utf-8")):
            head, _, last = name.rpartition(".")
            if name.split(".")[0] not in folders or last in ("toml", "md", "py"):
                continue
            count += 1
            holders = [path for module, path in modules.items() if module.endswith(f".{head}")]
            is_module = any(module.endswith(f".{name}") for module in modules)
            if not is_module and not any(re.search(rf"\b{last}\b", path.read_text("utf-8")) for path in holders):
                missing.append((page.name, name))
    assert count > 50 and missing == []

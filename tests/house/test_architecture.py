"""The shape of the package: layers, what may import what, sizes, docstrings, no paths of one machine."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "cspr_jax"

# From the bottom up, as docs/architecture.md draws them. A room is a folder, or a loose module, with all that is in it
# and has no floor of its own. A room imports from the floors below it alone; within it, too, imports lead one way.
FLOORS = (
    ("errors", "numerics", "certificate_checker"),
    ("schema", "runtime", "robots"),
    ("config",),
    ("motion", "store"),
    ("verification", "build"),
    ("launch", "maps", "curves"),
    ("workspaces",),
    ("families",),
    ("machine",),
    ("plans", "sweep", "bench"),
    ("synthesis",),
    ("outputs",),
    ("published", "outputs.plots"),
    ("api",),
    ("cli",),
    ("__main__",),
)
ROOMS = [room for floor in FLOORS for room in floor]
# Families import nothing of each other: what two of them need lies below. Poses at rest are asked about by platforms.
FAMILIES = ("swings", "lines", "beziers", "platforms", "splines", "ellipses", "paths", "free")
FAMILIES = tuple(f"families.{name}" for name in FAMILIES)
KERNELS = (
    "errors",
    "numerics",
    "schema",
    "robots",
    "motion",
    "verification",
    "launch",
    "curves",
    "workspaces",
    "families",
    "machine",
)
# What a folder is about, what it rests on, and its files in the order in which they are read, stand in its guide.
GUIDES = ("motion", "verification", "launch", "curves", "workspaces", "machine", "synthesis", *FAMILIES)
# Tables of rows: to split one hides rows and shortens nothing. They may have more than 400 lines.
TABLES = ("schema.map_kinds", "schema.quantities")
LARGEST_FOLDER = 16
# Folders, all of them, and modules that never import jax.
WITHOUT_JAX = (
    "api.files.listings",
    "api.files.pictures",
    "api.certificates",
    "api.sweeps",
    "certificate_checker",
    "numerics.linear.frames",
    "cli",
    "config",
    "errors",
    "outputs.plots.draw",
    "runtime.exact_arithmetic",
    "runtime.progress",
    "runtime.stages",
    "schema",
    "store",
    "sweep.checks",
    "sweep.claims",
    "sweep.definition",
    "sweep.engine",
    "sweep.environment",
    "sweep.inspection",
    "sweep.signals",
    "sweep.work",
)
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def _name(path: Path) -> str:
    """Module name below cspr_jax; "" for the package itself."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip(".")


MODULES = {_name(path): ast.parse(path.read_text("utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
PACKAGES = {_name(path.parent / "__init__.py") for path in PACKAGE.rglob("*.py")}
INNER = [name for name, tree in MODULES.items() if name and not (name in PACKAGES and len(tree.body) == 1)]


def _room(name: str) -> str | None:
    """Room of a module: the longest name of a room that it begins with."""
    parts = name.split(".")
    names = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((name for name in names if name in FLOOR_OF), None)


def _imports(tree: ast.AST) -> Iterator[str]:
    """Everything imported anywhere in a module, dotted, from "import a" and "from a import b"."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _inner_imports(name: str) -> set[str]:
    """Modules of the package that a module imports; `__version__` is the package's own."""
    found = set()
    for target in _imports(MODULES[name]):
        if target.split(".")[0] == "cspr_jax" and target != "cspr_jax.__version__":
            inner = target.removeprefix("cspr_jax").removeprefix(".")
            found.add(inner if inner in MODULES else inner.rpartition(".")[0])
    return found


def _functions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def _parts(folder: str) -> dict[str, list[str]]:
    """Modules of each file and folder right below a folder, by its name."""
    found: dict[str, list[str]] = {}
    for name in INNER:
        if name.startswith(f"{folder}.") and not (name in PACKAGES and len(MODULES[name].body) == 1):
            found.setdefault(".".join(name.split(".")[: folder.count(".") + 2]), []).append(name)
    return found


def test_every_module_has_a_room():
    assert [name for name in INNER if _room(name) is None] == []
    assert {_room(name) for name in INNER} == set(ROOMS)
    loose = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    folders = {name for name in PACKAGES if name and "." not in name}
    assert folders | loose == {room.partition(".")[0] for room in ROOMS}


def test_folders_are_short():
    files = {folder: [name for name in INNER if name.rpartition(".")[0] == folder] for folder in PACKAGES - {""}}
    assert {folder: len(names) for folder, names in files.items() if len(names) > LARGEST_FOLDER} == {}


def test_tests_lie_in_folders_like_those_of_the_package():
    """Beside what they share, and what belongs to no folder."""
    shared = {"derivatives", "house", "oracles", "properties", "reliability", "support"}
    folders = {path.parent.relative_to(ROOT / "tests").parts[0] for path in (ROOT / "tests").glob("*/*.py")}
    assert folders - shared <= {name.rpartition(".")[2] for name in PACKAGES}
    assert not list((ROOT / "tests").glob("test_*.py"))


def test_the_house_stays_small():
    loose = {path.stem for path in PACKAGE.glob("*.py")}
    assert loose <= {"__init__", "__main__", "cli", "api", "errors"}
    assert len(ROOMS) <= 27
    assert len(FLOORS) <= 16


def test_imports_point_down():
    upward = []
    for name in INNER:
        own = _room(name)
        rooms = {_room(target) for target in _inner_imports(name)} - {own}
        upward += [(name, room) for room in rooms if room is None or FLOOR_OF[room] >= FLOOR_OF[own]]
    assert upward == []


def _is_ordered(imports: dict[str, set[str]]) -> bool:
    """Whether names can be read one after the other, each after those that it imports."""
    left = dict(imports)
    while left:
        free = [name for name, targets in left.items() if not targets & left.keys()]
        if not free:
            return False
        for name in free:
            del left[name]
    return True


def test_imports_have_no_cycle():
    """Neither modules, nor the files and folders of any folder."""
    assert _is_ordered({name: _inner_imports(name) - {name} for name in INNER})
    for folder in PACKAGES - {""}:
        parts = _parts(folder)
        owners = {name: part for part, names in parts.items() for name in names}
        imports = {part: set().union(*map(_inner_imports, names)) for part, names in parts.items()}
        assert _is_ordered({p: {owners[t] for t in targets if t in owners} - {p} for p, targets in imports.items()}), (
            folder
        )


def test_families_import_nothing_of_each_other():
    for family in FAMILIES:
        own = [name for name in INNER if name.startswith(f"{family}.")]
        others = {target for name in own for target in _inner_imports(name) if target.startswith("families.")} - set(
            own
        )
        assert others == set(), family


def test_a_guide_names_the_files_of_a_room_in_reading_order():
    """Of a room and of each folder in it: each file or folder once, and none before what it imports."""
    folders = [name for name in PACKAGES for room in GUIDES if name == room or name.startswith(f"{room}.")]
    misplaced = []
    for folder in folders:
        parts, above = _parts(folder), set()
        lines = ast.get_docstring(MODULES[folder]).splitlines()
        listed = [f"{folder}.{line.split()[0]}" for line in lines if re.match(r" {4}\w+ {2,}\S", line)]
        assert sorted(listed) == sorted(parts), folder
        for part in listed:
            above |= set(parts[part])
            targets = set().union(*map(_inner_imports, parts[part])) - above
            misplaced += [(part, target) for target in targets if target.startswith(f"{folder}.")]
    assert misplaced == []


def test_kernels_know_no_files_and_pictures():
    heavy = {"h5py", "matplotlib", "rich", "pydantic", "argparse", "tomllib"}
    kernels = [name for name in INNER if _room(name) in KERNELS]
    assert [name for name in kernels if heavy & {t.split(".")[0] for t in _imports(MODULES[name])}] == []


def test_no_compiled_function_calls_lapack():
    """Batches of them can wait for ever for their own threads in jaxlib 0.10; see `numerics.elementary.solved`."""
    calls = re.compile(r"jnp\.linalg\.(?!norm\b)|jax\.scipy\.linalg|lax\.linalg")
    assert [path.name for path in PACKAGE.rglob("*.py") if calls.search(path.read_text("utf-8"))] == []


def test_no_minimum_leaves_nan_out():
    """Nor maximum: bounds that do not exist are NaN; see `numerics.elementary.minimum_of`."""
    calls = re.compile(r"jnp\.(a?min|a?max|nanmin|nanmax)\(")
    names = {path.name for path in PACKAGE.rglob("*.py") if calls.search(path.read_text("utf-8"))}
    # The search for path accelerations compares values with their minima, bit for bit; its motions are proved.
    assert names == {"elementary.py", "controllable.py"}


def test_files_side_loads_no_jax_and_the_command_line_nothing_heavy():
    without_jax = [name for name in INNER if name.startswith(tuple(f"{room}." for room in WITHOUT_JAX))]
    without_jax += [name for name in WITHOUT_JAX if name in INNER]
    code = f"""
import importlib, sys
import cspr_jax
import cspr_jax.cli
def loaded(*names):
    return [name for name in names if name in sys.modules]
found = loaded("jax", "h5py", "matplotlib", "pydantic", "numpy", "rich")
try:
    cspr_jax.cli.main(["--help"])
except SystemExit:
    found += loaded("jax", "h5py", "matplotlib", "pydantic", "numpy", "rich")
for name in {without_jax!r}:
    importlib.import_module("cspr_jax." + name)
    found += [name for _ in loaded("jax")]
print("found:", found)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "found: []"


def test_lists_and_templates_load_no_jax(tmp_path):
    """Nor what else takes long to load; the folder of a run is none here."""
    commands = [["robots"], ["robots", "prototype"], ["examples"], ["quantities"], ["status", str(tmp_path)]]
    commands += [["new", kind, str(tmp_path / f"{kind}.toml")] for kind in ("robot", "sweep", "plan")]
    code = f"""
import sys
from cspr_jax.cli import main
codes = [main(words) for words in {commands}]
print("found:", codes, [name for name in ("jax", "scipy", "matplotlib", "distributed") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "found: [0, 0, 0, 0, 4, 0, 0, 0] []"


@pytest.mark.quick("plan-174")
@pytest.mark.parametrize(("name", "most"), [("workspace", 74), ("minimum_arcs", 123), ("plan", 174)])
def test_a_function_imports_what_it_is_about(name, most):
    """So many modules at most, and no proofs of platforms: a program that asks about a point mass starts sooner.

    Nor pieces of SciPy, which take 0.2 s; jax loads no more of SciPy than its name.
    """
    code = f"import sys, cspr_jax; cspr_jax.{name}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    own = {module.removeprefix("cspr_jax.") for module in loaded if module.startswith("cspr_jax.")}
    assert len(own - PACKAGES) <= most
    assert [module for module in own if "six_cable_proof" in module] == []
    pieces = {f"scipy.{piece}" for piece in ("linalg", "spatial", "special", "interpolate", "optimize")}
    assert name != "plan" or not pieces & loaded


def _length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines without the docstring."""
    length = function.end_lineno - function.lineno + 1
    if ast.get_docstring(function) is not None:
        length -= function.body[0].end_lineno - function.body[0].lineno + 1
    return length


def test_sizes():
    paths = {_name(path): path for path in PACKAGE.rglob("*.py")}
    lines = {name: len(path.read_text("utf-8").splitlines()) for name, path in paths.items()}
    assert {name: count for name, count in lines.items() if count > 400 and name not in TABLES} == {}
    lengths = {(name, f.name): _length(f) for name, tree in MODULES.items() for f in _functions(tree)}
    assert {place: length for place, length in lengths.items() if length > 60} == {}


def test_no_assert_and_no_print():
    nodes = [(name, node) for name, tree in MODULES.items() for node in ast.walk(tree)]
    assert [(name, node.lineno) for name, node in nodes if isinstance(node, ast.Assert)] == []
    calls = [(name, node) for name, node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    assert [(name, node.lineno) for name, node in calls if node.func.id == "print"] == []


def _public(tree: ast.Module) -> Iterator[tuple[ast.AST, bool]]:
    """Public functions and classes of a module, methods with True; not the arithmetic of a class on itself."""
    for node in tree.body:
        decorators = [ast.unparse(decorator) for decorator in getattr(node, "decorator_list", ())]
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_" and "overload" not in decorators:
            yield node, False
            if isinstance(node, ast.ClassDef):
                methods = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name[0] != "_"]
                yield from ((n, True) for n in methods if getattr(n.returns, "value", None) != node.name)


def _exports() -> set[tuple[str, str]]:
    """Module and name of what the package exports, and of what an exported function of `api` is another name of."""
    lists = [node.value for node in MODULES[""].body if isinstance(node, ast.Assign)]
    modules = next(ast.literal_eval(value) for value in lists if isinstance(value, ast.Dict))
    found = {(module, name) for name, module in modules.items()}
    for module in set(modules.values()):
        body = MODULES[module].body
        calls = [node.value for node in body if isinstance(getattr(node, "value", None), ast.Call)]
        wrapped = {ast.unparse(call.args[0]) for call in calls if call.args}
        imports = [node for node in body if isinstance(node, ast.ImportFrom)]
        inner = [(node.module.removeprefix("cspr_jax."), alias) for node in imports for alias in node.names]
        found |= {(module, alias.name) for module, alias in inner if alias.asname in wrapped}
    return found


def _answers(node: ast.AST) -> bool:
    """Whether a function returns or yields a value, those inside it left out."""
    if isinstance(node, ast.Return | ast.Yield | ast.YieldFrom):
        return node.value is not None
    inner = (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.FunctionDef | ast.Lambda))
    return any(_answers(child) for child in inner)


# Types whose values have shapes or units.
NUMBERS = re.compile(r"\b(Array|ndarray|ArrayLike|float)\b")


def _missing_parts(function: ast.FunctionDef, is_method: bool) -> list[str]:
    """Sections, and parameters with shapes or units, that a Google-style docstring lacks."""
    text = ast.get_docstring(function) or ""
    given = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs][is_method:]
    numbers = [arg.arg for arg in given if arg.annotation and NUMBERS.search(ast.unparse(arg.annotation))]
    missing = [name for name in numbers if not re.search(rf"^Args:\n(.*\n)*? +{name}: ", text, re.M)]
    is_property = any(ast.unparse(d).endswith("property") for d in function.decorator_list)
    if _answers(function) and not is_property and not re.search(r"^(Returns|Yields):", text, re.M):
        missing.append("Returns")
    return missing


def _is_longer_than_its_function(function: ast.FunctionDef) -> bool:
    text = function.body[0]
    length = text.end_lineno - text.lineno + 1
    return 2 * length > function.end_lineno - function.lineno + 1


@pytest.mark.prose
def test_docstrings():
    """Whole ones of what is exported and of protocols; elsewhere none is longer than its function."""
    missing, long, exports = [], [], _exports()
    for name, tree in MODULES.items():
        missing += [name] * (ast.get_docstring(tree) is None)
        protocols = [
            node for node in tree.body if isinstance(node, ast.ClassDef) and "Protocol" in map(ast.unparse, node.bases)
        ]
        whole = {method for node in protocols for method in node.body}
        whole |= {node for node in tree.body if (name, getattr(node, "name", "")) in exports}
        for node, is_method in _public(tree):
            missing += [f"{name}.{node.name}"] * (ast.get_docstring(node) is None)
            if node in whole and isinstance(node, ast.FunctionDef):
                missing += [f"{name}.{node.name}: {part}" for part in _missing_parts(node, is_method)]
        if not name.startswith("api."):
            others = [
                function for function in _functions(tree) if ast.get_docstring(function) and function not in whole
            ]
            long += [f"{name}.{function.name}" for function in others if _is_longer_than_its_function(function)]
    assert (missing, long) == ([], [])


def test_nothing_names_a_machine_or_the_shared_folder():
    """Neither code, docs nor data hold a path of the machine they were made on."""
    folders = ("cspr_jax", "tests", "docs", "sweeps", "benchmarks", ".ci", "results/reference")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()]
    files += [path for path in ROOT.iterdir() if path.suffix in ("", ".md", ".toml") and path.is_file()]
    files = [path for path in files if path.name != ".git"]  # of a second work tree
    assert len(files) > 50
    pattern = re.compile(rb"(?<![\w.])/(work|tmp|root|home)/" + rb"|\.\./" + rb"shared/|shared" + rb"/notes")
    named = [str(path) for path in files if "__pycache__" not in path.parts and pattern.search(path.read_bytes())]
    assert named == []

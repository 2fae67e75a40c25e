"""Import arrows go one way; what must not be in the package is not."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from pkgutil import iter_modules

import pytest

from cvxlimit import extensions
from cvxlimit.base.doors import loaded
from cvxlimit.offered import OFFERED

SOURCE = Path(__file__).parents[2] / "src" / "cvxlimit"

LAYERS = (
    {"errors"},
    {"base"},
    {"geometry"},
    {"scene", "solvers"},
    {"surroundings"},
    {"masonry", "surfaces"},
    {"solution"},
    {"model"},
    {"proof"},
    {"reductions"},
    {"readings"},
    {"methods"},
    {"problem"},
    {"results"},
    {"io"},
    {"plotting", "proving"},
    {"cli"},
    {"extensions"},
    {"compare", "studies"},
    {"offered"},
    {"__init__", "__main__"},
)
"""Rooms, lowest first: each sees lower ones only. Give a new one its place. All below
``extensions`` are the core; ``compare`` and ``studies`` are names that users know extensions by."""

CORE = {name for names in LAYERS[: [*LAYERS].index({"extensions"})] for name in names}

DESK = {"surroundings", "masonry", "results", "io", "plotting", "proving", "cli"}
"""Rooms of the core that a load factor with a bracket does without: what builds scenes, reads
files and results, draws and prints. The others are the first floor (CONTRIBUTING.md)."""

OUTSIDE = {"errors", "base", "geometry", "scene", "solution"}
"""All that files and pictures see besides themselves; pictures also see what is read off
solutions, and which scene a result is of."""

OWN_PICKLES = {"base.search"}
"""Pickles that never leave the program: tasks for its own processes."""


NAMES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts): path
    for path in sorted(SOURCE.rglob("*.py"))
}
"""Every module by dotted name below cvxlimit; packages end in __init__."""

FOLDERS = sorted({name.rpartition(".")[0] for name in NAMES})


@cache
def found_in(name: str) -> tuple[ast.Import | ast.ImportFrom | ast.Call, ...]:
    """Imports and calls of a module, wherever in its text."""
    tree = ast.parse(NAMES[name].read_text("utf-8"))
    kinds = (ast.Import, ast.ImportFrom, ast.Call)
    return tuple(node for node in ast.walk(tree) if isinstance(node, kinds))


def imported(name: str) -> Iterator[str]:
    """Modules of the package that a module imports."""
    for node in found_in(name):
        yield from _imported_by(name, node)


def _imported_by(name: str, node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (resolved(a.name, None) for a in node.names if inside(a.name))
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, f"{name} imports relatively in line {node.lineno}"
        if inside(node.module or ""):
            yield from (resolved(node.module or "", a.name) for a in node.names)


def inside(module: str) -> bool:
    return module.split(".")[0] == "cvxlimit"


def resolved(module: str, member: str | None) -> str:
    """The module below cvxlimit that ``from module import member`` loads."""
    below = module.split(".")[1:]
    for parts in ([*below, member or ""], [*below, member or "", "__init__"], below):
        if ".".join(parts) in NAMES:
            return ".".join(parts)
    return ".".join([*below, "__init__"])


def layer(module: str) -> int:
    top = module.split(".")[0]
    found = [i for i, names in enumerate(LAYERS) if top in names]
    assert found, f"{module} has no place in LAYERS yet: give it one"
    return found[0]


@pytest.mark.parametrize("name", NAMES)
def test_arrows_point_downward(name: str) -> None:
    top = name.split(".")[0]
    upward = [m for m in imported(name) if m.split(".")[0] != top and layer(m) >= layer(name)]
    assert not upward, f"{name} imports {upward}, which are not below it"


def test_no_cycles() -> None:
    """Packages count with all their modules: a module may not import its own package."""
    graph = {name: set(imported(name)) for name in NAMES if name != "__init__"}
    assert cycle(graph) == []


def cycle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle; empty if there are none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@cache
def among_neighbours() -> dict[str, dict[str, set[str]]]:
    """By folder: which of its files and folders import which others of them."""
    found: dict[str, dict[str, set[str]]] = {}
    for name in NAMES:
        for other in imported(name):
            one, two = name.split("."), other.split(".")
            pairs = zip(one, two, strict=False)
            shared = next((i for i, (a, b) in enumerate(pairs) if a != b), None)
            if shared is not None:
                below = found.setdefault(".".join(one[:shared]), {})
                below.setdefault(one[shared], set()).add(two[shared])
    return found


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_circle_among_the_files_and_folders_of_a_folder(folder: str) -> None:
    """A folder counts as one, with all that is in it."""
    assert cycle(among_neighbours().get(folder, {})) == []


@pytest.mark.parametrize("name", [n for n in NAMES if n.split(".")[0] in ("io", "plotting")])
def test_files_and_pictures_see_scenes_and_solutions_only(name: str) -> None:
    own = name.split(".")[0]
    allowed = OUTSIDE | {own} | ({"results"} if own == "plotting" else set())
    seen = {m.split(".")[0] for m in imported(name) if m != "io.scenes"}
    assert seen <= allowed, f"{name} imports {sorted(seen - allowed)}"


def extension_of(module: str) -> str:
    """The extension that a module is in; empty for one of the core."""
    room, _, rest = module.partition(".")
    return rest.split(".")[0] if room == "extensions" else ""


def mentioned(name: str) -> set[str]:
    """What a module imports, wherever in its text, or names in a string that could be imported."""
    tree = ast.parse(NAMES[name].read_text("utf-8"))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    told = {id(n.body[0].value) for n in ast.walk(tree) if isinstance(n, documented) and n.body
            and isinstance(n.body[0], ast.Expr)}  # fmt: skip
    texts = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told
    }
    places = re.findall(r"\bcvxlimit\.([\w.]+)", "\n".join(texts))
    return {*imported(name), *places}


@pytest.mark.parametrize("name", [n for n in NAMES if n.split(".")[0] in CORE])
def test_the_core_imports_no_extension(name: str) -> None:
    others = {m for m in mentioned(name) if extension_of(m) or m in ("compare", "studies")}
    assert not others, f"{name} knows {others}: put a door between"


@pytest.mark.parametrize("name", [n for n in NAMES if extension_of(n)])
def test_no_extension_imports_another(name: str) -> None:
    own = extension_of(name)
    others = {m for m in mentioned(name) if extension_of(m) not in ("", own)}
    assert not others, f"{name} knows {others}, of another extension: go through the core"


@pytest.mark.parametrize("name", [n for n in NAMES if n.split(".")[0] in CORE - DESK])
def test_the_first_floor_imports_nothing_of_the_desk(name: str) -> None:
    above = {m for m in imported(name) if m.split(".")[0] not in CORE - DESK}
    assert not above, f"{name} imports {sorted(above)}, of the desk"


def test_contributing_names_the_rooms_of_each_floor() -> None:
    page = (SOURCE.parents[1] / "CONTRIBUTING.md").read_text("utf-8")
    rows = re.findall(r"^\| \d\. .*$", page, re.MULTILINE)
    for row, rooms in zip(rows[:2], (CORE - DESK - {"errors"}, DESK), strict=True):
        assert rooms <= {*re.findall(r"`(\w+)`", row)}


def test_what_is_offered_is_there() -> None:
    """Every table names what can be loaded, and what an extension offers is its own."""
    for group, places in OFFERED.items():
        for name, place in places.items():
            assert loaded(place) is not None, (group, name)
            assert not extension_of(place.removeprefix("cvxlimit."))
    for table, folder in zip(extensions.tables(), iter_modules(extensions.__path__), strict=True):
        names = {group: {*line.split()} for group, line in extensions.SHIPPED[folder.name].items()}
        assert names == {group: places.keys() for group, places in table.items()}, folder.name
        for group, places in table.items():
            for name, place in places.items():
                assert loaded(place) is not None, (group, name)
                assert extension_of(place.removeprefix("cvxlimit.")) == folder.name


def test_the_map_is_complete() -> None:
    """Every name in LAYERS exists, so that the list cannot rot."""
    tops = {name.split(".")[0] for name in NAMES}
    assert set().union(*LAYERS) == tops


@pytest.mark.parametrize("name", NAMES)
def test_nothing_that_runs_or_unpickles_text(name: str) -> None:
    """No star either, which hides what is imported."""
    calls, roots = set(), set()
    for node in found_in(name):
        if isinstance(node, ast.Call):
            calls |= {node.func.id} if isinstance(node.func, ast.Name) else set()
        elif isinstance(node, ast.Import):
            roots |= {alias.name.split(".")[0] for alias in node.names}
        else:
            roots |= {(node.module or "").split(".")[0]}
            assert "*" not in {alias.name for alias in node.names}, f"{name}:{node.lineno}"
    assert not calls & {"eval", "exec", "compile", "__import__", "print", "input", "breakpoint"}
    pickles = {"pickle", "marshal", "shelve", "dill", "cloudpickle"}
    assert name in OWN_PICKLES or not roots & pickles


def test_the_checks_can_fail() -> None:
    """The resolver sees submodules, packages and members."""
    assert resolved("cvxlimit.surfaces.base", "Norm") == "surfaces.base"
    assert resolved("cvxlimit.surfaces", "base") == "surfaces.base"
    assert resolved("cvxlimit.surfaces", "Cone") == "surfaces.__init__"
    assert resolved("cvxlimit", "scene") == "scene.__init__"
    assert resolved("cvxlimit", "masonry") == "masonry.__init__"
    assert "scene.__init__" in set(imported("model.statics"))
    assert layer("model.statics") > layer("scene")
    assert cycle({"scene": {"checks"}, "checks": {"errors"}, "errors": set()}) == []
    assert set(cycle({"scene": {"checks"}, "checks": {"scene"}})) == {"scene", "checks"}

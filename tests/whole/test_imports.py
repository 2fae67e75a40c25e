"""Import arrows go one way; what must not be in the package is not."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "cvxlimit"

LAYERS = (
    {"errors", "arrays"},
    {"checks", "extras", "files", "bracket", "markup", "versions", "progressbar"},
    {"strengths"},
    {"geometry"},
    {"loads", "ties"},
    {"scene", "solvers"},
    {"masonry", "surfaces", "joints"},
    {"solution"},
    {"model"},
    {"proof"},
    {"reductions"},
    {"methods"},
    {"io", "plotting"},
    {"frames"},
    {"compare", "studies"},
    {"cli"},
    {"__init__", "__main__"},
)
"""Modules and packages, lowest first: each sees lower layers only. Give a new one its place."""

OUTSIDE = {
    "arrays", "bracket", "loads", "scene", "ties", "solution", "geometry", "errors", "checks",
    "extras", "files", "strengths", "joints",
}  # fmt: skip
"""All that input, output and plotting may see besides themselves."""

STRENGTH = "plotting.strength"
"""Sees surfaces, readings of Eq. 30 and the state of least use: how much of its strength a contact
uses they say."""


OWN_PICKLES = {"methods.interaction.branching.workers", "studies.rows"}
"""Pickles that never leave the program: tasks for its own processes."""


def modules() -> dict[str, ast.Module]:
    """Syntax tree of every module by dotted name below cvxlimit; packages end in __init__."""
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts): ast.parse(path.read_text("utf-8"))
        for path in sorted(SOURCE.rglob("*.py"))
    }


TREES = modules()


CONVENIENCES = {
    "scene": (
        "plotting.__init__", "plotting.drawing", "plotting.notebook", "reductions.choice",
        "studies.domains.exploring",
    ),
    "solution": ("plotting.__init__", "plotting.notebook", "frames", "model.problem"),
    "model.problem": ("methods.modelling",),
}  # fmt: skip
"""Arrows that point up: methods that call what is above them, imported when they are called.

``scene.plot()`` and ``solution.to_dataframe()`` read better than functions of their own; nothing in
``scene`` and ``solution`` depends on them."""


def imported(name: str) -> Iterator[str]:
    """Modules of the package that a module imports, wherever in its text.

    Left out are :data:`CONVENIENCES`, unless they stand at the top of the module.
    """
    top = {id(node) for node in TREES[name].body}
    for node in ast.walk(TREES[name]):
        if id(node) not in top and name in CONVENIENCES:
            yield from (m for m in _imported_by(name, node) if m not in CONVENIENCES[name])
        else:
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
        if ".".join(parts) in TREES:
            return ".".join(parts)
    return ".".join([*below, "__init__"])


def layer(module: str) -> int:
    top = module.split(".")[0]
    found = [i for i, names in enumerate(LAYERS) if top in names]
    assert found, f"{module} has no place in LAYERS yet: give it one"
    return found[0]


INTERACTION = ("states", "readings", "relaxation", "restriction", "branching")
"""Folders of ``methods.interaction``, lowest first."""


@pytest.mark.parametrize("name", [n for n in TREES if n.startswith("methods.interaction.")])
def test_arrows_of_interaction_point_downward(name: str) -> None:
    folder = name.split(".")[2]
    seen = {m.split(".")[2] for m in imported(name) if m.startswith("methods.interaction.")}
    above = INTERACTION[INTERACTION.index(folder) + 1 :] if folder in INTERACTION else INTERACTION
    assert not seen.intersection(above), f"{name} imports {seen}, which are not below it"


@pytest.mark.parametrize("name", TREES)
def test_arrows_point_downward(name: str) -> None:
    top = name.split(".")[0]
    upward = [m for m in imported(name) if m.split(".")[0] != top and layer(m) >= layer(name)]
    assert not upward, f"{name} imports {upward}, which are not below it"


def test_no_cycles() -> None:
    """Packages count with all their modules: a module may not import its own package."""
    graph = {name: set(imported(name)) for name in TREES if name != "__init__"}
    assert cycle(graph) == []


def cycle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle; empty if there are none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@pytest.mark.parametrize("name", [n for n in TREES if n.split(".")[0] in ("io", "plotting")])
def test_files_and_pictures_see_scenes_and_solutions_only(name: str) -> None:
    own = name.split(".")[0]
    readings = ("methods.interaction.readings.", "methods.interaction.states.")
    seen = {m.split(".")[0] for m in imported(name) if not m.startswith(readings)} - {own}
    allowed = OUTSIDE | {"surfaces", "model"} if name == STRENGTH else OUTSIDE
    if name != STRENGTH:
        seen |= {"methods" for m in imported(name) if m.startswith("methods.")}
    assert seen <= allowed, f"{name} imports {sorted(seen - allowed)}"


def test_the_map_is_complete() -> None:
    """Every name in LAYERS exists, so that the list cannot rot."""
    tops = {name.split(".")[0] for name in TREES}
    assert set().union(*LAYERS) == tops


@pytest.mark.parametrize("name", TREES)
def test_nothing_that_runs_or_unpickles_text(name: str) -> None:
    calls = {
        node.func.id
        for node in ast.walk(TREES[name])
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert not calls & {"eval", "exec", "compile", "__import__", "print", "input", "breakpoint"}


@pytest.mark.parametrize("name", sorted(TREES.keys() - OWN_PICKLES))
def test_no_pickle_and_no_star(name: str) -> None:
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Import):
            roots = {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots = {(node.module or "").split(".")[0]}
            assert "*" not in {alias.name for alias in node.names}, f"{name}:{node.lineno}"
        else:
            continue
        assert not roots & {"pickle", "marshal", "shelve", "dill", "cloudpickle"}


def test_the_checks_can_fail() -> None:
    """The resolver sees submodules, packages and members."""
    assert resolved("cvxlimit.surfaces.base", "Norm") == "surfaces.base"
    assert resolved("cvxlimit.surfaces", "base") == "surfaces.base"
    assert resolved("cvxlimit.surfaces", "Cone") == "surfaces.__init__"
    assert resolved("cvxlimit", "scene") == "scene"
    assert resolved("cvxlimit", "masonry") == "masonry.__init__"
    assert "scene" in set(imported("model.statics"))
    assert layer("model.statics") > layer("scene")
    assert cycle({"scene": {"checks"}, "checks": {"errors"}, "errors": set()}) == []
    assert set(cycle({"scene": {"checks"}, "checks": {"scene"}})) == {"scene", "checks"}

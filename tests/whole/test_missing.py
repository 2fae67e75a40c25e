"""What is asked for of an extension that is left out: one sentence that names it, of a class of its
own, on which alone tests are skipped. Run with nothing left out, and by ``.ci/without.py`` without
each."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

import cvxlimit
from cvxlimit import Block, Load, Scene, prove, solve
from cvxlimit.base import doors
from cvxlimit.base.doors import Door
from cvxlimit.cli.main import run
from cvxlimit.errors import MissingExtension, ModelError
from cvxlimit.extensions import SHIPPED, here
from cvxlimit.io import write_scene

OFFERED = [
    (extension, group, name)
    for extension, groups in SHIPPED.items()
    for group, line in groups.items()
    for name in line.split()
]
GONE = SHIPPED.keys() - here()
SENTENCE = r"is of extension '\w+', which is not part of this installation: pip install"


@pytest.mark.parametrize(("extension", "group", "name"), OFFERED)
def test_every_name_is_there_or_its_extension_is_missing(
    extension: str, group: str, name: str
) -> None:
    """Without the extension this is skipped, so that skips are there to be counted."""
    assert (name in Door(group)) is (extension in here())
    assert Door(group)[name] is not None


def scene(angle: float, friction: float = 0.7, tilt: float = 0.0) -> Scene:
    """A slab on the ground, pushed into it at an angle from upright; tilted, it slides off."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    slab = Block.box("slab", (0, 0, 0), (1, 1, 0.3), density=20.0)
    ends = {30.0: (0.5, 0.0, -0.8660254), 90.0: (1.0, 0.0, 0.0)}
    dead = Load(gravity=(0, 0, -1), acceleration=(tilt, 0, 0))
    return Scene(
        [ground, slab], ["ground"], Load(acceleration=ends[angle]), dead, friction=friction
    )


PLAIN = {
    "slides": (scene(90.0), 0, "certified"),
    "rocks": (scene(90.0, 5.0), 0, "certified"),
    "presses itself": (scene(30.0), 3, "live load does no harm"),
    "cannot stand": (scene(90.0, 0.3, 0.5), 3, "dead load cannot stand"),
}


@pytest.mark.parametrize("name", PLAIN)
def test_plain_answers_are_the_same_without_any_extension(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, code, status = PLAIN[name]
    path = tmp_path / "scene.json"
    write_scene(given, path)
    assert solve(given).status == status
    page = ["--report", str(tmp_path / "a.html"), "--json", str(tmp_path / "a.json"), "--verbose"]
    assert run(["solve", str(path), *page]) == code
    out, err = capsys.readouterr()
    assert status in out
    assert "internal error" not in err
    report = "".join(line for line in out.splitlines() if line.startswith("report"))
    if name == "slides":  # where its number is, or what is missing for it
        sent = "extension 'incremental'" if "incremental" in GONE else "--method incremental"
        assert sent in report


@pytest.mark.parametrize(
    "words",
    [
        *(f"solve tuff-wall --method {name}" for name in ("certified", "zero-dilatancy")),
        "solve single-block --method zero-dilatancy --searches 1",
        "solve single-block --method certified --branching-seconds 1",
        "solve single-block --solver BLOCKWISE",
        "solve single-block --no-dilatancy --report {folder}/a.html",
        "shake single-block --acceleration 0.5 --duration 1",
        "compare single-block --models cvxlimit,zero-dilatancy --repeat 1",
        "export single-block --format mjcf --output {folder}/a.mjcf",
        "import {folder}/a.obj --output {folder}/a.json",
        "solve {folder}/a.obj",
        "prove {folder}/a.json",
        "explain tuff-wall",
        "scenes",
    ],
)
def test_no_command_ends_in_an_internal_error(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.obj", "a.json"):
        (tmp_path / name).write_text("{}")
    if not GONE and "solve tuff-wall --method" in words:
        pytest.skip("nothing is left out")
    code = run(words.format(folder=tmp_path).split())
    err = capsys.readouterr().err
    assert code != 1, err
    assert "Traceback" not in err
    if "of extension" in err:
        assert code == 2
        assert re.search(SENTENCE, err)
        assert err.count("\n") == 1


@pytest.mark.parametrize(
    "name", ["ZeroDilatancy", "shake", "paths", "sweep", "Certified", "compare"]
)
def test_public_names(name: str) -> None:
    """Skipped where its extension is missing, by what asking for it raises."""
    assert getattr(cvxlimit, name) is not None


def test_the_error_is_caught_by_who_caught_it_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(doors._ABSENT, ("cvxlimit.methods", "exotic"), "curious")
    with pytest.raises(MissingExtension, match=f"method 'exotic' {SENTENCE}") as caught:
        solve(scene(90.0), method="exotic")  # type: ignore[arg-type]
    assert isinstance(caught.value, ModelError)
    assert isinstance(caught.value, ModuleNotFoundError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.extension) == (str(caught.value), "curious")
    assert Door("cvxlimit.methods").get("exotic") is None
    assert "exotic" not in Door("cvxlimit.methods")


def test_options_pictures_and_proofs_of_what_is_left_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Said of the method, also where its options or a result of it come first."""
    for group in ("methods", "pictures"):
        monkeypatch.setitem(doors._ABSENT, (f"cvxlimit.{group}", "exotic"), "curious")
    for words in ("--method exotic --searches 1", "--plot exotic:a.png"):
        assert run(["solve", "single-block", *words.split()]) == 2
        assert re.search(rf"'exotic' {SENTENCE}", capsys.readouterr().err)
    with pytest.raises(MissingExtension, match="method 'exotic'"):
        prove(replace(solve(scene(90.0)), flow="exotic"))
    assert run(["solve", "single-block", "--searches", "1", "--ratio", "0.1"]) == 2
    assert "no method here takes --searches and --ratio" in capsys.readouterr().err


@pytest.fixture
def conftest(request: pytest.FixtureRequest) -> ModuleType:
    """The module of all tests, as pytest has it."""
    plugins = request.config.pluginmanager.get_plugins()
    found = [plugin for plugin in plugins if hasattr(plugin, "pytest_runtest_call")]
    return next(plugin for plugin in found if hasattr(plugin, "MISSING"))


MISSPELT = (
    AttributeError("'Scene' object has no attribute 'blokcs'"),
    AttributeError("module 'cvxlimit.extensions' has no attribute 'patsh'"),
    ImportError("cannot import name 'shaek' from 'cvxlimit.errors'"),
    ModelError("method must be one of convex, exact, got 'certfied'"),
    ModelError("no solver asked for can solve this"),
    ModuleNotFoundError("No module named 'cvxlimit.extensions.dilatnacy'"),
    MissingExtension("of an extension that is here", "interaction-that-is-not"),
)


@pytest.mark.parametrize("error", MISSPELT, ids=lambda error: str(error)[:40])
def test_mistakes_are_not_skipped(
    error: Exception, conftest: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is missing: a misspelling in the package is an error, not something left out."""
    monkeypatch.setattr(conftest, "MISSING", {"dynamics"})
    call = conftest.pytest_runtest_call()
    next(call)
    with pytest.raises(type(error)):
        call.throw(error)


def test_what_is_left_out_is_skipped(conftest: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conftest, "MISSING", {"dynamics"})
    call = conftest.pytest_runtest_call()
    next(call)
    with pytest.raises(pytest.skip.Exception, match="command 'shake' is of extension"):
        call.throw(MissingExtension.of("command 'shake'", "dynamics"))

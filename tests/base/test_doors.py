"""Another distribution adds methods, surfaces, formats, pictures and commands by entry points."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, distribution, entry_points
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import builtin_scene, solve
from cvxlimit.base import doors
from cvxlimit.base.doors import Door
from cvxlimit.cli.main import _LOADED, COMMANDS, app, run
from cvxlimit.errors import ModelError
from cvxlimit.io import export
from cvxlimit.io.exporting import EXPORTS
from cvxlimit.methods.solving import TABLE
from cvxlimit.plotting import PICTURES
from cvxlimit.surfaces import Facets, Rocking, TorsionShear
from cvxlimit.surfaces.coulomb import SURFACES

ANOTHER = Path(__file__).parents[1] / "kit" / "another"
GROUPS = ("methods", "surfaces", "readers", "writers", "pictures", "commands")


@pytest.fixture
def another(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package of somebody else, as if it were installed, and forgotten afterwards."""
    monkeypatch.syspath_prepend(str(ANOTHER))
    commands, known, pictures = [*app.registered_commands], {*_LOADED}, dict(PICTURES)
    yield
    app.registered_commands[:] = commands
    _LOADED.intersection_update(known)
    for name in PICTURES.keys() - pictures:
        del PICTURES[name]
    for door in (TABLE, SURFACES, EXPORTS, COMMANDS, PICTURES):
        door._found.clear()


@pytest.mark.usefixtures("another")
class TestAnotherPackage:
    def test_its_names_are_found(self) -> None:
        offered = {f"cvxlimit.{group}" for group in GROUPS}
        assert {entry.group for entry in distribution("cvxlimit-another").entry_points} == offered
        for group in offered:
            assert {entry.name for entry in entry_points(group=group)} <= {*Door(group).names}

    def test_a_method_and_a_surface(self) -> None:
        scene = builtin_scene("tuff-wall")
        expected = solve(scene, [Rocking(), TorsionShear(Facets.inscribed(12))]).load_factor
        for found in (solve(scene, method="dozen"), solve(scene, "dozen")):
            assert found.status == "certified"
            assert found.load_factor == pytest.approx(expected, rel=1e-5)
        with pytest.raises(ModelError, match=r"one of convex, .*dozen, got 'dozens'"):
            solve(scene, method="dozens")

    def test_a_format_there_and_back(self, tmp_path: Path) -> None:
        pytest.importorskip("cvxlimit.extensions.importing")
        from cvxlimit.io import read_bodies

        scene = builtin_scene("stack")
        (path,) = export(scene, tmp_path / "stack.boxes")
        for block, body in zip(scene.blocks, read_bodies(path), strict=True):
            assert body.name == block.id
            ends = block.vertices.min(axis=0), block.vertices.max(axis=0)
            assert np.array_equal(body.vertices, ends)

    def test_a_picture(self, tmp_path: Path) -> None:
        pytest.importorskip("matplotlib")
        path = tmp_path / "plan.png"
        solve(builtin_scene("single-block")).plot("plan", path)
        assert path.read_bytes().startswith(b"\x89PNG")

    def test_a_command(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["--help"]) == 0
        assert "cvxlimit blocks --help" in capsys.readouterr().out
        assert run(["blocks", "tuff-wall"]) == 0
        assert capsys.readouterr().out.strip() == str(len(builtin_scene("tuff-wall").blocks))

    def test_formats_on_the_command_line(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        pytest.importorskip("cvxlimit.extensions.importing")
        path = str(tmp_path / "stack.boxes")
        assert run(["export", "stack", "--format", "boxes", "--output", path]) == 0
        assert run(["solve", path]) == 2
        assert "this is geometry: cvxlimit import" in capsys.readouterr().err

    def test_what_cannot_be_imported_is_its_authors(self, monkeypatch: pytest.MonkeyPatch) -> None:
        (entry,) = (e for e in entry_points(group="cvxlimit.methods") if e.name == "dozen")
        broken = EntryPoint("dozen", "cvxlimit_another:Gone", entry.group)._for(entry.dist)
        monkeypatch.setattr(doors, "installed", lambda group: {"dozen": broken})
        with pytest.raises(ModelError, match=r"method 'dozen' of package 'cvxlimit.another' .*ask"):
            solve(builtin_scene("stack"), method="dozen")


def test_names_of_this_package_ask_nobody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """A default solve looks nothing up among installed distributions."""

    def refused(group: str) -> None:
        raise AssertionError(f"the environment was scanned for {group}")

    monkeypatch.setattr(doors, "installed", refused)
    scene = builtin_scene("single-block")
    for options in ({}, {"surface": "octagon"}, {"method": "exact"}, {"solver": "CLARABEL"}):
        assert solve(scene, **options).status == "certified"  # type: ignore[arg-type]
    solve(scene).plot()


def test_what_is_not_here_is_refused_by_name() -> None:
    with pytest.raises(ModelError, match="sweeping is not part of this installation: noth"):
        Door("cvxlimit.readings").needed("nothing_like_it", "sweeping")

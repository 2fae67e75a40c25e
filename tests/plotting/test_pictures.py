"""Pictures of results: what they show is where mechanics puts it, and nothing is shown unasked."""

from __future__ import annotations

import io
import json
import subprocess
import sys

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image
from tests.kit.pictures import assert_legible

from cvxlimit import Solution, builtin_scene, plotting, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.plotting import PICTURES, Drawing, camera_for, drawing, picture, registry
from cvxlimit.plotting.drawing import SceneFigure
from cvxlimit.plotting.look import KIND_COLOURS, THINNEST, rgb, used_colour
from cvxlimit.plotting.picture import drawn_mesh
from cvxlimit.plotting.pictures.forces import FAINTEST, thrust_lines
from cvxlimit.plotting.sheet import columns_of, measured
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import motion
from cvxlimit.solution.kinematics import ContactKind

KINDS = tuple(
    kind for kind in PICTURES if kind not in ("animation", "page") and kind not in PICTURES.places
)
"""Figures of any solution: those that an extension offers have tests of their own."""


@pytest.fixture(scope="module")
def arch() -> Solution:
    return solve(builtin_scene("arch"))


@pytest.fixture(scope="module")
def tuff() -> Solution:
    return solve(builtin_scene("tuff-wall"))


@pytest.fixture
def drawings(monkeypatch) -> list[Drawing]:
    """What would be drawn, without the painting."""
    seen: list[Drawing] = []
    monkeypatch.setattr(drawing, "drawn", lambda given, **options: seen.append(given) or given)
    return seen


class TestThrust:
    def test_it_runs_inside_the_arch(self, arch: Solution) -> None:
        """Without tension no pressure centre leaves the ring: 0.15 thick about radius 1."""
        ends, _, _ = thrust_lines(arch.scene, arch.forces)
        radius = np.linalg.norm(ends[..., [0, 2]], axis=2)
        assert len(ends) == len(arch.scene.free)  # one line in every voussoir
        assert radius.min() >= 1 - 0.075 - 1e-6
        assert radius.max() <= (1 + 0.075) / np.cos(np.pi / 40) + 1e-6

    def test_it_touches_the_edges_at_four_hinges(self, arch: Solution) -> None:
        table = arch.to_dataframe()
        opening = table[table["state"] == "opens"]
        assert len(opening) == 4
        assert opening["utilisation_rocking"].to_list() == pytest.approx([1.0] * 4, abs=1e-4)
        closed = table[table["state"] == "closed"]["utilisation_rocking"]
        assert closed.max() < 1.0 - 1e-4

    def test_the_thrust_of_a_line_is_the_joints(self, arch: Solution) -> None:
        _, size, _ = thrust_lines(arch.scene, arch.forces)
        normal = arch.to_dataframe()["N"]
        assert normal.min() <= size.min() <= size.max() <= normal.max()


class TestForces:
    def test_arrows_push_the_block_above_and_small_ones_are_left_out(self, tuff, drawings) -> None:
        plotting.forces(tuff)
        lines = drawings[0].lines
        length = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1)
        assert length.min() > FAINTEST * length.max()
        scene, contacts = tuff.scene, tuff.scene.contacts
        size = np.linalg.norm(tuff.forces[:, :3], axis=1)
        assert length.max() == pytest.approx(lines.each * size.max())
        assert len(length) == (size > FAINTEST * size.max()).sum() < len(contacts)
        assert drawings[0].glass  # lines over opaque blocks hide which joint they belong to
        arrows = lines.ends[:, 1] - lines.ends[:, 0]
        assert (arrows[np.abs(arrows[:, 2]) > 0.5 * length.max()][:, 2] > 0).all()
        assert {arrow.case for arrow in drawings[0].notes.arrows} == {"dead", "live"}
        assert scene.name in drawings[0].heading

    def test_loads_have_scales_of_their_own_and_are_those_at_collapse(self, arch, drawings) -> None:
        """The largest force of either is drawn as long as that of the other."""
        plotting.forces(arch)
        notes, scene = drawings[0].notes, arch.scene
        weight = float(np.linalg.norm(scene.dead_forces[:, :3].sum(axis=0)))
        push = float(np.linalg.norm(scene.live_forces[:, :3].sum(axis=0)))
        wanted = {"dead": weight, "live": arch.load_factor * push}
        assert {arrow.case for arrow in notes.arrows} == set(wanted)
        assert notes.largest == pytest.approx(wanted)
        length = [np.linalg.norm(np.subtract(arrow.tip, arrow.tail)) for arrow in notes.arrows]
        assert length == pytest.approx(2 * length[:1])

    def test_a_load_factor_of_zero_has_no_arrow_of_the_live_load(self, arch, drawings) -> None:
        plotting.forces(Solution(**{**vars(arch), "load_factor": 0.0}))
        assert {arrow.case for arrow in drawings[0].notes.arrows} == {"dead"}
        plotting.forces(Solution(**{**vars(arch), "load_factor": -0.1}))
        (push,) = [arrow for arrow in drawings[1].notes.arrows if arrow.case == "live"]
        assert np.subtract(push.tip, push.tail)[0] < 0.0  # the other way

    @pytest.mark.parametrize("size", [None, (3.4, 3.0)])
    def test_the_legend_says_what_the_longest_arrow_of_each_kind_is(self, arch, size) -> None:
        figure, scene = arch.plot("forces", figsize=size), arch.scene
        words = [text.get_text() for text in figure.legends[0].get_texts()]
        weight = float(np.linalg.norm(scene.dead_forces[:, :3].sum(axis=0)))
        push = arch.load_factor * float(np.linalg.norm(scene.live_forces[:, :3].sum(axis=0)))
        force = float(np.linalg.norm(arch.forces[:, :3], axis=1).max())
        stated = [word.split(", largest ") for word in words if word.endswith(" kN")]
        wanted = {"force on the block above": force, "dead load": weight, "live load": push}
        assert {name: float(value.split()[0]) for name, value in stated} == pytest.approx(
            wanted, rel=1e-3
        )
        assert_legible(figure)


class TestMechanism:
    def test_lines_are_as_wide_as_joints_move(self, tuff: Solution, drawings) -> None:
        """114 joints of the tuff wall slide: those that hardly do must not hide the others."""
        plotting.mechanism(tuff)
        marking = drawings[0].marking
        table = tuff.to_dataframe()
        slides = (table["state"] == "slides").to_numpy()
        assert slides.sum() > 100
        width, slip = marking.width[slides], table["slip"].to_numpy()[slides]
        order = np.argsort(slip)
        assert (np.diff(width[order]) >= 0).all()
        assert width.max() == pytest.approx(1.0)
        assert np.median(width) < 0.35

    def test_the_displacement_that_is_drawn_is_stated(self, tuff: Solution, drawings) -> None:
        for times in (1.0, 2.0):
            plotting.mechanism(tuff, magnification=times)
            moving = motion(tuff.scene, tuff)
            stated = f"largest displacement drawn {times * moving.scale * moving.largest:.3g} m"
            assert stated in drawings[-1].caption

    @pytest.mark.parametrize("kind", ["mechanism", "cracks"])
    def test_joints_below_a_twentieth_of_the_largest_rate_are_not_drawn(
        self, tuff: Solution, drawings, kind: str
    ) -> None:
        PICTURES[kind](tuff)
        marking = drawings[-1].marking
        table = tuff.to_dataframe()
        moves = (table["state"] != "closed").to_numpy()
        opens = (table["state"] == "opens").to_numpy()
        rate = np.where(opens, table["opening"], table["slip"])
        slow = rate < 0.05 * rate[moves].max()
        assert (moves & slow).sum() > 10
        assert ((marking.kind != ContactKind.CLOSED) == (moves & ~slow)).all()

    def test_cracks_are_drawn_on_what_has_not_moved(self, arch: Solution, drawings) -> None:
        plotting.cracks(arch)
        assert drawings[0].moving.scale == 0.0
        assert (drawings[0].marking.kind == ContactKind.OPENS).sum() == 4

    @pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), "2"])
    def test_a_magnification_is_a_number_above_zero(self, tuff: Solution, wrong) -> None:
        with pytest.raises(InputError, match="magnification"):
            plotting.mechanism(tuff, magnification=wrong)


class TestUtilisation:
    def test_colours_go_from_light_to_dark(self) -> None:
        shares = np.linspace(0, 1, 20)
        codes = [used_colour(float(s)) for s in shares]
        grey = [sum(int(c[i : i + 2], 16) for i in (1, 3, 5)) for c in codes]
        assert (np.diff(grey) < 0).all()

    def test_joints_have_the_colour_of_their_share(self, tuff: Solution, drawings) -> None:
        plotting.utilisation(tuff, surface="torsion", state="found")
        used = tuff.to_dataframe()["utilisation_torsion"].to_numpy()
        normal = tuff.to_dataframe()["N"].to_numpy()
        decals = drawings[0].decals  # rectangles: one for each joint
        for decal, share, n in zip(decals, used.tolist(), normal.tolist(), strict=True):
            is_idle = n < 0.01 * normal.max()
            assert decal.colour == (Style.idle if is_idle else used_colour(min(share, 1.0)))

    def test_an_unknown_surface_is_refused(self, tuff: Solution) -> None:
        with pytest.raises(InputError, match="choose one of rocking, sliding, torsion"):
            plotting.utilisation(tuff, surface="friction")


def test_an_exploded_view_moves_blocks_apart(tuff: Solution, drawings) -> None:
    """All distances between the drawn parts of blocks grow by the same share."""
    plotting.exploded(tuff, gap=0.5)
    scene, moving = drawings[0].scene, drawings[0].moving
    mesh = drawn_mesh(scene)
    middle = [mesh.points[mesh.point_block == i] for i in range(len(scene.blocks))]
    centre = np.array([0.5 * (p.min(axis=0) + p.max(axis=0)) for p in middle])
    moved = centre + moving.scale * moving.rates[:, :3]
    assert np.allclose(moved[5:] - moved[4], 1.5 * (centre[5:] - centre[4]))
    assert not moving.rates[:, 3:].any()


def test_every_picture_is_a_figure(tmp_path) -> None:
    solution = solve(builtin_scene("single-block"))
    for kind in KINDS:
        assert isinstance(solution.plot(kind), SceneFigure)
    for suffix, start in ((".svg", b"<?xml"), (".pdf", b"%PDF"), (".png", b"\x89PNG")):
        path = solution.plot("thrust", tmp_path / f"block{suffix}")
        assert path.read_bytes().startswith(start)


def test_a_scene_can_be_exploded_before_it_is_solved() -> None:
    assert isinstance(plotting.exploded(builtin_scene("single-block")), SceneFigure)


@pytest.fixture(scope="module")
def moving() -> plotting.Animation:
    return solve(builtin_scene("single-block")).plot("animation", frames=6)


class TestPage:
    """The interactive page says and shows what the still picture does."""

    def test_joints_by_rate_and_the_displacement(self, tuff: Solution) -> None:
        page = tuff.plot("page")
        text = page.split('type="application/json">')[1].split("</script>")[0]
        data = json.loads(text)
        widths = np.array(data["contacts"]["width"])
        assert len(widths) == tuff.contacts
        assert widths.max() == 1.0
        assert (widths >= THINNEST).all()
        assert len(np.unique(widths.round(3))) > 20  # not all alike
        assert "largest displacement drawn" in page

    def test_thrust_and_strength_in_use(self, tuff: Solution) -> None:
        data = json.loads(
            tuff.plot("page").split('type="application/json">')[1].split("</script>")[0]
        )
        share = np.array(data["thrust"]["share"])
        assert share.max() == 1.0
        assert share.min() > 0.0
        ends = np.array(data["thrust"]["ends"]).reshape(-1, 2, 3)
        blocks = tuff.scene.blocks
        for line, block in zip(ends, data["thrust"]["block"], strict=True):
            corners = blocks[block].vertices
            # A joint's pressure centre lies on its block, to the digits of the page.
            assert (line >= corners.min(axis=0) - 1e-4).all()
            assert (line <= corners.max(axis=0) + 1e-4).all()
        used = [u for u in data["used"] if u is not None]
        assert len(data["used"]) == tuff.contacts
        assert min(used) >= 0.0
        assert max(used) == 1.0
        assert "in the state that uses joints least" in data["useText"]


class TestAnimation:
    @pytest.mark.exhaustive
    def test_forth_and_back(self, moving: plotting.Animation) -> None:
        first, *others = moving.frames
        assert len(moving.frames) == 6
        assert all((a == b).all() for a, b in zip(others, others[::-1], strict=True))
        changed = [int((frame != first).any(axis=2).sum()) for frame in others[:3]]
        assert changed[0] > 0
        assert changed == sorted(changed)

    def test_a_gif_with_all_frames(self, moving: plotting.Animation, tmp_path) -> None:
        with Image.open(moving.save(tmp_path / "block.gif")) as image:
            assert image.n_frames == 6
            assert image.size == moving.frames[0].shape[1::-1]
        assert "data:image/gif;base64," in moving._repr_html_()

    def test_a_gif_keeps_the_colours_of_its_legend(self, moving, tmp_path) -> None:
        with Image.open(moving.save(tmp_path / "block.gif")) as image:
            image.seek(len(moving.frames) // 2)
            shown = np.asarray(image.convert("RGB")).astype(int)
        assert (shown[2, 2] == 255).all()  # paper is white
        for colour in KIND_COLOURS.values():
            wanted = 255 * rgb(colour)
            assert np.abs(shown - wanted).max(axis=2).min() <= 8.0, colour

    def test_an_mp4(self, moving: plotting.Animation, tmp_path) -> None:
        assert moving.save(tmp_path / "block.mp4").read_bytes()[4:8] == b"ftyp"

    def test_without_ffmpeg_the_cure_is_named(self, moving, monkeypatch, tmp_path) -> None:
        monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
        with pytest.raises(
            ModelError, match=r'a .gif needs no more.*pip install "cvxlimit\[video\]"'
        ):
            moving.save(tmp_path / "block.mp4")
        assert not list(tmp_path.iterdir())

    def test_what_cannot_be_animated(self, moving, tmp_path) -> None:
        with pytest.raises(InputError, match=r"'block.avi': give a name that ends in .gif or .mp4"):
            moving.save(tmp_path / "block.avi")
        solution = solve(builtin_scene("single-block"))
        with pytest.raises(ModelError, match="must be even, got 5"):
            solution.plot("animation", frames=5)
        still = plotting.animation
        with pytest.raises(InputError, match="has no mechanism"):
            still(Solution(**{**vars(solution), "mechanism": None}))


PLAIN = """
from cvxlimit.plotting.contents import Drawing, camera_for
from cvxlimit.results.movement import still
from cvxlimit.plotting.registry import picture

@picture
def plain(solution):
    scene = solution.scene
    return Drawing(scene, still(scene), camera_for(scene, still(scene), None))
"""

AGAIN = """
import importlib, sys
from cvxlimit import builtin_scene, plotting, solve
plotting.pictures.__path__.append(sys.argv[1])
importlib.reload(plotting)
assert "plain" in plotting.__all__ and plotting.plain
assert solve(builtin_scene("single-block")).plot("plain")._repr_png_()
"""


class TestOnesOwn:
    """A function with a decorator, in one file, is a picture like the package's."""

    @pytest.mark.exhaustive
    def test_outside_the_package(self, arch: Solution, tmp_path, monkeypatch) -> None:
        monkeypatch.setattr(registry, "PICTURES", dict(PICTURES))
        monkeypatch.setattr(plotting, "PICTURES", registry.PICTURES)

        @picture
        def lintel(solution: Solution, *, words: str = "nothing") -> Drawing:
            """Blocks and a sentence."""
            scene, moving = solution.scene, motion(solution.scene, solution)
            return Drawing(scene, moving, camera_for(scene, moving, None), words)

        assert arch.plot("lintel", tmp_path / "own.png", words="falls").stat().st_size > 10_000
        assert "falls" in [text.get_text() for text in arch.plot("lintel", words="falls").texts]
        assert lintel.__doc__ == "Blocks and a sentence."

    @pytest.mark.exhaustive
    def test_a_file_in_the_package_is_all_it_takes(self, tmp_path) -> None:
        """In a process of its own, with a second folder of pictures."""
        (tmp_path / "plain.py").write_text(PLAIN, "utf-8")
        command = [sys.executable, "-c", AGAIN, str(tmp_path)]
        run = subprocess.run(command, capture_output=True, check=False)
        assert (run.returncode, run.stderr) == (0, b"")


def test_pictures_by_name(arch: Solution, tmp_path) -> None:
    assert arch.plot("page")._repr_html_().startswith("<iframe")
    assert arch.plot("page", tmp_path / "arch.html").stat().st_size > 10_000
    with pytest.raises(InputError, match="no picture 'thrusts': choose one of"):
        arch.plot("thrusts")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"'arch.doc': give a name that ends in .png or .svg"):
        arch.plot("forces", tmp_path / "arch.doc")
    assert arch.plot("mechanism", tmp_path / "falls.html").stat().st_size > 10_000
    for kind, suffix in (("forces", "html"), ("thrust", "vtu"), ("animation", "html")):
        with pytest.raises(InputError, match=rf"'other.{suffix}': give a name that ends in"):
            arch.plot(kind, tmp_path / f"other.{suffix}")  # not the mechanism in its place
    assert not [*tmp_path.glob("other*")]


@pytest.mark.parametrize("kind", KINDS)
def test_without_its_scene_a_solution_says_how_to_get_it(kind: str, arch: Solution) -> None:
    lost = Solution(**{**vars(arch), "solved_scene": None})
    with pytest.raises(InputError, match=r"solution.of\(scene\) gives it back"):
        lost.plot(kind)  # type: ignore[arg-type]


def test_names_complete() -> None:
    assert set(KINDS) <= set(dir(plotting))
    assert all(hasattr(plotting, name) for name in plotting.__all__)
    with pytest.raises(AttributeError, match="'mechanisms'"):
        plotting.mechanisms  # noqa: B018


def test_pyvista_meshes_are_the_blocks(arch: Solution) -> None:
    meshes = plotting.to_pyvista(arch)
    scene = arch.scene
    assert meshes["blocks"].n_cells == len(scene.blocks)
    assert meshes["contacts"].n_cells == len(scene.contacts)
    volume = meshes["blocks"].compute_cell_sizes()["Volume"]
    assert volume == pytest.approx([b.volume for b in scene.blocks], rel=1e-6)


def test_a_thumbnail_is_small(arch: Solution) -> None:
    scene = arch.scene
    image = Image.open(io.BytesIO(drawing.thumbnail(scene, motion(scene, arch), None)))
    assert max(image.size) <= 420


class TestSheet:
    """Figures for a journal's column: nothing leaves the paper, letters can be read."""

    @pytest.mark.exhaustive_cases("None-mechanism", "figsize0-utilisation")
    @pytest.mark.parametrize("kind", ["mechanism", "forces", "utilisation"])
    @pytest.mark.parametrize("figsize", [(3.4, 2.9), None])
    @pytest.mark.exhaustive_cases("figsize0-mechanism", "None-utilisation")
    def test_words_stay_on_the_paper(self, tuff: Solution, kind: str, figsize) -> None:
        assert_legible(tuff.plot(kind, figsize=figsize))

    @pytest.mark.exhaustive
    @pytest.mark.parametrize("name", ["facade", "single-block"])
    def test_words_of_all_pictures_keep_apart_in_a_column(self, name: str) -> None:
        """Of scenes whose axes are short there, so that their words are close."""
        solution = solve(builtin_scene(name))
        for kind in KINDS:
            assert_legible(solution.plot(kind, figsize=(3.4, 3.0)), 5)
        assert_legible(solution.scene.plot(figsize=(3.4, 2.5)), 5)

    def test_sizes_titles_and_legends_are_the_callers(self, arch: Solution) -> None:
        figure = arch.plot("thrust", figsize=(3.4, 2.5), title="Arch", legend=False)
        assert figure.get_size_inches().tolist() == [3.4, 2.5]
        assert figure.texts[0].get_text() == "Arch"
        assert not figure.legends
        assert not arch.plot("thrust", title="").texts
        with rc_context({"figure.figsize": (5.0, 4.0), "font.size": 12.0}):
            figure = arch.plot("thrust")
            assert figure.get_size_inches().tolist() == [5.0, 4.0]
            larger = arch.plot("thrust", figsize=(7.0, 5.0)).texts[0].get_size()
        assert larger == 1.2 * arch.plot("thrust", figsize=(7.0, 5.0)).texts[0].get_size()
        assert max(arch.plot("thrust").get_size_inches()) > 5.0

    def test_axes_of_ones_own(self, arch: Solution, tmp_path) -> None:
        own = Figure(figsize=(7.0, 3.0), layout="constrained")
        left, right = own.subplots(1, 2)
        assert arch.plot("mechanism", ax=left) is own
        arch.plot("thrust", ax=right, title="Thrust")
        assert right.get_title() == "Thrust"
        assert left.get_legend() is not None
        own.savefig(tmp_path / "two.pdf")
        with pytest.raises(InputError, match="give ax or figsize, not both"):
            arch.plot("thrust", ax=left, figsize=(3, 3))
        with pytest.raises(InputError, match="save that with savefig"):
            arch.plot("thrust", tmp_path / "a.png", ax=left)
        with pytest.raises(InputError, match=r"width and height in inches, got \(3, -1\)"):
            arch.plot("thrust", figsize=(3, -1))

    @pytest.mark.parametrize("kind", ["mechanism", "forces", "utilisation"])
    @pytest.mark.exhaustive_cases("mechanism", "utilisation")
    def test_files_of_vectors_hold_no_image(self, arch: Solution, kind: str, tmp_path) -> None:
        """Matplotlib's own colour bar is the only image: a strip of 256 colours."""
        pdf = arch.plot(kind, tmp_path / "arch.pdf").read_bytes()
        svg = arch.plot(kind, tmp_path / "arch.svg").read_text("utf-8")
        bars = 0 if kind == "forces" else 1
        assert pdf.count(b"/Subtype /Image") <= bars
        assert svg.count("<image ") <= bars
        assert svg.count("<path ") > 40

    def test_columns_of_a_legend_fit(self) -> None:
        texts = ["contact opens (44)", "support", "undeformed", "dead load", "live load"]
        assert columns_of(texts, 8.0, 20.0) == 5
        assert columns_of(texts, 8.0, 0.5) == 1
        assert measured(texts[0], 16.0) == pytest.approx(2 * measured(texts[0], 8.0), rel=0.05)

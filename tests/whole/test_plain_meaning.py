"""What people type: it works if its meaning is plain, and is refused with one sentence if not."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from cvxlimit import (
    Block,
    Certified,
    Contacts,
    FixedPoint,
    Load,
    Scene,
    Units,
    solve,
)
from cvxlimit.compare import compare
from cvxlimit.errors import CvxlimitError, ModelError
from cvxlimit.io import result_to_dict, scene_to_dict
from cvxlimit.plotting import figure, page, plot
from cvxlimit.solvers import SolverSettings
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface

NAN = float("nan")
GROUND = Block.box("g", (-1, -1, -1), (2, 2, 0))
LOWER = Block.box("b1", (0, 0, 0), (1, 1, 1), density=20.0)
UPPER = Block.box("b2", (0, 0, 1), (1, 1, 2), density=20.0)
PUSH = Load(acceleration=(1, 0, 0))
CLARABEL = SolverSettings("CLARABEL", {"max_iter": 100})


def scene(**changes: Any) -> Scene:
    parts = {"blocks": [GROUND, LOWER, UPPER], "supports": ["g"], "live": PUSH}
    return Scene(**{**parts, **changes})


# --- works --------------------------------------------------------------------------------------


def test_one_support_alone_is_a_list_of_one() -> None:
    """Not a list of letters: "ground" would be six supports."""
    assert scene(supports="g").supports == ("g",)
    named = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    assert scene(blocks=[named, LOWER], supports="ground").supports == ("ground",)


def test_blocks_and_supports_may_come_from_a_generator() -> None:
    made = scene(blocks=(b for b in (GROUND, LOWER)), supports=(key for key in ("g",)))
    assert [b.id for b in made.blocks] == ["g", "b1"]
    assert made.supports == ("g",)


def test_none_is_no_force_no_exception_and_no_interaction() -> None:
    assert dict(Load(forces=None).forces) == {}  # type: ignore[arg-type]
    assert dict(scene(contact_friction=None).contact_friction) == {}
    assert solve(scene(), method=None).interaction == "none"


def test_a_contact_by_its_name() -> None:
    contacts = scene(contact_friction={("b1", "b2"): 0.3}).contacts
    assert contacts.names == ("g-b1", "b1-b2")
    named, numbered = contacts["b1-b2"], contacts[1]
    assert (named.a, named.b, named.friction) == ("b1", "b2", 0.3)
    np.testing.assert_array_equal(named.corners, numbered.corners)
    assert contacts[np.int64(-1)].name == "b1-b2"


def test_settings_that_stand_alone() -> None:
    assert Certified(starts="middle") == Certified(starts=("middle",))  # type: ignore[arg-type]
    for ladder in (CLARABEL, [CLARABEL], "CLARABEL", ["CLARABEL"]):
        solution = solve(scene(), ladder=ladder)
        assert solution.load_factor == pytest.approx(0.5, rel=1e-5)  # 1 wide, 2 high: it rocks
        assert set(solution.versions) == {"cvxlimit", "cvxpy", "clarabel"}


# --- refused ------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "name": (lambda: scene(name=5), r"name of the scene must be a text, got 5$"),
    "name, later": (lambda: scene().with_name(None), "name of the scene .* got None"),
    "units": (lambda: scene(units="m"), r"must be Units, got 'm': write Units\(\"mm\", \"N\"\)"),
    "unit": (lambda: Units(length=1), "unit of length must be a text, got 1$"),
    "live": (lambda: scene(live=(1, 0, 0)), r"live load must be a Load, got \(1, 0, 0\): write L"),
    "dead": (lambda: scene(dead=None), "dead load must be a Load, got None: .* Load.. for none"),
    "no blocks": (lambda: scene(blocks=None), "blocks must be Blocks, got None"),
    "not a block": (lambda: scene(blocks=[GROUND, "b1"]), "blocks must be Blocks, got 'b1'"),
    "no supports": (lambda: scene(supports=None), r"supports must be ids, got None: .*\['ground'"),
    "number": (lambda: scene(supports=[0]), "supports must be ids, got 0"),
    "friction": (lambda: scene(friction=None), "friction of the scene must be a number, got None"),
    "friction by name": (
        lambda: scene(contact_friction={"b1-b2": 0.5}),
        r"two ids .* got 'b1-b2': write \{\('b1', 'b2'\): 0.5\}",
    ),
    "friction list": (lambda: scene(contact_friction=[0.5]), r"a mapping .*, got \[0.5\]"),
    "forces": (lambda: Load(forces=[(1,) * 6]), r"forces must be a mapping, got \[\(1, .*write"),  # type: ignore[arg-type]
    "no length": (lambda: scene().in_units(Units(), 0, 1), "length, .* must be above 0, got 0"),
    "NaN length": (lambda: scene().in_units(Units(), NAN, 1), "length, .* finite .* got nan"),
    "no force": (lambda: scene().in_units(Units(), 1, 0), "force, .* must be above 0, got 0"),
    "endless": (lambda: scene().in_units(Units(), 1, np.inf), "force, .* finite .* got inf"),
    "new units": (lambda: scene().in_units("mm", 1, 1), "units must be Units, got 'mm'"),  # type: ignore[arg-type]
    "contact": (lambda: scene().contacts["b1-b3"], "no contact 'b1-b3'; did you mean 'b1-b2'"),
    "contact turned": (lambda: scene().contacts["b2-b1"], "no contact 'b2-b1'; .*mean 'b1-b2'"),
    "no such": (lambda: scene().contacts["roof"], "no contact 'roof'; contacts.names lists them"),
    "half": (lambda: scene().contacts[0.5], "by its number or its name, got 0.5"),  # type: ignore[index]
    "scene by name": (
        lambda: solve("tuff-wall"),  # type: ignore[arg-type]
        r"must be a Scene, got 'tuff-wall': write builtin_scene\('tuff-wall'\), or read_scene",
    ),
    "no scene": (lambda: solve(None), "scene must be a Scene, got None: builtin_scene"),  # type: ignore[arg-type]
    "compared": (lambda: compare("arch"), r"scene must be a Scene, got 'arch'"),  # type: ignore[arg-type]
    "method by number": (lambda: solve(scene(), method=5), "method must be .* got 5"),  # type: ignore[arg-type]
    "moments": (lambda: solve(scene(), method="certified", moments=1), "moments must be .* got 1"),  # type: ignore[arg-type]
    "no moments": (lambda: solve(scene(), moments="signed"), "moments does nothing for .*'convex'"),
    "method": (
        lambda: solve(scene(), method="certify"),
        "method must be one of convex, .*'certify'",
    ),
    "surface": (lambda: solve(scene(), None), "surface must be a name .* got None"),  # type: ignore[arg-type]
    "ladder": (
        lambda: solve(scene(), ladder=5),  # type: ignore[arg-type]
        r"ladder must be a list of solvers, got 5: write \['CLARABEL'\]",
    ),
    "rung": (
        lambda: solve(scene(), ladder=["CLARABLE"]),
        "no solver 'CLARABLE'; did you mean CLARABEL",
    ),
    "formulation": (
        lambda: solve(scene(), formulation="resultants"),  # type: ignore[arg-type]
        "formulation must be a function .* got 'resultants'",
    ),
    "cohesion by name": (
        lambda: scene(contact_cohesion={"b1-b2": 0.5}),
        r"contact_cohesion must be a mapping of two ids .* got 'b1-b2'",
    ),
    "picture": (lambda: plot(scene(), None, "a.png"), r"got None: solve\(scene\) makes one"),  # type: ignore[arg-type]
    "figure": (lambda: figure(scene(), None), "solution must be a Solution, got None"),  # type: ignore[arg-type]
    "page": (lambda: page(None, None), "scene must be a Scene, got None"),  # type: ignore[arg-type]
    "path": (lambda: plot(scene(), None, None), "path must name a file, got None"),  # type: ignore[arg-type]
    "file": (lambda: scene_to_dict(None), "scene must be a Scene, got None"),  # type: ignore[arg-type]
    "result": (lambda: result_to_dict(None), "solution must be a Solution, got None"),  # type: ignore[arg-type]
    "starts": (lambda: Certified(starts=("centre",)), r"starts must be .* got \('centre',\)"),
    "no start": (lambda: Certified(starts=()), r"at least one, got \(\)"),
    "solves": (lambda: Certified(solves=0), "solves must be at least 1 and whole, got 0"),
    "most": (
        lambda: FixedPoint(max_iterations=2.5),
        "max_iterations must be at least 1 and whole, got 2.5",
    ),  # type: ignore[arg-type]
    "weight": (lambda: FixedPoint("0.8"), "old_value_weight must be .* got '0.8'"),  # type: ignore[arg-type]
    "tolerance": (lambda: solve(scene(), tolerance="tight"), "between 0 and 1, got 'tight'"),  # type: ignore[arg-type]
}

NOT_A_NUMBER: dict[str, Callable[[], Any]] = {
    "solve": lambda: solve(scene(), tolerance=NAN),
    "fixed point": lambda: FixedPoint(tolerance=NAN),
    "weight": lambda: FixedPoint(old_value_weight=NAN),
    "most": lambda: FixedPoint(max_iterations=NAN),  # type: ignore[arg-type]
    "certified": lambda: Certified(tolerance=NAN),
    "solves": lambda: Certified(solves=NAN),  # type: ignore[arg-type]
    "workers": lambda: Certified(workers=NAN),  # type: ignore[arg-type]
    "seconds": lambda: Certified(branching_seconds=NAN),
}


def refusal(make: Callable[[], Any]) -> str:
    with pytest.raises(CvxlimitError) as caught:
        make()
    text = str(caught.value)
    assert text.isprintable()
    return text


@pytest.mark.parametrize(("make", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_refused_with_a_sentence(make: Callable[[], Any], message: str) -> None:
    assert re.search(message, refusal(make))


@pytest.mark.parametrize("make", NOT_A_NUMBER.values(), ids=NOT_A_NUMBER.keys())
def test_settings_that_are_not_a_number(make: Callable[[], Any]) -> None:
    assert refusal(make).endswith("got nan")


class Misspelt(YieldSurface):
    """One component of the caller's spelling, in a norm or in the resistance."""

    name = "misspelt"

    def __init__(self, norm: Mapping[Any, float], resistance: Mapping[Any, float]) -> None:
        super().__init__()
        self.norm, self.resistance = norm, resistance

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm(self.norm)], self.resistance)]


@pytest.mark.parametrize(
    ("norm", "resistance", "message"),
    [
        ({"Mt": 1}, {"N": 1}, "surface 'misspelt' .*component 'Mt'.* mean 'MT'"),
        pytest.param(
            {"MT": 1},
            {"n": 1},
            "component 'n'.* mean 'N'|condition on 'n' has 2 rows .*write one of V1",
        ),
        ({"V3": 1}, {"N": 1}, "surface 'misspelt' .*component 'V3'.* mean 'V"),
        ({"shear": 1}, {"N": 1}, "surface 'misspelt' .*component 'shear'.* V1, V2, N, M1, M2, MT"),
        ({"V1": 1}, {"N": 1, "cohesion": 1}, "surface 'misspelt' .*component 'cohesion'"),
        ({"V1": 1}, {"N": 1, 0: 1}, "surface 'misspelt' .*component 0"),
    ],
)
def test_misspelt_components_name_the_surface_and_the_known_ones(
    norm: Mapping[Any, float], resistance: Mapping[Any, float], message: str
) -> None:
    surface = Misspelt(norm, resistance)
    contacts = scene().contacts
    with pytest.raises(ModelError, match=message):
        surface.excess(np.zeros((len(contacts), 6)), contacts)
    with pytest.raises(ModelError, match=message):
        solve(scene(), [Rocking(), surface])


# --- immutable ----------------------------------------------------------------------------------

COPIES: dict[str, Callable[[Any], Any]] = {
    "itself": lambda x: x,
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda x: pickle.loads(pickle.dumps(x)),
}


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES.keys())
def test_blocks_and_contacts_stay_immutable_in_copies(copied: Callable[[Any], Any]) -> None:
    block, contacts, whole = copied(LOWER), copied(scene().contacts), copied(scene())
    for arrays in (
        (block.vertices, block.centroid, block.bounds),
        (whole.blocks[1].vertices, whole.contacts.axes),
        (contacts.origin, contacts.axes, contacts.area, contacts.friction, contacts.corner_xy),
    ):
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
    with pytest.raises(AttributeError):
        block.density = 1.0
    np.testing.assert_array_equal(block.vertices, LOWER.vertices)
    assert (block.id, block.weight, block.faces) == (LOWER.id, LOWER.weight, LOWER.faces)


def test_arrays_handed_over_are_copied() -> None:
    friction = np.array([0.4, 0.5])
    contacts = scene().contacts.with_values(friction=friction)
    friction[0] = 0.1
    assert contacts.friction.tolist() == [0.4, 0.5]

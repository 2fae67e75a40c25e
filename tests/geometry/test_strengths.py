"""One record of what contacts have: a new property reaches all that goes by its fields."""

from __future__ import annotations

import pickle
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

import cvxlimit
from cvxlimit import Block, Load, Scene, Units
from cvxlimit.errors import InputError
from cvxlimit.geometry.strengths import PROPERTIES, SceneJoints
from cvxlimit.studies import varied

GROUND = Block.box("ground", (-1, -1, -1), (2, 2, 0))
BLOCKS = [GROUND] + [Block.box(f"b{i}", (0, 0, i), (1, 1, i + 1), density=1.0) for i in range(2)]
PAIR = ("b0", "b1")
VALUES = {name: 0.5 + 0.25 * i for i, name in enumerate(PROPERTIES)}
"""Of all contacts: none is a default."""


def scene(**changes: object) -> Scene:
    own = {f"contact_{name}": {PAIR: 2.0 * value} for name, value in VALUES.items()}
    given = {**VALUES, **own, **changes}
    return Scene(BLOCKS, ["ground"], Load(acceleration=(1, 0, 0)), **given)  # type: ignore[arg-type]


def of_contacts(found: Scene) -> dict[str, list[float]]:
    return {name: getattr(found.contacts, name).tolist() for name in PROPERTIES}


EXPECTED = {name: [value, 2.0 * value] for name, value in VALUES.items()}


def test_every_property_has_exceptions() -> None:
    own = [each.name for each in fields(SceneJoints) if each.name not in PROPERTIES]
    assert own == [f"contact_{name}" for name in PROPERTIES]
    assert all(each.default != VALUES[name] for name, each in PROPERTIES.items())


def test_contacts_have_what_the_scene_says() -> None:
    assert of_contacts(scene()) == EXPECTED


def test_copies_keep_every_property() -> None:
    given = scene()
    copies = {
        "pickle": pickle.loads(pickle.dumps(given)),
        "units": replace(given.in_units(Units("m", "kN"), 1.0, 1.0)),
        "density": given.with_density(2.0),
        "size": varied(given, size=2.0),
        "contacts": given.sharing_contacts_of(scene(friction=0.1)),
        "moved": given.moved(np.eye(3), (1, 2, 3)),
    }
    for how, copy in copies.items():
        assert of_contacts(copy) == EXPECTED, how
        assert copy.joint_values == given.joint_values, how


def test_other_units_scale_forces_per_area() -> None:
    other = scene().in_units(Units("mm", "N"), 1e3, 1e3)
    for name, each in PROPERTIES.items():
        factor = 1e-3 if each.metadata["per_area"] else 1.0
        np.testing.assert_allclose(getattr(other.contacts, name), factor * np.array(EXPECTED[name]))


@pytest.mark.parametrize("name", PROPERTIES)
def test_one_of_them_is_changed_by_name(name: str) -> None:
    for changed in (scene().with_joints(**{name: 3.0}), varied(scene(), **{name: 3.0})):
        assert of_contacts(changed) == {**EXPECTED, name: [3.0, 2.0 * VALUES[name]]}
    contacts = scene().contacts.with_values(**{name: 3.0})
    assert getattr(contacts, name).tolist() == [3.0, 3.0]
    assert name in signature(varied).parameters


def test_some_contacts_keep_every_property() -> None:
    taken = scene().contacts.take(np.array([1]))
    assert {name: getattr(taken, name).tolist() for name in PROPERTIES} == {
        name: [2.0 * value] for name, value in VALUES.items()
    }


def test_a_name_that_is_none_of_theirs_is_refused() -> None:
    with pytest.raises(InputError, match="contacts have no 'frction': they have friction, "):
        scene().with_joints(frction=1.0)
    with pytest.raises(InputError, match="contacts have no 'frction'"):
        varied(scene(), frction=1.0)


NEW = """\
    dilatancy: V = _property(0.1, not_negative)
"""
NEW_EXCEPTIONS = """\
    contact_dilatancy: ByPair = field(default_factory=dict)
"""
USE = """
import pickle
import cvxlimit
from cvxlimit import Block, Load, Scene
from cvxlimit.io import scene_from_dict, scene_to_dict
from cvxlimit.studies import varied

ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
stones = [Block.box(f"b{i}", (0, 0, i), (1, 1, i + 1), density=1.0) for i in range(2)]
push = Load(acceleration=(1, 0, 0))
scene = Scene([ground, *stones], ["ground"], push, dilatancy=0, contact_dilatancy={("b0", "b1"): 3})
again = scene_from_dict(scene_to_dict(scene))
for found in (scene, again, pickle.loads(pickle.dumps(scene)), varied(scene, size=2.0)):
    assert found.contacts.dilatancy.tolist() == [0.0, 3.0]
assert varied(scene, dilatancy=0.2).contacts.dilatancy.tolist() == [0.2, 3.0]
assert scene_to_dict(scene)["dilatancy"] == 0.0
"""


@pytest.mark.exhaustive
def test_a_new_property_is_written_in_one_file(tmp_path: Path) -> None:
    """What has a list of its own, as scene files had, would lose it on the way."""
    shutil.copytree(Path(cvxlimit.__file__).parent, tmp_path / "cvxlimit")
    file = tmp_path / "cvxlimit" / "geometry" / "strengths.py"
    text = file.read_text("utf-8")
    for last, new in ((r"    tensile_strength: V = .*\n", NEW),
                      (r"    contact_tensile_strength: .*\n", NEW_EXCEPTIONS)):  # fmt: skip
        text, times = re.subn(last, lambda found, new=new: found[0] + new, text)
        assert times == 1
    file.write_text(text, "utf-8")
    subprocess.run([sys.executable, "-c", USE], cwd=tmp_path, check=True)

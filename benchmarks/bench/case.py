"""Cases: a scene made by a function, what is known of it, and the files both are kept in."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from decimal import Decimal
from fnmatch import fnmatchcase
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from cvxlimit import Scene
from cvxlimit.base.files import write_file
from cvxlimit.io import read_scene, scene_to_dict

HOME = Path(__file__).parent
ROOT = HOME.parents[1]
SCENES, RECORDS, STATES = HOME / "scenes", HOME / "records", HOME / "states"
FORMAT, VERSION = "cvxlimit-bench-record", 1

SOURCES: dict[str, dict[str, str]] = json.loads((HOME / "sources.json").read_text("utf-8"))
"""Works that published values come from, by key. ``seen`` says how a value reached this bench:
``"opened"``, it was read in the work itself or in one that quotes it (then ``through`` says which);
``"reference"``, it stands in the reference values that this package is tested against;
``"derived"``, it follows from statics; ``"computed"``, by another program, for this bench."""

MODULES = ("blocks", "arches", "walls", "bonds", "builtin", "families")
"""Scripts in ``benchmarks/bench/cases``, in the table's order."""

KINDS = ("closed form", "other program", "test")
CLASSES = (
    "agrees", "rounding", "model form", "missing physics", "input not published",
    "scatter of tests", "reading off a figure", "fault of a program",
)  # fmt: skip
LAYOUTS = ("published", "inferred", "own")

PLANE = ("conic", "octagon", "vertex-forces", "vertex-octagon")
"""What tools claim to compute. Where nothing twists other models say the same."""

SURFACES = ("octagon", "conic", "parabolic", "exact", "vertex-forces", "vertex-octagon")
READINGS = ("independent", "signed", "paper")
"""Of the interaction with bending (Eq. 30)."""

Build = Callable[[], "Scene | Mapping[str, Scene]"]


@dataclass(frozen=True)
class Value:
    """One published or measured value.

    Attributes
    ----------
    text : str
        As printed: its digits say how far it can be trusted.
    source : str
        Key of :data:`SOURCES`.
    kind, discrepancy : str
        Of :data:`KINDS` and :data:`CLASSES`.
    model : str
        Whose bracket it is held against.
    why : str
        One sentence; needed for all but "agrees".
    """

    text: str
    source: str
    kind: str = "closed form"
    model: str = "conic"
    discrepancy: str = "agrees"
    why: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """All numbers that are printed like this one."""
        half = Decimal(self.text).as_tuple().exponent
        assert isinstance(half, int)
        reach = 0.5 * 10.0**half
        return float(self.text) - reach, float(self.text) + reach


@dataclass(frozen=True)
class Quantity:
    """What the values are: ``factor`` times the load factor, or a parameter of two scenes.

    With ``parameter``, numbers for the scenes "falls" and "stands": the answer lies between.
    """

    name: str = "load factor"
    unit: str = ""
    factor: float = 1.0
    parameter: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Case:
    """What :func:`case` registers."""

    name: str
    title: str
    build: Build
    script: str
    values: tuple[Value, ...]
    models: tuple[str, ...]
    quantity: Quantity
    layout: str
    note: str

    @cached_property
    def scenes(self) -> dict[str, Scene]:
        """Scenes by role ("" for the only one), made anew."""
        made = self.build()
        roles = {"": made} if isinstance(made, Scene) else dict(made)
        return {role: scene.with_name(self.scene_name(role)) for role, scene in roles.items()}

    @property
    def roles(self) -> tuple[str, ...]:
        """Of its scenes: one without a role, or "falls" and "stands"."""
        return ("",) if self.quantity.parameter is None else ("falls", "stands")

    def scene_name(self, role: str) -> str:
        """Also the stem of its file."""
        return f"{self.name}.{role}" if role else self.name

    def scene_file(self, role: str = "") -> Path:
        """Where the scene of a role is kept."""
        return SCENES / f"{self.scene_name(role)}.json"

    @property
    def record_file(self) -> Path:
        """Where its record is kept."""
        return RECORDS / f"{self.name}.json"

    def described(self) -> dict[str, Any]:
        """What its script says of it, as its record has it."""
        return {
            "format": FORMAT, "version": VERSION, "case": self.name, "title": self.title,
            "script": self.script, "layout": self.layout, "note": self.note,
            "quantity": asdict(self.quantity), "models": list(self.models),
            "values": [
                {**asdict(value), "interval": list(value.interval),
                 "source": {"key": value.source, **SOURCES[value.source]}}
                for value in self.values
            ],
        }  # fmt: skip

    def record(self) -> dict[str, Any]:
        """As it is kept."""
        found: dict[str, Any] = json.loads(self.record_file.read_text("utf-8"))
        return found

    def read(self, role: str = "") -> Scene:
        """The scene of a role, from its file."""
        return read_scene(self.scene_file(role))


CASES: dict[str, Case] = {}


def case(
    name: str,
    title: str,
    *values: Value,
    models: tuple[str, ...] = PLANE,
    quantity: Quantity | None = None,
    layout: str = "published",
    note: str = "",
) -> Callable[[Build], Build]:
    """Registers the function below it, which makes the scene or the two of a parameter."""

    def register(build: Build) -> Build:
        script = f"benchmarks/bench/cases/{build.__module__.rsplit('.', 1)[-1]}.py"
        if not re.fullmatch(r"[a-z0-9-]+", name) or name in CASES:
            raise ValueError(f"the name of a case must be new, of a-z, 0-9 and -, got {name!r}")
        CASES[name] = Case(
            name, title, build, script, values, models, quantity or Quantity(), layout, note
        )
        return build

    return register


def cases(pattern: str = "*") -> Iterator[Case]:
    """All cases whose name matches, in the order of their scripts."""
    for module in MODULES:
        import_module(f"benchmarks.bench.cases.{module}")
    found = [each for each in CASES.values() if fnmatchcase(each.name, pattern)]
    if not found:
        raise SystemExit(f"no case matches {pattern!r}; python -m benchmarks bench list shows all")
    yield from found


def make(each: Case) -> None:
    """Write scene files and record; brackets are kept where the scene is the same as before."""
    for folder in (SCENES, RECORDS):
        folder.mkdir(exist_ok=True)
    scenes = {}
    for role in each.roles:
        document = scene_to_dict(each.scenes[role])
        content = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode("utf-8")
        write_file(each.scene_file(role), content)
        scenes[role] = {
            "file": f"benchmarks/bench/scenes/{each.scene_file(role).name}",
            "sha256": hashlib.sha256(content).hexdigest(),
            "blocks": len(each.scenes[role].free),
            "contacts": len(each.scenes[role].contacts),
        }
    before = each.record() if each.record_file.exists() else {}
    brackets = before.get("brackets", {}) if before.get("scenes") == scenes else {}
    kept = {model: brackets[model] for model in each.models if model in brackets}
    write_record(each, {**each.described(), "scenes": scenes, "brackets": kept})


ORDER = (
    "format", "version", "case", "title", "script", "scenes", "layout", "note", "quantity",
    "models", "values", "brackets",
)  # fmt: skip
"""Of what stands in a record."""


def write_record(each: Case, record: Mapping[str, Any]) -> None:
    """In one step, so that an interruption leaves the old one."""
    record = {key: record[key] for key in ORDER}
    text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
    write_file(each.record_file, text.encode("utf-8"))


def holds(value: Mapping[str, Any], bracket: Mapping[str, Any]) -> bool:
    """Whether some number printed like this lies in the bracket."""
    low, high = value["interval"]
    lower, upper = bracket["lower"], bracket["upper"]
    return lower is not None and upper is not None and bool(low <= upper and high >= lower)

"""Cases: records of what is known of a structure, and the scene files that they name."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from cvxlimit import Scene
from cvxlimit.base.files import write_file
from cvxlimit.io import read_scene, scene_to_dict

HOME = Path(__file__).parent
ROOT = HOME.parents[1]
SCENES, RECORDS, STATES = HOME / "scenes", HOME / "records", HOME / "states"

SOURCES: dict[str, dict[str, str]] = json.loads((HOME / "sources.json").read_text("utf-8"))
"""Works that published values come from, by key. ``seen`` says how a value reached this bench:
``"opened"``, it was read in the work itself or in one that quotes it (then ``through`` says which);
``"reference"``, it stands in the reference values that this package is tested against;
``"derived"``, it follows from statics; ``"computed"``, by another program, for this bench."""

PLANE = ("conic", "octagon", "vertex-forces", "vertex-octagon")
"""What tools claim to compute. Where nothing twists other models say the same."""

READINGS = ("independent", "signed", "paper")
"""Of the interaction with bending (Eq. 30)."""


@dataclass(frozen=True)
class Case:
    """A case by its name."""

    name: str

    @property
    def record_file(self) -> Path:
        """Where its record is kept."""
        return RECORDS / f"{self.name}.json"

    def record(self) -> dict[str, Any]:
        """What is known of it, as ``record.schema.json`` says."""
        found: dict[str, Any] = json.loads(self.record_file.read_text("utf-8"))
        return found

    def write(self, record: Mapping[str, Any]) -> None:
        """Keep the record, in one step, so that an interruption leaves the old one."""
        text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
        write_file(self.record_file, text.encode("utf-8"))

    @property
    def roles(self) -> tuple[str, ...]:
        """Of its scenes: one without a role, or "falls" and "stands"."""
        return tuple(self.record()["scenes"])

    @property
    def factor(self) -> float:
        """The quantity of its values over the load factor."""
        return float(self.record()["quantity"]["factor"])

    def scene_name(self, role: str = "") -> str:
        """The name of a role's scene, and the stem of its file."""
        return f"{self.name}.{role}" if role else self.name

    def scene_file(self, role: str = "") -> Path:
        """Where the scene of a role is kept."""
        return SCENES / f"{self.scene_name(role)}.json"

    def read(self, role: str = "") -> Scene:
        """The scene of a role, from its file."""
        return read_scene(self.scene_file(role))


def cases(pattern: str = "*") -> Iterator[Case]:
    """All cases whose name matches, by name."""
    names = sorted(path.stem for path in RECORDS.glob("*.json"))
    found = [name for name in names if fnmatchcase(name, pattern)]
    if not found:
        raise SystemExit(f"no case matches {pattern!r}; python -m benchmarks bench list shows all")
    yield from map(Case, found)


def add(
    name: str, title: str, scenes: Scene | Mapping[str, Scene], values: Sequence[Mapping[str, str]],
    *, models: Sequence[str] = PLANE, quantity: Mapping[str, Any] | None = None,
    layout: str = "published", note: str = "",
) -> Case:  # fmt: skip
    """Write the scene files and the record of a case, whose brackets are then to be proved.

    ``scenes`` are two, "falls" and "stands", where ``quantity`` has a "parameter" of each. A value
    has the ``text`` as printed, the key of its ``source``, and where they are not "closed form",
    "conic" and "agrees" its ``kind``, the ``model`` it is held against and its ``discrepancy``;
    unless it agrees one sentence says ``why``.
    """
    case, kept = Case(name), {}
    for role, scene in ({"": scenes} if isinstance(scenes, Scene) else scenes).items():
        file = case.scene_file(role)
        document = scene_to_dict(scene.with_name(file.stem))
        content = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode("utf-8")
        write_file(file, content)
        kept[role] = {
            "file": f"benchmarks/bench/scenes/{file.name}",
            "sha256": hashlib.sha256(content).hexdigest(),
            "blocks": len(scene.free), "contacts": len(scene.contacts),
        }  # fmt: skip
    plain = {"name": "load factor", "unit": "", "factor": 1.0, "parameter": None}
    case.write({
        "format": "cvxlimit-bench-record", "version": 1, "case": name, "title": title,
        "scenes": kept, "layout": layout, "note": note, "quantity": {**plain, **(quantity or {})},
        "models": list(models), "values": [described(**value) for value in values], "brackets": {},
    })  # fmt: skip
    return case


def described(
    text: str, source: str, kind: str = "closed form", model: str = "conic",
    discrepancy: str = "agrees", why: str = "",
) -> dict[str, Any]:  # fmt: skip
    """A value as records have it: with its work, and all numbers that are printed like it.

    >>> described("0.643", "statics")["interval"]
    [0.6425, 0.6435]
    """
    half = Decimal(text).as_tuple().exponent
    assert isinstance(half, int)
    reach = 0.5 * 10.0**half
    return {
        "text": text, "source": {"key": source, **SOURCES[source]}, "kind": kind, "model": model,
        "discrepancy": discrepancy, "why": why,
        "interval": [float(text) - reach, float(text) + reach],
    }  # fmt: skip


def holds(value: Mapping[str, Any], bracket: Mapping[str, Any]) -> bool:
    """Whether some number printed like this lies in the bracket."""
    low, high = value["interval"]
    lower, upper = bracket["lower"], bracket["upper"]
    return lower is not None and upper is not None and bool(low <= upper and high >= lower)

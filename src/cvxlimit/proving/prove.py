"""One verb for results, load domains, paths and sweeps: do they hold the proof of what they say?

What is proved goes one way: a format's prover, found at the door ``cvxlimit.proofs``, lists the
claims of what it is given as :class:`~cvxlimit.proof.checks.Check`, each held against what was made
anew of the forces, mechanisms and displacements beside it. A :class:`Proof` is that list.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from cvxlimit.base.doors import Door
from cvxlimit.errors import InputError
from cvxlimit.io.fields import file_prefix, read_document, refusals, shown
from cvxlimit.io.scenes import scene_digest
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.proof.checks import Check, Kind
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene, check_scene

Scenes = Scene | Callable[..., Scene]

Prover = Callable[[Any, Scenes | None, Mapping[str, Any]], "Proof"]
"""Proves what is held, or what its file holds, of a scene and of surfaces and moments of one's own:
what stands at the door ``cvxlimit.proofs``, by format."""

BOTH_CASES = {"dead", "live"}


@dataclass(frozen=True)
class Proof:
    """What was claimed, and whether it is proved.

    Attributes
    ----------
    about : str
        What was looked at.
    checks : tuple of Check
        Every claim, with what it rests on, or why it is not proved; and what was not looked at.

    Example
    -------
    >>> from cvxlimit import builtin_scene, prove, solve
    >>> proof = prove(solve(builtin_scene("stack")))
    >>> proof.is_proved, len(proof.of("proved")), proof.of("not looked at")[0].claim
    (True, 3, 'history')
    """

    about: str
    checks: tuple[Check, ...]

    @property
    def is_proved(self) -> bool:
        """True if something is proved, and nothing that was looked at fails."""
        return bool(self.of("proved")) and all(check.is_met for check in self.checks)

    def of(self, kind: Kind) -> tuple[Check, ...]:
        """What is proved, what follows from that, or what was not looked at."""
        return tuple(check for check in self.checks if check.is_met and check.kind == kind)

    @property
    def missing(self) -> tuple[Check, ...]:
        """The claims that are not proved."""
        return tuple(check for check in self.checks if not check.is_met)

    @property
    def rows(self) -> list[str]:
        """A line for each claim that is proved, or is not, one for all that follow from these, and
        one for what was not looked at."""
        alone = [str(c) for c in self.checks if not c.is_met or c.kind == "proved"]
        for kind in get_args(Kind)[1:]:
            others = dict.fromkeys(
                f"{c.claim} ({c.found})" if c.found else c.claim for c in self.of(kind)
            )
            alone += [f"{kind}: {', '.join(others)}"] if others else []
        return alone

    def __str__(self) -> str:
        return "\n".join([self.about, *self.rows])


def prove(
    what: Any,
    scene: Scenes | None = None,
    *,
    surface: Any = None,
    moments: str | Moments | None = None,
    formulation: Formulation = corner_compressions,
) -> Proof:
    """Prove a result, a load domain, a path or a sweep again, from the forces and mechanisms that
    it holds.

    Nothing that it says is believed: load factors, bounds, points and half-spaces are computed
    anew, and one that comes out otherwise, by more than 1e-7 of it, is not proved. Nor is a status,
    a unit or a share of dilatancy that does not follow from these; what is not looked at, notes and
    times for example, is named (:meth:`Proof.of`). No load factor is sought by a solver, but for
    the brackets of a path, whose displacements are what is believed.

    Parameters
    ----------
    what : Solution, LoadDomain, Path or path of a file
        Or a result file, a domain file, a path file, the folder of a sweep.
    scene : Scene, callable or None
        Files hold a digest of their scene, and not the scene itself, but for those of paths. Needed
        unless ``what`` has it, it is a built-in scene, or a sweep that varies one scene; for a
        sweep over a function, that function.
    surface, moments, formulation
        As for :func:`cvxlimit.solve`, where they are one's own; others are named in what is held.

    Returns
    -------
    Proof

    Raises
    ------
    InputError
        If a file cannot be read or belongs to another scene, or if scene, surface or moments are
        needed and not given.

    Example
    -------
    >>> from dataclasses import replace
    >>> from cvxlimit import builtin_scene, prove, solve
    >>> solution = solve(builtin_scene("stack"))
    >>> changed = replace(solution, load_factor=1.1 * solution.load_factor)
    >>> prove(changed).is_proved
    False
    """
    own = {"surface": surface, "moments": moments, "formulation": formulation}
    if not isinstance(what, str | os.PathLike):
        return _prover_of(getattr(what, "format", None))(what, scene, own)
    if os.path.isdir(what):
        return _prover_of("cvxlimit-sweep")(Path(what), scene, own)
    with refusals(file_prefix(what)):
        document = read_document(what)
        kind = document.get("format") if isinstance(document, dict) else None
        return _prover_of(kind)(document, scene, own)


def _prover_of(kind: Any) -> Prover:
    """What the core, an extension or another distribution proves a format by."""
    proofs, found = Door("cvxlimit.proofs"), None
    if isinstance(kind, str):
        proofs.check(kind, f"what proves {kind}")
        found = proofs.get(kind)
    if found is None:
        raise InputError(
            "a result, a load domain, a path or the folder of a sweep can be proved, got format "
            f"{shown(kind)}: solve --json, domain --json, pushover --json and sweep --output write "
            "them"
        )
    return found


def scene_of(name: str, digest: str, scene: Scenes | None, cases: set[str]) -> Scene:
    """The scene that something is of, which must be the one given."""
    if scene is None:
        if name not in BUILTIN:
            raise InputError(
                f"it does not hold its scene {name!r}, only a digest of it: give the scene "
                "(--scene FILE, or prove(..., scene))"
            )
        scene = builtin_scene(name)
    check_scene(scene)
    assert isinstance(scene, Scene)
    if digest and digest != scene_digest(scene, sorted(cases)):
        raise InputError(
            f"it is of another scene {name!r} than the one given, {scene.name!r}: their digests "
            "differ; give the scene that was solved"
        )
    return scene

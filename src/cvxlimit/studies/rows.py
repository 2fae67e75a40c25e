"""One variation after another: what scenes of the same geometry share is computed once."""

from __future__ import annotations

import pickle
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import Signature, signature
from typing import Any

import cloudpickle
import numpy as np
from threadpoolctl import threadpool_limits

from cvxlimit.errors import CvxlimitError, InputError, ModelError
from cvxlimit.methods.solving import solve
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.reductions.repeated import Repeats
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution, Status
from cvxlimit.studies.variations import varied

Row = dict[str, Any]

FIGURES = ("load_factor", "lower", "upper", "gap")
TEXTS = ("status", "note", "error", "solver")
RESULTS = (*FIGURES, *TEXTS, "seconds")
"""Columns of a sweep besides its parameters."""

OPTIONS = tuple(name for name in signature(solve).parameters if name not in ("scene", "progress"))
"""Options of :func:`cvxlimit.solve`, which may be parameters of a sweep as well."""

_STRUCTURES = 4
"""Geometries whose mechanics are kept: parameters that change the geometry come in random order,
and that of 1,000 contacts takes 20 MB."""

_STUDIES = 2
"""Studies that a worker keeps: this one, and one that overlaps with it."""


class Structures:
    """Contacts and mechanics of the geometries seen last.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> known = Structures()
    >>> first, second = (known.mechanics(builtin_scene("stack")) for _ in range(2))
    >>> first.balance is second.balance
    True
    """

    def __init__(self) -> None:
        self._known: OrderedDict[str, Assemblage] = OrderedDict()

    def mechanics(self, scene: Scene) -> Scene | Assemblage:
        """The scene with the contacts, equilibrium and factorisation of one of its geometry.

        Scenes with ties, and with mortar that bears tension, keep to themselves: their contacts
        follow from more than geometry, their loads from their strength.
        """
        if scene.ties or scene.tensile_strength or scene.contact_tensile_strength:
            return scene
        known = self._known.get(scene.geometry)
        if known is None:
            made = replace(Assemblage.of(scene), repeats=Repeats())
            self._known[scene.geometry] = made
            if len(self._known) > _STRUCTURES:
                self._known.popitem(last=False)
            return made
        self._known.move_to_end(scene.geometry)
        return known.like(scene.sharing_contacts_of(known.scene))


@dataclass(frozen=True, eq=False)
class Study:
    """What is done with every variation.

    Attributes
    ----------
    scenes : callable or Scene
        From parameters to a scene; a scene is varied by :func:`varied`.
    options : mapping
        Of :func:`cvxlimit.solve`.
    measure : callable or None
        From a solution to further columns, by name.
    """

    scenes: Callable[..., Scene] | Scene
    options: Mapping[str, Any] = field(default_factory=dict)
    measure: Callable[[Solution], Mapping[str, Any]] | None = None

    @property
    def factory(self) -> Callable[..., Scene]:
        """From parameters to a scene."""
        given = self.scenes
        if isinstance(given, Scene):
            return lambda **parameters: varied(given, **parameters)
        return given

    @property
    def _called(self) -> Signature:
        return signature(varied) if isinstance(self.scenes, Scene) else signature(self.scenes)

    def split(self, variation: Mapping[str, Any]) -> tuple[Row, Row]:
        """The factory's parameters and those of :func:`cvxlimit.solve`."""
        own = self._called.parameters
        for_solve = {k: v for k, v in variation.items() if k in OPTIONS and k not in own}
        return {k: v for k, v in variation.items() if k not in for_solve}, for_solve

    def check(self, variation: Mapping[str, Any]) -> None:
        """Refuse parameters that the factory does not have, before anything is solved.

        Raises
        ------
        InputError
        """
        parameters, _ = self.split(variation)
        is_scene, called = isinstance(self.scenes, Scene), self._called
        try:
            called.bind(*([self.scenes] if is_scene else []), **parameters)
        except TypeError as error:
            name = "varied" if is_scene else getattr(self.scenes, "__name__", "the factory")
            known = [k for k in called.parameters if not (is_scene and k == "scene")]
            raise InputError(
                f"{name} cannot be called with {', '.join(parameters) or 'no parameter'}: {error}; "
                f"its parameters are {', '.join(known)}"
            ) from error

    def row(self, variation: Mapping[str, Any], known: Structures) -> Row:
        """Solve one variation; whatever goes wrong is the row's ``error``."""
        start = time.perf_counter()
        result: Row = dict.fromkeys(FIGURES, np.nan) | dict.fromkeys(TEXTS, "")
        try:
            result |= self._solved(variation, known)
        except CvxlimitError as error:
            result["error"] = str(error)
        except Exception as error:  # a factory may raise what it likes; the row keeps the reason
            result["error"] = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        return result | {"seconds": time.perf_counter() - start}

    def _solved(self, variation: Mapping[str, Any], known: Structures) -> Row:
        parameters, options = self.split(variation)
        scene = self.factory(**parameters)
        check_scene(scene)
        solution = solve(known.mechanics(scene), **{**self.options, **options})
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        figures: Row = {
            "load_factor": np.nan if solution.load_factor is None else solution.load_factor,
            "lower": solution.lower,
            "upper": solution.upper,
            "gap": solution.gap,
            "status": str(solution.status),
            "note": solution.note,
            "solver": solution.history[-1].solver if solution.history else "",
        }
        return figures | dict(self.measure(solution) if self.measure else {})


def packed(study: Study) -> bytes:
    """The study for other processes; functions of a script or notebook go along by value.

    Raises
    ------
    ModelError
        If a part of it cannot be sent.
    """
    try:
        result: bytes = cloudpickle.dumps(study)
    except Exception as error:  # pickling asks the objects, which may raise what they like
        raise ModelError(
            "the factory, the options or the measure cannot be sent to another process: "
            f"{' '.join(str(error).split())[:200]}"
        ) from error
    return result


class _Kept(threading.local):
    """Studies of one thread: workers of a cluster may have several."""

    def __init__(self) -> None:
        self.studies: OrderedDict[str, tuple[Study, Structures]] = OrderedDict()


_kept = _Kept()


def work(name: str, study: bytes, variations: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Rows of some variations, in whatever process this is called; ``name`` is the study's.

    The study is unpacked once per thread, which keeps the mechanics of its structures.
    """
    seen = _kept.studies
    if name not in seen:
        seen[name] = pickle.loads(study), Structures()
        if len(seen) > _STUDIES:
            seen.popitem(last=False)
    found, known = seen[name]
    with threadpool_limits(1):
        return [found.row(variation, known) for variation in variations]

"""Doors: what the core, its extensions and other distributions offer by name.

A door is a group of entry points, ``cvxlimit.methods`` for example. What this package offers there
stands in one table, ``offered.py``, and what an extension offers in its folder's ``OFFERED``, as
``"module:attribute"``, which is imported when the name is asked for. A name that neither has is
looked up among the entry points of installed distributions: so another package adds a method, a
reader or a picture, and nothing here knows of it. A name of an extension of this package that is
not here is refused as :class:`~cvxlimit.errors.MissingExtension`.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from cvxlimit.errors import MissingExtension, ModelError

Offered = Mapping[str, Mapping[str, str]]
"""By group the places of names, as ``"module:attribute"``."""

_PLACES: dict[str, dict[str, str]] = {}

_ABSENT: dict[tuple[str, str], str] = {}
"""Extensions that are not here, by group and name of what they would offer."""


def offer(offered: Offered) -> None:
    """Adds names to doors; the package does so for its own, and those of its extensions, once."""
    for group, places in offered.items():
        _PLACES.setdefault(group, {}).update(places)


def lack(extension: str, names: Mapping[str, str]) -> None:
    """Says of an extension that it is not here, and which ``names``, in a line per group, it would
    have offered."""
    for group, line in names.items():
        _ABSENT.update(dict.fromkeys(((group, name) for name in line.split()), extension))


def loaded(place: str) -> Any:
    """What stands at a place, ``"module:attribute"``."""
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)


def installed(group: str) -> dict[str, Any]:
    """The entry points of a group, by name, of all distributions that are installed."""
    from importlib.metadata import entry_points  # 20 ms, rarely needed

    return {entry.name: entry for entry in entry_points(group=group)}


class Door(UserDict[str, Any]):
    """What is offered in a group, by name.

    It lists what this package and its extensions offer, beside the values in ``own`` and those that
    a program sets, which need no place; what is installed besides is found when its name is asked
    for. ``places`` has where the first ones are, for who wants to know without loading them.

    Example
    -------
    >>> Door("cvxlimit.methods")["convex"].__name__
    'Convex'
    """

    def __init__(self, group: str, own: Mapping[str, Any] | None = None) -> None:
        super().__init__(own or {})
        self.group, self.places, self._own = group, _PLACES.setdefault(group, {}), [*self.data]
        self._found: dict[str, Any] = {}  # elsewhere, None where nobody has the name

    def _offered(self, name: Any) -> Any:
        """What has the name; None if nobody has it."""
        if name in self.data:
            return self.data[name]
        if name in self.places:
            self.data[name] = loaded(self.places[name])
            return self.data[name]
        if name not in self._found:
            entry = installed(self.group).get(name)
            self._found[name] = None if entry is None else self._of_another(entry)
        return self._found[name]

    def _of_another(self, entry: Any) -> Any:
        try:
            return entry.load()
        except Exception as error:  # whatever its modules do as they are imported
            package = "" if entry.dist is None else f" of package {entry.dist.name!r}"
            raise ModelError(
                f"{self.kind} {entry.name!r}{package} cannot be imported "
                f"({type(error).__name__}: {error}): ask its author"
            ) from error

    @property
    def kind(self) -> str:
        """What one of its names is called: "method", for example."""
        return self.group.removeprefix("cvxlimit.").removesuffix("s")

    def __missing__(self, name: str) -> Any:
        if (found := self._offered(name)) is None:
            self.check(name)
            raise KeyError(name)
        return found

    def __contains__(self, name: object) -> bool:
        return self._offered(name) is not None

    def get(self, name: Any, default: Any = None) -> Any:
        """What has the name, or the ``default``: missing extensions are for who asks for them."""
        found = self._offered(name)
        return default if found is None else found

    def missing(self, name: str, what: str = "") -> MissingExtension | None:
        """The refusal of a name of an extension that is not here: that ``what`` is asked for, or
        else the name and of which kind it is; None for other names, known or not."""
        extension = _ABSENT.get((self.group, name))
        if extension is None or name in self:
            return None
        return MissingExtension.of(what or f"{self.kind} {name!r}", extension)

    def check(self, name: str, what: str = "") -> None:
        """Raises what :meth:`missing` says, if anything."""
        if (refusal := self.missing(name, what)) is not None:
            raise refusal

    def __iter__(self) -> Iterator[str]:
        every = dict.fromkeys([*self._own, *self.places, *self.data])
        return (name for name in every if name in self.data or name in self.places)

    def __len__(self) -> int:
        return len({*self})

    @property
    def names(self) -> list[str]:
        """All names that can be asked for, those of other distributions among them."""
        return list(dict.fromkeys([*self, *installed(self.group)]))

    def needed(self, name: str, what: str) -> Any:
        """What has the name; where nobody offers it, that is refused: ``what`` is asked for.

        Raises
        ------
        ModelError
            If it is not here.
        """
        if (found := self.get(name)) is None:
            self.check(name, what)
            raise ModelError(f"{what} is not part of this installation: nothing offers {name!r}")
        return found


def attached(name: str) -> Any:
    """The function that does the work of a method above its class: ``scene.plot()`` reads better
    than a function of its own, but pictures see scenes, not they them."""
    return Door("cvxlimit.readings").needed(name, name.replace("_", ".", 1))

"""Doors: what the core, its extensions and other distributions offer by name.

A door is a group of entry points, ``cvxlimit.methods`` for example. What this package offers there
stands in one table, ``offered.py``, and what an extension offers in its folder's ``OFFERED``, as
``"module:attribute"``, which is imported when the name is asked for. A name that neither has is
looked up among the entry points of installed distributions: so another package adds a method, a
reader or a picture, and nothing here knows of it.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

Offered = Mapping[str, Mapping[str, str]]
"""By group the places of names, as ``"module:attribute"``."""

_PLACES: dict[str, dict[str, str]] = {}


def offer(offered: Offered) -> None:
    """Adds names to doors; the package does so for its own, and those of its extensions, once."""
    for group, places in offered.items():
        _PLACES.setdefault(group, {}).update(places)


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
    for.

    Example
    -------
    >>> Door("cvxlimit.methods")["convex"].__name__
    'Convex'
    """

    def __init__(self, group: str, own: Mapping[str, Any] | None = None) -> None:
        super().__init__(own or {})
        self.group, self._places, self._own = group, _PLACES.setdefault(group, {}), [*self.data]
        self._found: dict[str, Any] = {}  # elsewhere, None where nobody has the name

    def __missing__(self, name: str) -> Any:
        if name in self._places:
            self.data[name] = loaded(self._places[name])
            return self.data[name]
        if name not in self._found:
            entry = installed(self.group).get(name)
            self._found[name] = None if entry is None else entry.load()
        if self._found[name] is None:
            raise KeyError(name)
        return self._found[name]

    __contains__ = Mapping.__contains__  # by asking for it

    def __iter__(self) -> Iterator[str]:
        every = dict.fromkeys([*self._own, *self._places, *self.data])
        return (name for name in every if name in self.data or name in self._places)

    def __len__(self) -> int:
        return len({*self})

    @property
    def names(self) -> list[str]:
        """All names that can be asked for, those of other distributions among them."""
        return list(dict.fromkeys([*self, *installed(self.group)]))

    def needed(self, name: str, what: str) -> Any:
        """What has the name; where no folder offers it, that is refused.

        Raises
        ------
        ModelError
            If it is not here.
        """
        if (found := self.get(name)) is None:
            from cvxlimit.errors import ModelError  # which loads NumPy

            raise ModelError(f"{what} not part of this installation: nothing offers {name!r}")
        return found


def attached(name: str) -> Any:
    """The function that does the work of a method above its class: ``scene.plot()`` reads better
    than a function of its own, but pictures see scenes, not they them."""
    return Door("cvxlimit.readings").needed(name, f"{name.replace('_', '.', 1)} is")

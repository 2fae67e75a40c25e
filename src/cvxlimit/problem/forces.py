"""Force components by contact, as CVXPY expressions, and contacts by what users call them."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.atoms.affine.binary_operators import MulExpression

from cvxlimit.base.checks import meant
from cvxlimit.errors import ModelError


class ContactForces(MulExpression):
    """A force component of all contacts, one row each; ``names`` are the contacts'."""

    def __init__(self, matrix: Any, unknown: Any, names: Sequence[str] = ()) -> None:
        self.names = names
        super().__init__(matrix, unknown)

    def __getitem__(self, contact: Any) -> Any:
        if not isinstance(contact, str):
            return super().__getitem__(contact)
        row = contact_number(contact, self.names)
        matrix = cp.Constant(self.args[0].value[[row]], name=f"{self.args[0].name()}[{contact}]")
        return (matrix @ self.args[1])[0]


def contact_number(
    contact: Any, names: Sequence[str], pairs: Sequence[tuple[str, str]] = ()
) -> int:
    """The number of a contact, given that, its name, or its two blocks in any order.

    Raises
    ------
    ModelError
        If there is none, or more than one between these blocks.
    """
    if isinstance(contact, str):
        if contact in names:
            return list(names).index(contact)
        hint = meant(contact, names, f"they are {reprlib.repr(list(names))}")
        raise ModelError(f"there is no contact {contact!r}: {hint}")
    if isinstance(contact, (tuple, list)) and len(contact) == 2:
        between = [i for i, pair in enumerate(pairs) if set(pair) == set(contact)]
        if len(between) == 1:
            return between[0]
        if between:
            every = ", ".join(repr(names[i]) for i in between)
            raise ModelError(
                f"there are {len(between)} contacts between {contact}: name one, {every}"
            )
        of = {block for pair in pairs for block in pair}
        missing = [block for block in contact if block not in of]
        hint = "these blocks do not touch"
        if missing:
            hint = f"no contact has a block {missing[0]!r}" + meant(missing[0], of, before="; ")
        raise ModelError(f"there is no contact between {contact}: {hint}")
    is_number = isinstance(contact, (int, np.integer)) and not isinstance(contact, bool)
    if is_number and -len(names) <= contact < len(names):
        return int(contact) % len(names)
    raise ModelError(
        f"a contact is given by its name, its two blocks or its number below {len(names)}, got "
        f"{contact!r}"
    )

"""The numbers behind states of contacts, measured in docs/evidence/closing.md.

Only speed and width depend on them: bounds are checked outside of all problems. Places are
fractions of the half extents of contacts.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SupportSettings:
    """Support functions, arms and shapes of contacts."""

    pieces: int = 8  # into which an edge is cut at a time
    most_pieces: int = 100_000  # at once, beyond which memory counts for more than closeness
    boxes: float = 1e-8  # width of enclosures over edges and boxes, over the largest power in play
    most_whole: int = 500  # polygons whose arms, 5 ms each, are bounded even of whole contacts
    cells: int = 4  # along a polygon's sides, two or more along its box's: bounds with 8 are alike
    digits: int = 40  # binary ones of a polygon's size in which equal ones agree
    stations: int = 48  # positions along a contact that ends of inscribed rectangles try,
    angles: int = 24  # and directions, besides those of the contact's edges
    grid: int = 21  # pressure centres per axis at which their arms are compared
    margin: float = 0.99  # share of the least ratio of arms there: what may lie between
    friction: float = 1e-3  # least in the balance of product bounds, to keep that finite
    idle: float = 0.3  # least share of it for the half of a moment that is zero at the point
    central: float = 1e-4  # share of a side from an axis within which centres may cross that
    # Least share of a range that a child gets, so that ranges shrink, and up to which a cut is made
    # at zero where both signs are left.
    narrowest: float = 0.2


SUPPORT = SupportSettings()

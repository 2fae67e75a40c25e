"""The error tree: everything cvxlimit raises on purpose is a :class:`CvxlimitError`.

Messages are one sentence that names the object, shows the value and suggests the cure.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


class CvxlimitError(Exception):
    """Base class of all errors raised by cvxlimit."""


class InputError(CvxlimitError, ValueError):
    """The scene, its geometry or a scene file is not valid."""


class GeometryError(InputError):
    """Blocks that are no bodies, or not where bodies can be.

    Attributes
    ----------
    points : (k, 3) array
        Where it is wrong, in the scene's length unit: ends of open edges, corners of a crossed
        face, the middle of an overlap. For a picture of the culprit.
    blocks : tuple of str
        Ids of the blocks concerned.
    body : object or None
        The refused body of a geometry file.
    """

    body: object = None

    def __init__(self, message: str, points: ArrayLike = (), blocks: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.points = np.asarray(points, dtype=float).reshape(-1, 3)
        self.blocks = blocks


class ModelError(CvxlimitError, ValueError):
    """The choice of surfaces, facets, formulation or method is not valid."""


class NoAnswerError(ModelError):
    """What is asked for does not exist: the dead load cannot stand, or the live load does no
    harm."""


class SolverError(CvxlimitError, RuntimeError):
    """No installed solver could be run on the problem."""

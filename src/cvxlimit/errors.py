"""The error tree: everything cvxlimit raises on purpose is a :class:`CvxlimitError`.

Messages are one sentence that names the object, shows the value and suggests the cure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
        import numpy as np  # 0.1 s that --help can do without

        self.points = np.asarray(points, dtype=float).reshape(-1, 3)
        self.blocks = blocks


class ModelError(CvxlimitError, ValueError):
    """The choice of surfaces, facets, formulation or method is not valid."""


class MissingExtension(ModelError, ModuleNotFoundError):  # noqa: N818 - the name says it
    """What is asked for is of an extension that is not part of this installation.

    Attributes
    ----------
    extension : str
        Its folder below ``cvxlimit/extensions``.
    """

    def __init__(self, message: str, extension: str = "") -> None:
        super().__init__(message)
        self.extension = extension

    @classmethod
    def of(cls, what: str, extension: str) -> MissingExtension:
        """That ``what`` is of the ``extension``, and how that is installed.

        >>> print(MissingExtension.of("method 'certified'", "interaction"))
        method 'certified' is of extension 'interaction', which is not part of this installation: \
pip install --force-reinstall cvxlimit brings it
        """
        return cls(
            f"{what} is of extension {extension!r}, which is not part of this installation: pip "
            "install --force-reinstall cvxlimit brings it",
            extension,
        )


class NoAnswerError(ModelError):
    """What is asked for does not exist: the dead load cannot stand, or the live load does no
    harm."""


class SolverError(CvxlimitError, RuntimeError):
    """No installed solver could be run on the problem."""

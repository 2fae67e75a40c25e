"""The error tree: everything cvxlimit raises on purpose is a :class:`CvxlimitError`.

Messages are one sentence that names the object, shows the value and suggests the cure.
"""


class CvxlimitError(Exception):
    """Base class of all errors raised by cvxlimit."""


class InputError(CvxlimitError, ValueError):
    """The scene, its geometry or a scene file is not valid."""


class ModelError(CvxlimitError, ValueError):
    """The choice of surfaces, facets, formulation or method is not valid."""


class SolverError(CvxlimitError, RuntimeError):
    """No installed solver could be run on the problem."""

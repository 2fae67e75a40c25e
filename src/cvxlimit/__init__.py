"""cvxlimit: certified collapse loads of dry-jointed masonry.

A scene goes in; a load factor with a bracket recomputed outside the solver, contact forces and the
collapse mechanism come out. Start with :func:`solve` and :func:`builtin_scene`.

A module is loaded when a name of it is first asked for: CVXPY and SciPy take a second, during which
the command line must be able to answer Ctrl-C.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cvxlimit.versions import __version__ as __version__

if TYPE_CHECKING:
    from cvxlimit import compare as compare
    from cvxlimit import errors as errors
    from cvxlimit import geometry as geometry
    from cvxlimit import io as io
    from cvxlimit import loads as loads
    from cvxlimit import masonry as masonry
    from cvxlimit import methods as methods
    from cvxlimit import model as model
    from cvxlimit import plotting as plotting
    from cvxlimit import proof as proof
    from cvxlimit import reductions as reductions
    from cvxlimit import scene as scene
    from cvxlimit import solution as solution
    from cvxlimit import solvers as solvers
    from cvxlimit import studies as studies
    from cvxlimit import surfaces as surfaces
    from cvxlimit.geometry.blocks import Block as Block
    from cvxlimit.geometry.contacts import COMPONENTS as COMPONENTS
    from cvxlimit.geometry.contacts import Contact as Contact
    from cvxlimit.geometry.contacts import Contacts as Contacts
    from cvxlimit.loads import GRAVITY as GRAVITY
    from cvxlimit.loads import Load as Load
    from cvxlimit.loads import PointForce as PointForce
    from cvxlimit.loads import Pressure as Pressure
    from cvxlimit.masonry import builtin_scene as builtin_scene
    from cvxlimit.methods.certified import Certified as Certified
    from cvxlimit.methods.convex import Convex as Convex
    from cvxlimit.methods.driver import Method as Method
    from cvxlimit.methods.driver import Run as Run
    from cvxlimit.methods.exact_friction import ExactFriction as ExactFriction
    from cvxlimit.methods.fixed_point import FixedPoint as FixedPoint
    from cvxlimit.methods.gilbert import Gilbert as Gilbert
    from cvxlimit.methods.settlement import settlement as settlement
    from cvxlimit.methods.solving import solve as solve
    from cvxlimit.methods.zero_dilatancy import ZeroDilatancy as ZeroDilatancy
    from cvxlimit.model.problem import LimitProblem as LimitProblem
    from cvxlimit.proof.certificate import Certificate as Certificate
    from cvxlimit.proof.certificate import Certifier as Certifier
    from cvxlimit.reductions.explaining import explain as explain
    from cvxlimit.scene import Scene as Scene
    from cvxlimit.scene import Units as Units
    from cvxlimit.solution import Iterate as Iterate
    from cvxlimit.solution import Member as Member
    from cvxlimit.solution import Solution as Solution
    from cvxlimit.solution import Status as Status
    from cvxlimit.studies.fragility import fragility as fragility
    from cvxlimit.studies.sweeping import sweep as sweep
    from cvxlimit.ties import Tie as Tie

_MODULES = (
    "compare", "errors", "geometry", "io", "loads", "masonry", "methods", "model",
    "plotting", "proof", "reductions", "scene", "solution", "solvers", "studies", "surfaces",
)  # fmt: skip

_HOME = {
    "COMPONENTS": "geometry.contacts",
    "GRAVITY": "loads",
    "Block": "geometry.blocks",
    "Certificate": "proof.certificate",
    "Certified": "methods.certified",
    "Certifier": "proof.certificate",
    "Contact": "geometry.contacts",
    "Contacts": "geometry.contacts",
    "Convex": "methods.convex",
    "ExactFriction": "methods.exact_friction",
    "FixedPoint": "methods.fixed_point",
    "Gilbert": "methods.gilbert",
    "Iterate": "solution",
    "LimitProblem": "model.problem",
    "Load": "loads",
    "Method": "methods.driver",
    "Member": "solution",
    "PointForce": "loads",
    "Pressure": "loads",
    "Run": "methods.driver",
    "Scene": "scene",
    "Solution": "solution",
    "Status": "solution",
    "Tie": "ties",
    "Units": "scene",
    "ZeroDilatancy": "methods.zero_dilatancy",
    "builtin_scene": "masonry",
    "explain": "reductions.explaining",
    "fragility": "studies.fragility",
    "settlement": "methods.settlement",
    "solve": "methods.solving",
    "sweep": "studies.sweeping",
}
"""The module of every public name; above once more, for type checkers."""

__all__ = ["__version__", *_MODULES, *_HOME]


if not TYPE_CHECKING:  # to type checkers it would make any name an attribute

    def __getattr__(name: str) -> Any:
        if name in _MODULES:
            return import_module(f"cvxlimit.{name}")
        if name == "analyse":
            raise ImportError("analyse has become solve, which takes the same options")
        if name not in _HOME:
            reason = f"module 'cvxlimit' has no attribute {name!r}"
            raise AttributeError(reason, name=name, obj=sys.modules[__name__])  # did you mean ...?
        value = getattr(import_module(f"cvxlimit.{_HOME[name]}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """What tab completion offers: public names, whether they are loaded or not."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})

"""cvxlimit: certified collapse loads of dry-jointed masonry.

A scene goes in; a load factor with a bracket recomputed outside the solver, contact forces and the
collapse mechanism come out. Start with :func:`solve` and :func:`builtin_scene`.
"""

import cvxlimit.compare as compare
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import COMPONENTS, Contact, Contacts
from cvxlimit.loads import GRAVITY, Load, PointForce, Pressure
from cvxlimit.masonry import builtin_scene
from cvxlimit.methods.analysis import analyse
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.methods.solving import solve
from cvxlimit.proof.certificate import Certificate, Certifier
from cvxlimit.scene import Scene, Units
from cvxlimit.solution import Iterate, Solution, Status

__all__ = [
    "COMPONENTS",
    "GRAVITY",
    "Block",
    "Certificate",
    "Certified",
    "Certifier",
    "Contact",
    "Contacts",
    "FixedPoint",
    "Iterate",
    "Load",
    "PointForce",
    "Pressure",
    "Scene",
    "Solution",
    "Status",
    "Units",
    "analyse",
    "builtin_scene",
    "compare",
    "solve",
]

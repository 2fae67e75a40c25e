"""cvxlimit: certified collapse loads of dry-jointed masonry.

A scene goes in; a load factor with a bracket recomputed outside the solver, contact forces and the
collapse mechanism come out. Start with :func:`solve` and :func:`builtin_scene`.
"""

from cvxlimit.analysis import analyse
from cvxlimit.blocks import Block
from cvxlimit.certificate import Certificate, Certifier
from cvxlimit.compare import compare
from cvxlimit.contacts import COMPONENTS, Contact, Contacts
from cvxlimit.interaction import Certified, FixedPoint
from cvxlimit.masonry import builtin_scene
from cvxlimit.scene import GRAVITY, Load, Scene, Units
from cvxlimit.solution import Iterate, Solution, Status
from cvxlimit.solve import solve

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
    "Scene",
    "Solution",
    "Status",
    "Units",
    "analyse",
    "builtin_scene",
    "compare",
    "solve",
]

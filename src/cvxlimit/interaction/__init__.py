"""Torsion-shear-bending interaction (Eq. 26-32): rules for the next convex problem, and drivers.

- ``pressure``: the physics, and the independent checker of Eq. 30;
- ``fixed_point``: the paper's iteration;
- ``safe_step``, ``inner``, ``rectangles``, ``lower_bound``: bounds from below;
- ``support``, ``copies``, ``hull``: bounds from above;
- ``branching``: both, closed by branch and bound on small scenes;
- ``certified``: the bracket made of these.
"""

from cvxlimit.interaction.certified import Certified
from cvxlimit.interaction.fixed_point import FixedPoint
from cvxlimit.interaction.pressure import interaction_excess

__all__ = ["Certified", "FixedPoint", "interaction_excess"]

"""Scenes: blocks, supports, friction, loads and ties."""

from cvxlimit.scene.loads import GRAVITY, Load, PointForce
from cvxlimit.scene.pressures import Pressure
from cvxlimit.scene.reactions import Reaction, Tie
from cvxlimit.scene.scene import Scene, check_scene
from cvxlimit.scene.units import METRES, Units

__all__ = [
    "GRAVITY", "METRES", "Load", "PointForce", "Pressure", "Reaction", "Scene", "Tie", "Units",
    "check_scene",
]  # fmt: skip

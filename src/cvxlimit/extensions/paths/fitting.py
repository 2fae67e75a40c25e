"""The motion of supports that best explains where blocks have been measured.

    min  sum |x_i(p) - m_i|^2   over p = (translation, rotation) of supports that move as one body

m_i are measured centroids, and x_i(p) those at the end of the path on which the supports move by p
under the dead load alone (:func:`cvxlimit.pushover`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, null_space
from scipy.optimize import least_squares

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.path import Path
from cvxlimit.extensions.paths.pushover import pushover
from cvxlimit.extensions.paths.resting import REACH, Rest
from cvxlimit.extensions.paths.starting import for_path
from cvxlimit.scene import Scene
from cvxlimit.scene.scene import check_scene
from cvxlimit.scene.settling import SupportMotion, check_motions

_STEP = 1e-4
"""Difference, over the contact size, by which derivatives are taken: the root of what iterates of a
path leave (1e-9), within a digit, so that neither that nor curvature counts."""


@dataclass(frozen=True, eq=False)
class FittedMotion:
    """A motion of supports, and what it does not explain.

    Attributes
    ----------
    motion : SupportMotion
        By which they have moved: lengths and radians are those of the whole movement.
    path : Path
        To there, with brackets.
    residuals : mapping of block id to (3,) array
        Measured position less that on the path (length).
    deviation : (6,) array
        Standard deviation of the motion's translation and rotation, if residuals are errors of the
        measurement, of one size and independent.
    """

    motion: SupportMotion
    path: Path
    residuals: Mapping[str, FloatArray]
    deviation: FloatArray

    @property
    def rest(self) -> float:
        """Root of the mean square of the distances (length)."""
        return float(np.sqrt(np.mean([r @ r for r in self.residuals.values()])))

    @property
    def headline(self) -> str:
        """What was found in one sentence, with the block that it explains worst."""
        unit, left = self.path.scene.units.length, self.residuals
        far = {name: float(np.abs(x).max()) for name, x in left.items()}
        worst = max(far, key=lambda name: far[name])
        way, turn = (np.round(x, 9) + 0.0 for x in (self.motion.direction, self.motion.rotation))
        x, y, z = (f"{d:.4g} ± {e:.1g}" for d, e in zip(way, self.deviation, strict=False))
        turned = f" and turned by {np.linalg.norm(turn):.4g} rad" * bool(turn.any())
        return (
            f"{', '.join(self.motion.supports)} moved by ({x}, {y}, {z}) {unit}{turned}: that "
            f"leaves {self.rest:.2g} {unit} of the measured positions (root mean square), most at "
            f"{worst}, {far[worst]:.2g} {unit}"
        )


def fitted_motion(
    scene: Scene,
    measured: Mapping[str, ArrayLike],
    supports: str | Sequence[str],
    *,
    turns: bool = False,
) -> FittedMotion:
    """The motion of supports under the dead load that best explains measured positions of blocks.

    Least squares over ends of paths, from where the measured blocks beside the supports have gone.
    A planar scene's supports move in its plane.

    Parameters
    ----------
    scene : Scene
        As it was built.
    measured : mapping of block id to (3,)
        Where centroids of blocks are now, supports that moved among them or not (length).
    supports : str or sequence of str
        Those that moved, as one rigid body.
    turns : bool
        Whether they may have turned as well, about the centroid of the first.

    Raises
    ------
    InputError
        For unknown blocks and supports, positions that are not finite, and too few of them.
    NoAnswerError
        Where the scene as it was built does not stand.

    Example
    -------
    >>> from cvxlimit import SupportMotion, fitted_motion, pushover
    >>> from cvxlimit.masonry import arch
    >>> scene = arch(4, 0.25, mean_radius=2.0)
    >>> moved = pushover(scene, motion=SupportMotion("right-abutment", (3, 0, -1)), until=0.02)
    >>> now = {b.id: b.centroid for b in moved[-1].scene().blocks if b.id in ("v2", "v3", "v4")}
    >>> found = fitted_motion(scene, now, "right-abutment")
    >>> print([round(x, 5) for x in found.motion.direction], found.rest < 1e-8)
    [0.01897, 0.0, -0.00632] True
    """
    check_scene(scene)
    names = (supports,) if isinstance(supports, str) else tuple(supports)
    fit = _Fit(scene, measured, names, turns)
    found = least_squares(fit.residuals, fit.begin, fit.slopes, xtol=1e-7)
    motion, path = fit.motion(found.x), fit.path(found.x, "last")
    free = max(len(found.fun) - len(found.x), 1)
    slopes = np.asarray(found.jac)
    spread = np.linalg.inv(slopes.T @ slopes) * float(found.fun @ found.fun) / free
    deviation = fit.unit * np.sqrt(np.diag(fit.ways @ spread @ fit.ways.T))
    residuals = dict(zip(fit.at, -fit.size * found.fun.reshape(-1, 3), strict=True))
    return FittedMotion(motion, path, residuals, deviation)


class _Fit:
    """Residuals (3 n,) over the contact size, as a function of the unknowns: ``ways`` (6, k) are
    what each is of translation and rotation, in ``unit`` (6,)."""

    def __init__(
        self, scene: Scene, measured: Mapping[str, ArrayLike], supports: tuple[str, ...],
        turns: bool,
    ) -> None:  # fmt: skip
        check_motions([SupportMotion(supports, (1.0, 0.0, 0.0))], scene.supports, scene.name)
        blocks = {block.id: block for block in scene.blocks}
        if lost := [name for name in measured if name not in blocks]:
            raise InputError(f"measured names {lost[0]!r}, which is no block of {scene.name!r}")
        self.scene, self.supports = scene, supports
        self.at = {name: finite_vector(x, 3, f"measured position of block {name!r}")
                   for name, x in measured.items()}  # fmt: skip
        self.built = {name: blocks[name].centroid for name in self.at}
        self.about = blocks[supports[0]].centroid
        self.size = scene.contacts.typical_size
        self.unit = np.repeat([self.size, 1.0], 3)
        start = for_path(scene)[0]
        across = Rest(start, REACH * self.size, "associated").across
        along = np.eye(3) if across is None else null_space(across[None])
        about = np.eye(3) if across is None else across[:, None]
        self.ways = block_diag(along, about if turns else np.zeros((3, 0)))
        count = len(self.at) * along.shape[1]
        if count < self.ways.shape[1]:
            raise InputError(
                f"measured has {count} numbers for a motion of {self.ways.shape[1]}: give "
                "positions of more blocks"
            )
        # It begins with the mean way of what was measured of supports, or beside them, or at all.
        moved = {name: x - self.built[name] for name, x in self.at.items()}
        beside = {n for pair in scene.contacts.pairs for n in pair if {*pair} & {*supports}}
        near = [{*supports} & {*moved}, beside & {*moved}, {*moved}]
        way = np.mean([moved[name] for name in next(filter(None, near))], axis=0)
        begin = self.ways.T @ np.concatenate([way / self.size, np.zeros(3)])
        self.begin = begin if np.abs(begin).max() > _STEP else np.full(len(begin), _STEP)

    def motion(self, unknowns: FloatArray) -> SupportMotion:
        way, turn = (self.unit * (self.ways @ unknowns)).reshape(2, 3)
        return SupportMotion(self.supports, tuple(way), tuple(turn), tuple(self.about))

    def path(self, unknowns: FloatArray, certify: str = "none") -> Path:
        motion = self.motion(unknowns)
        return pushover(self.scene, motion=motion, until=motion.size, certify=certify, halvings=0)  # type: ignore[arg-type]

    def residuals(self, unknowns: FloatArray) -> FloatArray:
        """Positions at the end of the path less those measured; where it ends before, straight on
        from its last two configurations."""
        path, size = self.path(unknowns), self.motion(unknowns).size
        last, before = path[-1], path[max(len(path) - 2, 0)]
        beyond = (size - last.w) / (last.w - before.w) if last.w > before.w else 0.0
        found, none = [], np.zeros(6)
        for name, x in self.at.items():
            here, was = (each.displacements.get(name, none)[:3] for each in (last, before))
            found.append(self.built[name] + here + beyond * (here - was) - x)
        return np.concatenate(found) / self.size

    def slopes(self, unknowns: FloatArray) -> FloatArray:
        """Derivatives (3 n, k) of the residuals, by differences."""
        here = self.residuals(unknowns)
        steps = _STEP * np.eye(len(unknowns))
        return np.stack([(self.residuals(unknowns + d) - here) / _STEP for d in steps], axis=1)

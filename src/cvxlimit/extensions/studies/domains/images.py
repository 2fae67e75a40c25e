"""What solvers answer about loads in a direction, and its mirror images, which need no solver."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.studies.domains.polytopes import FLAT
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.reductions.mirror import Mirror, find_mirror
from cvxlimit.solution import Iterate
from cvxlimit.surfaces.base import YieldSurface


@dataclass(frozen=True, eq=False)
class Raw:
    """A solver's answer about k live loads: nothing of it is believed."""

    direction: FloatArray
    """The direction (k,) in which load factors were to be largest."""
    factors: FloatArray
    """Load factors (k,), or those of a ray: any multiple of them is carried."""
    forces: FloatArray
    """Contact forces (n, 6) that carry the dead load with them, of a ray without the dead load."""
    given: FloatArray
    """What proves the factors: internal forces where the formulation has such, else the forces."""
    mechanism: FloatArray | None
    """Rates (free blocks, 6), None where there are none."""
    is_ray: bool
    iterate: Iterate
    is_mirrored: bool = False

    def image(self, at: LoadMirror) -> Raw | None:
        """The answer to the mirrored direction; None if it is the same.

        A mirror plane R turns the live loads F into R F = F turn. So ``turn @ factors`` are carried
        where ``factors`` are, with the forces of each contact at its image, and blocks likewise.
        """
        factors, direction = at.turn @ self.factors, at.turn @ self.direction
        moved = np.abs(factors - self.factors).max() + np.abs(direction - self.direction).max()
        if moved < FLAT:
            return None
        mirror, rates = at.mirror, self.mechanism
        forces = np.zeros_like(self.forces)
        forces[mirror.contacts] = np.einsum("nij,nj->ni", mirror.carried, self.forces)
        return replace(
            self, direction=direction, factors=factors, forces=forces, given=forces,
            mechanism=None if rates is None else rates[mirror.blocks] @ mirror.reflection.T,
            is_mirrored=True,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class LoadMirror:
    """A mirror plane R, and the matrix ``turn`` (k, k) with R F = F turn for the live loads F."""

    turn: FloatArray
    mirror: Mirror


def load_mirrors(
    quiet: Statics, forces: FloatArray, surfaces: Sequence[YieldSurface]
) -> list[LoadMirror]:
    """Up to two mirror planes of a structure under its dead load alone (``quiet``) that turn the
    live loads, the columns of ``forces`` (6 n, k), into sums of themselves."""
    result, across = list[LoadMirror](), None
    each = forces.reshape(-1, DOF, forces.shape[1])
    for _ in range(2):
        # The second plane is perpendicular to the first one.
        mirror = find_mirror(quiet, surfaces, across)
        if mirror is None:
            break
        across = mirror.normal
        # The mirrored loads as sums of the loads, if they are such, and are not the loads again.
        image = np.einsum("ij,njk->nik", mirror.reflection, each)[mirror.blocks]
        image = image.reshape(forces.shape)
        turn = np.linalg.lstsq(forces, image, rcond=1e-9)[0]
        is_close = np.abs(forces @ turn - image).max() <= 1e-9 * np.abs(image).max()
        if is_close and np.abs(turn - np.eye(len(turn))).max() > 1e-9:
            result.append(LoadMirror(turn, mirror))
    return result


def images(raw: Raw, mirrors: Sequence[LoadMirror]) -> Iterator[Raw]:
    """All mirror images of an answer, and images of images, but not the answer itself."""
    known = [raw]
    for mirror in mirrors:
        made = [each.image(mirror) for each in known]
        known += [image for image in made if image is not None]
    yield from known[1:]

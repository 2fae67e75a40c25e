"""Products of the non-negative orthant and second-order cones, and Nesterov-Todd scaling.

Vectors are flat: the orthant first, then the cones one after the other. Cones of equal size are
treated in one array operation. Formulas: L. Vandenberghe, The CVXOPT linear and quadratic cone
program solvers, 2010, sections 2 and 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Cones:
    """R+^l x SOC x ... x SOC.

    Parameters
    ----------
    nonneg : int
        l.
    soc : sequence of int
        Sizes of the second-order cones {(t, v): ||v|| <= t}.

    Attributes
    ----------
    soc : list of (k, d) int arrays
        Positions of the entries of the k cones of size d.
    identity : (size,) array
        e, with e o u = u.
    degree : int
        e' e.

    Example
    -------
    >>> cones = Cones(1, [3])
    >>> cones.margin(np.array([2.0, 5.0, 3.0, 4.0]))
    0.0
    """

    def __init__(self, nonneg: int, soc: Sequence[int]) -> None:
        sizes = np.asarray(soc, dtype=np.int64)
        start = nonneg + np.concatenate([[0], np.cumsum(sizes)])[:-1].astype(np.int64)
        self.nonneg = nonneg
        self.soc = [start[sizes == d][:, None] + np.arange(d) for d in np.unique(sizes)]
        self.size = nonneg + int(sizes.sum())
        self.degree = nonneg + len(sizes)
        self.identity = np.zeros(self.size)
        self.identity[:nonneg] = 1.0
        self.identity[start] = 1.0

    def product(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """u o v of the cones' Jordan algebra."""
        result = u * v
        for i in self.soc:
            a, b = u[i], v[i]
            result[i[:, 0]] = (a * b).sum(axis=1)
            result[i[:, 1:]] = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]
        return result

    def quotient(self, v: FloatArray, u: FloatArray) -> FloatArray:
        """w with u o w = v, for u inside."""
        result = np.empty_like(v)
        result[: self.nonneg] = v[: self.nonneg] / u[: self.nonneg]
        for i in self.soc:
            a, b = u[i], v[i]
            cross = (a[:, 1:] * b[:, 1:]).sum(axis=1)
            first = (a[:, 0] * b[:, 0] - cross) / _determinant(a)
            result[i[:, 0]] = first
            result[i[:, 1:]] = (b[:, 1:] - first[:, None] * a[:, 1:]) / a[:, :1]
        return result

    def clipped(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """u with its eigenvalues moved into [low, high]."""
        result = np.clip(u, low, high)
        for i in self.soc:
            a = u[i]
            norm = np.linalg.norm(a[:, 1:], axis=1)
            most = np.clip(a[:, 0] + norm, low, high)
            least = np.clip(a[:, 0] - norm, low, high)
            result[i[:, 0]] = 0.5 * (most + least)
            scale = 0.5 * (most - least) / np.where(norm > 0.0, norm, 1.0)
            result[i[:, 1:]] = scale[:, None] * a[:, 1:]
        return result

    def margin(self, u: FloatArray) -> float:
        """Smallest eigenvalue: positive inside, infinite without cones."""
        least = [u[: self.nonneg].min(initial=np.inf)]
        least += [(u[i[:, 0]] - np.linalg.norm(u[i[:, 1:]], axis=1)).min() for i in self.soc]
        return float(min(least))

    def step(self, u: FloatArray, direction: FloatArray) -> float:
        """Largest t with u + t direction in the cones, for u inside."""
        x, dx = u[: self.nonneg], direction[: self.nonneg]
        down = dx < 0.0
        longest = float((-x[down] / dx[down]).min(initial=np.inf))
        for i in self.soc:
            a, b = u[i], direction[i]
            root = np.sqrt(_determinant(a))[:, None]
            a, b = a / root, b / root
            first = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(axis=1)
            share = (first + b[:, 0]) / (1.0 + a[:, 0])
            rest = np.linalg.norm(b[:, 1:] - share[:, None] * a[:, 1:], axis=1)
            worst = float((rest - first).max(initial=0.0))
            if worst > 0.0:
                longest = min(longest, 1.0 / worst)
        return longest


class Scaling:
    """The symmetric W with W z = W^-1 s = lam, for s and z inside.

    Raises
    ------
    FloatingPointError
        If rounding has moved s or z onto the boundary.
    """

    def __init__(self, cones: Cones, s: FloatArray, z: FloatArray) -> None:
        if not (cones.margin(s) > 0.0 and cones.margin(z) > 0.0):
            raise FloatingPointError("an iterate left the cones")
        self.cones = cones
        self.diagonal = np.sqrt(s[: cones.nonneg] / z[: cones.nonneg])
        self.sizes: list[FloatArray] = []
        self.points: list[FloatArray] = []
        for i in cones.soc:
            ds, dz = np.sqrt(_determinant(s[i])), np.sqrt(_determinant(z[i]))
            a, b = s[i] / ds[:, None], z[i] / dz[:, None]
            cosine = (a * b).sum(axis=1)
            b[:, 1:] *= -1.0
            w = (a + b) / np.sqrt(2.0 * (1.0 + cosine))[:, None]
            w[:, 0] = np.sqrt(1.0 + (w[:, 1:] ** 2).sum(axis=1))
            self.sizes.append(np.sqrt(ds / dz))
            self.points.append(w)
        self.lam = self.times(z)

    def times(self, v: FloatArray) -> FloatArray:
        """W v."""
        return self._applied(v, 1.0)

    def over(self, v: FloatArray) -> FloatArray:
        """W^-1 v."""
        return self._applied(v, -1.0)

    def squared(self, v: FloatArray) -> FloatArray:
        """W^2 v, in one go: 2 w w' - J for a cone of unit size."""
        return self._applied_twice(v, 1.0)

    def over_squared(self, v: FloatArray) -> FloatArray:
        """W^-2 v."""
        return self._applied_twice(v, -1.0)

    def _applied_twice(self, v: FloatArray, sign: float) -> FloatArray:
        result = np.empty_like(v)
        result[: self.cones.nonneg] = v[: self.cones.nonneg] * self.diagonal ** (2.0 * sign)
        for i, size, w in zip(self.cones.soc, self.sizes, self.points, strict=True):
            a = v[i]
            along = w[:, 0] * a[:, 0] + sign * (w[:, 1:] * a[:, 1:]).sum(axis=1)
            scale = size ** (2.0 * sign)
            result[i[:, 0]] = scale * (2.0 * along * w[:, 0] - a[:, 0])
            bent = (2.0 * sign) * along[:, None] * w[:, 1:] + a[:, 1:]
            result[i[:, 1:]] = scale[:, None] * bent
        return result

    def _applied(self, v: FloatArray, sign: float) -> FloatArray:
        result = np.empty_like(v)
        result[: self.cones.nonneg] = v[: self.cones.nonneg] * self.diagonal**sign
        for i, size, w in zip(self.cones.soc, self.sizes, self.points, strict=True):
            a = v[i]
            cross = sign * (w[:, 1:] * a[:, 1:]).sum(axis=1)
            along = sign * (a[:, 0] + cross / (1.0 + w[:, 0]))
            result[i[:, 0]] = size**sign * (w[:, 0] * a[:, 0] + cross)
            result[i[:, 1:]] = (size**sign)[:, None] * (a[:, 1:] + along[:, None] * w[:, 1:])
        return result

    def inverse_blocks(self) -> Iterator[FloatArray]:
        """W^-1 of the second-order cones, (k, d, d) for each size."""
        for size, w in zip(self.sizes, self.points, strict=True):
            m = np.empty((*w.shape, w.shape[1]))
            m[:, 0, 0] = w[:, 0]
            m[:, 0, 1:] = m[:, 1:, 0] = -w[:, 1:]
            bend = w[:, 1:, None] * w[:, None, 1:] / (1.0 + w[:, 0])[:, None, None]
            m[:, 1:, 1:] = np.eye(w.shape[1] - 1) + bend
            yield m / size[:, None, None]


def _determinant(a: FloatArray) -> FloatArray:
    norm = np.linalg.norm(a[:, 1:], axis=1)
    result: FloatArray = (a[:, 0] - norm) * (a[:, 0] + norm)
    return result

"""Products of the non-negative orthant and second-order cones, and Nesterov-Todd scaling.

Vectors are flat: the orthant, then slabs of k equal cones of size d, component by component (d, k).
Formulas: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010, 2 and 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.base.arrays import FloatArray


class Cones:
    """R+^orthant x SOC x ... x SOC; ``slabs`` are sizes d and numbers k of cones norm(v) <= t. The
    identity e has e o u = u, and the degree is e' e.

    >>> Cones(1, [(3, 1)]).margin(np.array([2.0, 5.0, 3.0, 4.0]))
    0.0
    """

    def __init__(self, orthant: int, slabs: Sequence[tuple[int, int]]) -> None:
        self.orthant, self.shapes = orthant, list(slabs)
        ends = orthant + np.cumsum([d * k for d, k in slabs], dtype=np.int64)
        starts = [orthant, *ends[:-1].tolist()]
        self.places = [slice(a, int(b)) for a, b in zip(starts, ends, strict=False)]
        self.size = int(ends[-1]) if len(ends) else orthant
        self.degree = orthant + sum(k for _, k in slabs)
        self.identity = np.zeros(self.size)
        self.identity[:orthant] = 1.0
        for part in self.parts(self.identity):
            part[0] = 1.0

    def parts(self, v: FloatArray) -> list[FloatArray]:
        """Views (d, k) of the second-order cones' slabs."""
        return [v[at].reshape(shape) for at, shape in zip(self.places, self.shapes, strict=True)]

    def product(self, u: FloatArray, v: FloatArray) -> FloatArray:
        result = u * v
        for a, b, r in zip(self.parts(u), self.parts(v), self.parts(result), strict=True):
            r[0] = r.sum(axis=0)
            r[1:] = a[0] * b[1:] + b[0] * a[1:]
        return result

    def quotient(self, v: FloatArray, u: FloatArray) -> FloatArray:
        """w with u o w = v, for u inside."""
        result = v / u
        for b, a, r in zip(self.parts(v), self.parts(u), self.parts(result), strict=True):
            r[0] = (a[0] * b[0] - _dot(a[1:], b[1:])) / _determinant(a)
            r[1:] = (b[1:] - r[0] * a[1:]) / a[0]
        return result

    def clipped(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """u with its eigenvalues moved into [low, high]."""
        result = np.clip(u, low, high)
        for a, r in zip(self.parts(u), self.parts(result), strict=True):
            norm = _norm(a[1:])
            most = np.clip(a[0] + norm, low, high)
            least = np.clip(a[0] - norm, low, high)
            r[0] = 0.5 * (most + least)
            r[1:] = 0.5 * (most - least) / np.where(norm > 0.0, norm, 1.0) * a[1:]
        return result

    def margin(self, u: FloatArray) -> float:
        """Smallest eigenvalue: positive inside, infinite without cones, NaN for NaN."""
        least = [u[: self.orthant].min(initial=np.inf)]
        least += [(a[0] - _norm(a[1:])).min() for a in self.parts(u)]
        return float(np.min(least))

    def scaling(self, s: FloatArray, z: FloatArray) -> NesterovTodd:
        """Raises FloatingPointError if rounding has moved s or z onto the boundary."""
        return NesterovTodd(self, s, z)

    def steps(self, u: FloatArray, *given: FloatArray) -> list[float]:
        """Largest t with u + t d in the cones, for u inside and every direction d given."""
        directions = np.stack(given)
        plain = -directions[:, : self.orthant] / u[: self.orthant]
        worst = plain.max(axis=1, initial=0.0)
        for a, at in zip(self.parts(u), self.places, strict=True):
            root = np.sqrt(_determinant(a))
            a, b = a / root, directions[:, at].reshape(-1, *a.shape) / root
            first = a[0] * b[:, 0] - np.einsum("dk,ndk->nk", a[1:], b[:, 1:])
            share = (first + b[:, 0]) / (1.0 + a[0])
            off = b[:, 1:] - share[:, None] * a[1:]
            rest = np.sqrt(np.einsum("ndk,ndk->nk", off, off)) - first
            worst = np.maximum(worst, rest.max(axis=1, initial=0.0))
        lengths = np.divide(1.0, worst, out=np.full_like(worst, np.inf), where=worst > 0.0)
        return lengths.tolist()


class NesterovTodd:
    """The symmetric W with W z = W^-1 s = lam, for s and z inside.

    Raises FloatingPointError if rounding has moved s or z onto the boundary.
    """

    def __init__(self, cones: Cones, s: FloatArray, z: FloatArray) -> None:
        if not (cones.margin(s) > 0.0 and cones.margin(z) > 0.0):
            raise FloatingPointError("an iterate left the cones")
        self.cones, n = cones, cones.orthant
        self.diagonal = np.sqrt(s[:n] / z[:n])
        self._squares = {1.0: s[:n] / z[:n], -1.0: z[:n] / s[:n]}
        self.frames: list[tuple[FloatArray, FloatArray]] = []
        for a, b in zip(cones.parts(s), cones.parts(z), strict=True):
            ds, dz = np.sqrt(_determinant(a)), np.sqrt(_determinant(b))
            a, b = a / ds, b / dz
            cosine = _dot(a, b)
            b[1:] *= -1.0
            w = (a + b) / np.sqrt(2.0 * (1.0 + cosine))
            w[0] = np.sqrt(1.0 + _dot(w[1:], w[1:]))
            self.frames.append((np.sqrt(ds / dz), w))
        self.lam = self.times(z)

    def times(self, v: FloatArray, sign: float = 1.0) -> FloatArray:
        """W v, or W^-1 v with sign -1."""
        result = np.empty_like(v)
        n = self.cones.orthant
        result[:n] = v[:n] * self.diagonal if sign > 0.0 else v[:n] / self.diagonal
        parts = zip(self.frames, self.cones.parts(v), self.cones.parts(result), strict=True)
        for (size, w), a, r in parts:
            cross = sign * _dot(w[1:], a[1:])
            scale = size if sign > 0.0 else 1.0 / size
            r[0] = scale * (w[0] * a[0] + cross)
            r[1:] = scale * (a[1:] + sign * (a[0] + cross / (1.0 + w[0])) * w[1:])
        return result

    def squared(self, v: FloatArray, sign: float = 1.0) -> FloatArray:
        """W^2 v, or W^-2 v with sign -1, in one go: 2 w w' - J for a cone of unit size."""
        result = np.empty_like(v)
        n = self.cones.orthant
        result[:n] = v[:n] * self._squares[sign]
        parts = zip(self.frames, self.cones.parts(v), self.cones.parts(result), strict=True)
        for (size, w), a, r in parts:
            along = w[0] * a[0] + sign * _dot(w[1:], a[1:])
            scale = size * size if sign > 0.0 else 1.0 / (size * size)
            r[0] = scale * (2.0 * along * w[0] - a[0])
            r[1:] = scale * (2.0 * sign * along * w[1:] + a[1:])
        return result

    def over(self, slab: int, matrix: FloatArray) -> FloatArray:
        """W^-1 of one slab's cones times matrices (d, c, k)."""
        size, w = self.frames[slab]
        result = np.empty_like(matrix)
        cross = np.einsum("dk,dck->ck", w[1:], matrix[1:])
        result[0] = (w[0] * matrix[0] - cross) / size
        along = cross / (1.0 + w[0]) - matrix[0]
        result[1:] = (matrix[1:] + along * w[1:, None]) / size
        return result


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    result: FloatArray = np.einsum("dk,dk->k", a, b)
    return result


def _norm(a: FloatArray) -> FloatArray:
    result: FloatArray = np.sqrt(_dot(a, a))
    return result


def _determinant(a: FloatArray) -> FloatArray:
    norm = _norm(a[1:])
    result: FloatArray = (a[0] - norm) * (a[0] + norm)
    return result

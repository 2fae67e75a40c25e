"""Interaction (Eq. 26-32) written a second time: a checker of forces, and a search for more.

Arms are mean distances over P and its reflection about the pressure centre, by shapely and Gauss'
rule. With all pressure centres held fixed, M = N e, Eq. 30 is a convex set whose every state is
admissible; the search moves the centres at random and keeps what carries more. Of the package it
uses the contacts' frames (the independent reading depends on the axes) and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp
import shapely
from numpy.typing import NDArray
from shapely import affinity

from cvxlimit import Contacts, Scene
from helpers import hand_equilibrium
from second_writing import mean_distance

FloatArray = NDArray[np.float64]

INWARD = 1e-7
"""How far from the edge pressure centres count as being on it: an arm changes by as much."""

READINGS = ("independent", "signed")


def arm(polygon: shapely.Polygon, e: FloatArray) -> float:
    """Mean distance from e over the points of the polygon whose reflection about e is in it.

    On the edge the region is a line, the limit of regions about points a little way in.
    """
    middle = shapely.get_coordinates(polygon.centroid)[0]
    if polygon.exterior.distance(shapely.Point(e)) < INWARD or not polygon.contains(
        shapely.Point(e)
    ):
        edge = polygon.exterior
        e = shapely.get_coordinates(edge.interpolate(edge.project(shapely.Point(e))))[0]
        e = e + INWARD / np.linalg.norm(middle - e) * (middle - e)
    region = polygon.intersection(affinity.scale(polygon, -1.0, -1.0, origin=tuple(e)))
    return mean_distance(region, e) if region.area > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Interaction:
    """One scene of convex contacts, and one reading of Eq. 30."""

    scene: Scene
    reading: str

    @property
    def contacts(self) -> Contacts:
        """For their frames."""
        return self.scene.contacts

    def polygons(self) -> list[shapely.Polygon]:
        """Outlines about the contacts' centres, along t1 and t2."""
        contacts = self.contacts
        return [shapely.Polygon(contacts.corners_of(j)) for j in range(len(contacts))]

    def excess(self, forces: FloatArray, load_factor: float) -> float:
        """Largest violation of equilibrium, Eq. 9, 10 and 30, over the total load.

        A contact without compression counts as pressed at its centre. Moments count per square
        root of the contact's area.
        """
        matrix, dead, live = hand_equilibrium(self.scene)
        load = float(np.abs(dead.reshape(-1, 6)[:, :3]).sum())
        worst = [np.abs(matrix @ forces.ravel() + dead + load_factor * live).max()]
        for j, polygon in enumerate(self.polygons()):
            v1, v2, n, m1, m2, mt = forces[j]
            size, mu = np.sqrt(polygon.area), self.contacts.friction[j]
            e = np.array([-m2, m1]) / n if n > 0.0 else np.zeros(2)
            worst += [-n, np.hypot(v1, v2) - mu * n, n * polygon.distance(shapely.Point(e)) / size]
            torque = abs(mt - e[0] * v2 + e[1] * v1)
            if self.reading == "independent":
                torque = abs(e[1] * v1) + abs(e[0] * v2) + abs(mt)
            worst.append((torque - arm(polygon, e) * (mu * n - np.hypot(v1, v2))) / size)
        return max(worst) / load

    def frozen(self, e: FloatArray, is_dead_load: bool = False) -> float | None:
        """Largest load factor with pressure centres (n, 2), or share of the dead load alone.

        None if there is none. Variables: alpha, then N, V1, V2, MT of each contact.
        """
        matrix, dead, live = hand_equilibrium(self.scene)
        unit = float(np.abs(dead.reshape(-1, 6)[:, :3]).sum())
        rows, cones, maps = [], [], []
        for j, polygon in enumerate(self.polygons()):
            mu, (e1, e2), c = self.contacts.friction[j], e[j], arm(polygon, e[j])
            to_forces = np.zeros((6, 4))
            to_forces[[2, 3, 4], 0] = 1.0, e2, -e1
            to_forces[[0, 1, 5], [1, 2, 3]] = 1.0
            maps.append(to_forces)
            signed = [(s * np.array([e2, -e1, 1.0])) for s in (1.0, -1.0)]
            if self.reading == "independent":
                signed = [np.array([s * abs(e2), t * abs(e1), r])
                          for s in (1, -1) for t in (1, -1) for r in (1, -1)]  # fmt: skip
            cone = np.zeros((3, 4))
            cone[0, 0], cone[1, 1], cone[2, 2] = -mu, -1.0, -1.0
            blocks = [cone]
            for torque in signed:  # c norm(V) <= c mu N - torque
                block = np.zeros((3, 4))
                block[0] = [-c * mu, *torque]
                block[1, 1] = block[2, 2] = -c
                blocks.append(block)
            rows.append(np.vstack(blocks))
            cones += [clarabel.SecondOrderConeT(3)] * len(blocks)
        if is_dead_load:
            dead, live = 0.0 * dead, dead
        n = 1 + 4 * len(maps)
        most = sp.csc_array(([1.0], ([0], [0])), shape=(1, n))
        balance = sp.hstack(
            [live[:, None] / unit, matrix @ sp.block_diag([*map(sp.csc_array, maps)])]
        )
        stacked = sp.hstack(
            [sp.csc_array((sum(map(len, rows)), 1)), sp.block_diag([*map(sp.csc_array, rows)])]
        )
        right = np.concatenate(
            [-dead / unit, np.zeros(stacked.shape[0]), [1.0 if is_dead_load else 1e6]]
        )
        objective = np.zeros(n)
        objective[0] = -1.0
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.direct_solve_method = False, "qdldl"
        solver = clarabel.DefaultSolver(
            sp.csc_matrix((n, n)), objective, sp.csc_matrix(sp.vstack([balance, stacked, most])),
            right, [clarabel.ZeroConeT(len(dead)), *cones, clarabel.NonnegativeConeT(1)], settings,
        )  # fmt: skip
        solution = solver.solve()
        return float(solution.x[0]) if str(solution.status) == "Solved" else None

    def search(self, start: FloatArray, tries: int, seed: int, is_dead_load: bool = False) -> float:
        """The best load factor found from pressure centres (n, 2) on; -inf if none.

        Or the best share of the dead load alone.
        """
        rng = np.random.default_rng(seed)
        polygons = self.polygons()
        best, best_e = -np.inf, self._inside(start)
        for k in range(tries):
            e = best_e
            if k:
                size = np.sqrt([p.area for p in polygons])[:, None] * 10.0 ** rng.uniform(-3, -0.5)
                moved = rng.random((len(e), 1)) < 0.5
                e = self._inside(best_e + size * moved * rng.normal(size=e.shape))
            found = self.frozen(e, is_dead_load)
            if found is not None and found > best:
                best, best_e = found, e
        return best

    def _inside(self, e: FloatArray) -> FloatArray:
        """Centres outside their contact at its nearest point, a little way in."""
        result = np.array(e)
        for j, polygon in enumerate(self.polygons()):
            if not polygon.contains(shapely.Point(e[j])):
                nearest = polygon.exterior.interpolate(
                    polygon.exterior.project(shapely.Point(e[j]))
                )
                result[j] = (1.0 - 1e-9) * np.array([nearest.x, nearest.y])
        return result

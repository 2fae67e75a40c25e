"""A package of somebody else, which cvxlimit finds by its entry points."""

from dataclasses import dataclass

from cvxlimit import Convex, Method
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.plotting import Drawing, camera_for, motion, picture
from cvxlimit.surfaces import Facets, Rocking, TorsionShear

INSIDE = (Rocking(), TorsionShear(Facets.inscribed(12)))  # surface="dozen"


@dataclass(frozen=True)
class Dozen(Method):
    """Twelve facets inside the cone, whatever surface is asked for."""

    name = "dozen"
    answers = "the load factor on the safe side, with twelve facets"
    takes = ()

    def steps(self, run):
        run.surfaces = INSIDE
        return (yield from Convex().steps(run))


def read_boxes(path, notes):
    """Lines "id x0 y0 z0 x1 y1 z1" as bodies."""
    rows = [line.split() for line in path.read_text("utf-8").splitlines()]
    return [Body(name, [at[:3], at[3:]], [], is_box=True) for name, *at in map(numbers, rows)]


def numbers(row):
    return row[0], *map(float, row[1:])


def write_boxes(scene, solution):
    """The boxes around all blocks, for :func:`read_boxes`."""
    rows = ((b.id, *b.vertices.min(axis=0), *b.vertices.max(axis=0)) for b in scene.blocks)
    return "".join(f"{' '.join(map(str, row))}\n" for row in rows)


@picture
def plan(solution, *, viewer=(0, 0, 1)):
    """The mechanism from above."""
    moving = motion(solution.scene, solution)
    return Drawing(solution.scene, moving, camera_for(solution.scene, moving, viewer))


def blocks_command(scene: str):
    """Say how many blocks a built-in scene has."""

    def job():
        from cvxlimit import builtin_scene

        print(len(builtin_scene(scene).blocks))  # noqa: T201
        return 0

    return job

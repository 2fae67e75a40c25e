"""The planar wall with torsion-shear-bending interaction."""

from benchmarks.cases import Case
from benchmarks.cases.planar_wall import build

CASE = Case(
    "planar-wall-interaction",
    "planar walls with interaction",
    build,
    study=(150,),
    interaction=True,
)

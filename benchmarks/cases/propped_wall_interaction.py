"""The propped wall with torsion-shear-bending interaction: the paper's first example."""

from benchmarks.cases import Case
from benchmarks.cases.propped_wall import build

CASE = Case(
    "propped-wall-interaction",
    "propped walls with interaction",
    build,
    study=(150,),
    interaction=True,
)

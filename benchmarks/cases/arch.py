"""A semicircular arch, pushed along its span: every voussoir touches two others."""

from benchmarks.cases import Case
from cvxlimit.masonry import arch
from cvxlimit.scene import Scene


def build(contacts: int) -> Scene:
    """One contact more than voussoirs."""
    return arch(contacts - 1, name=f"arch of {contacts - 1}")


CASE = Case("arch", "arches", build, study=(150,))

"""A semicircular arch, pushed along its span: every voussoir touches two others.

Up to 1,900 voussoirs: thinner ones overlap each other's bounding boxes so much that contact
detection grows with their square (97 s at 16,452), and no arch is built of them.
"""

from benchmarks.cases import Case
from cvxlimit.masonry import arch
from cvxlimit.scene import Scene


def build(contacts: int) -> Scene:
    """One contact more than voussoirs."""
    return arch(contacts - 1, name=f"arch of {contacts - 1}")


CASE = Case("arch", "arches", build, sizes=(50, 150, 500, 1_900), study=(150,))

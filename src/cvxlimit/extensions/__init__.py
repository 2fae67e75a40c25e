"""Extensions: each folder stands on the core alone, and may be left out.

Nothing below ``cvxlimit`` outside this folder imports one of them, and none imports another. What a
folder offers at the doors of the core stands in its ``OFFERED``, beside the order in which to read
its files.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from cvxlimit.base.doors import Offered, lack
from cvxlimit.errors import MissingExtension

SHIPPED: Mapping[str, Mapping[str, str]] = {
    "blockcone": {"cvxlimit.solvers": "BLOCKWISE"},
    "dilatancy": {
        "cvxlimit.checks": "zero-dilatancy slides",
        "cvxlimit.methods": "zero-dilatancy",
        "cvxlimit.readings": "slides_without_dilatancy",
    },
    "dynamics": {
        "cvxlimit.commands": "shake",
        "cvxlimit.readings": "shaking_plot",
        "cvxlimit.writers": ".mjcf",
    },
    "importing": {
        "cvxlimit.commands": "import",
        "cvxlimit.files": "Imported import_geometry read_bodies",
        "cvxlimit.readers": ".obj .json .csv .off .dxf .stl .ply .glb .gltf .dat .3ddat",
        "cvxlimit.readings": "scene_from_compas solution_to_compas",
    },
    "incremental": {
        "cvxlimit.checks": "incremental",
        "cvxlimit.methods": "incremental",
        "cvxlimit.pictures": "bedding curve onset",
        "cvxlimit.readings": "step_problem",
    },
    "interaction": {"cvxlimit.checks": "certified", "cvxlimit.methods": "certified"},
    "paths": {
        "cvxlimit.commands": "pushover",
        "cvxlimit.documents": "path",
        "cvxlimit.files": "read_path write_path",
        "cvxlimit.proofs": "cvxlimit-path",
        "cvxlimit.readings": "check_plot path_facts path_followed path_headline path_interval "
        "path_plot path_save path_table",
    },
    "studies": {
        "cvxlimit.commands": "compare domain envelope sweep",
        "cvxlimit.documents": "domain",
        "cvxlimit.proofs": "cvxlimit-domain cvxlimit-sweep",
    },
}
"""By extension of this package, and by group: the names in its ``OFFERED``, so that who asks for
one that is left out is told what is missing."""


@cache
def here() -> frozenset[str]:
    """The names of extensions that are here."""
    return frozenset(module.name for module in iter_modules(__path__))


def tables() -> Iterator[Offered]:
    """What each extension that is here offers; doors learn which are not."""
    for name in SHIPPED.keys() - here():
        lack(name, SHIPPED[name])
    for name in sorted(here()):
        yield import_module(f"{__name__}.{name}").OFFERED


def check_here(name: str, what: str) -> None:
    """Refuses an extension of this package that is not here, of which ``what`` is asked for."""
    if name in SHIPPED.keys() - here():
        raise MissingExtension.of(what, name)


def __getattr__(name: str) -> Any:
    if name in here():
        return import_module(f"{__name__}.{name}")
    check_here(name, f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

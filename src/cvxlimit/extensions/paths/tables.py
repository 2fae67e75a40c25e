"""The table of a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cvxlimit.base.extras import needed
from cvxlimit.extensions.paths.path import Path
from cvxlimit.extensions.paths.wording import PROVES, opened
from cvxlimit.results.tables import Columns, table_from
from cvxlimit.solution.bracket import Bracket

if TYPE_CHECKING:
    from pandas import DataFrame


def _reactions(path: Path) -> Columns:
    """Reactions of supports that move; nothing of others."""
    if not path.motions:
        return {}
    unit, found = path.units.push, path.reactions
    names = [(which, end) for which in ("least", "largest") for end in ("lower", "upper")]
    return {
        f"{which}_reaction_{end}": (found[:, k], unit, f"{end} bound of the {which} reaction")
        for k, (which, end) in enumerate(names)
    }


def path_table(path: Path) -> DataFrame:
    """A path's configurations, one row each."""
    pandas = needed("pandas", "frames", "tables")
    brackets = [c.bracket or Bracket(np.nan, np.nan) for c in path]
    columns: Columns = {
        "w": (path.w, path.units.w, "mean displacement of the live load, or way of supports"),
        "displacement": (path.displacement, path.units.displacement, "of the control block"),
        "load_factor": (path.load_factor, "", "with friction at points"),
        "slip": (
            [0.0, *(max([0.0, *(slip for slip, _ in x.values())]) for x in path.in_joints)],
            path.scene.units.length, "of the joint that slides farthest, since the row above",
        ),
        "failed": (path.failed, "", "joints and ties that came apart, since the row above"),
        "lower": ([b.lower for b in brackets], "", "static bound of the most it carries"),
        "upper": ([b.upper for b in brackets], "", "kinematic bound of the most it carries"),
        "below": (path.below, "", "whether the path's load factor lies below this bracket"),
        **_reactions(path),
        "open": (
            [opened(path.openings(i)) for i in range(len(path))], path.scene.units.length,
            "joints that are open, the widest first, with their widths",
        ),
        "proved": ([b.is_proved for b in brackets], "", "whether both bounds are proved"),
        "widest_gap": ([c.widest_gap for c in path], path.scene.units.length, "of closed points"),
        "residual": (
            [c.residual for c in path], "",
            "last movement over the contact size; followed: lack of equilibrium over the dead load",
        ),
        "loss": ([c.loss for c in path], "", "of friction, over the step's work"),
        "followed": (
            [c.is_followed for c in path], "", "by an explicit step: no iterates came to rest"
        ),
        "iterates": ([c.iterates for c in path], "", "convex problems solved"),
    }  # fmt: skip
    facts = {
        "status": path.status,
        "reason": path.reason,
        "headline": path.headline,
        "snaps": path.snaps,
        "proof": PROVES,
    }
    return table_from(pandas, None, columns, None, facts)

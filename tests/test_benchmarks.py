"""The benchmark suite: every case small and right, baselines right, failures and charts."""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import relative_error

ROOT = Path(__file__).parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from benchmarks import headline  # noqa: E402
from benchmarks.__main__ import main  # noqa: E402
from benchmarks.baselines import ROWS, baselines, octagon_rows, program, rocking_rows  # noqa: E402
from benchmarks.baselines import torsion_arms as printed_torsion_arms  # noqa: E402
from benchmarks.cases import SIZES, all_cases  # noqa: E402
from benchmarks.charts import exponent  # noqa: E402
from benchmarks.results import Record, environment, read, write  # noqa: E402
from benchmarks.suite import GROWTH, Plan, growth_methods, methods_of, run_case  # noqa: E402

from cvxlimit import builtin_scene  # noqa: E402
from cvxlimit.comparison.rows import Bracket, row_of  # noqa: E402
from cvxlimit.comparison.runs import Failure, Limits  # noqa: E402
from cvxlimit.errors import ModelError  # noqa: E402
from cvxlimit.masonry import arch  # noqa: E402
from cvxlimit.statics import Statics  # noqa: E402

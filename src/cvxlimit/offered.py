"""What the core offers at its doors: one table per group, of names and where what has them is.

Extensions have tables of their own, ``OFFERED`` in their folders; other distributions have entry
points of these groups.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.methods": {
        "convex": "cvxlimit.methods.convex:Convex",
        "exact": "cvxlimit.methods.exact_friction:ExactFriction",
        "fixed-point": "cvxlimit.methods.fixed_point:FixedPoint",
    },
    "cvxlimit.surfaces": {
        "parabolic": "cvxlimit.surfaces.coulomb:PARABOLIC_SURFACES",
    },
    "cvxlimit.commands": {
        "solve": "cvxlimit.cli.solving:SolveCommand",
        "explain": "cvxlimit.cli.looking:ExplainCommand",
        "show": "cvxlimit.cli.looking:ShowCommand",
        "settle": "cvxlimit.cli.solving:SettleCommand",
        "export": "cvxlimit.cli.exporting:ExportCommand",
        "export-problem": "cvxlimit.cli.exporting:ExportProblemCommand",
        "prove": "cvxlimit.cli.proving:ProveCommand",
    },
    "cvxlimit.documents": {
        "scene": "cvxlimit.io.scenes:SCENE",
        "result": "cvxlimit.io.results:RESULT",
    },
    "cvxlimit.proofs": {
        "cvxlimit-result": "cvxlimit.proving.solutions:prove_result",
    },
    "cvxlimit.readings": {
        "scene_html": "cvxlimit.plotting.notebook:scene_html",
        "scene_figure": "cvxlimit.plotting:scene_figure",
        "scene_file": "cvxlimit.plotting:plot_scene",
        "scene_explain": "cvxlimit.reductions.explaining:explain",
        "solution_html": "cvxlimit.plotting.notebook:solution_html",
        "solution_plot": "cvxlimit.plotting:picture_of",
        "solution_table": "cvxlimit.results.tables:table_of",
        "solution_sensitivity": "cvxlimit.results.sensitivity:sensitivity",
        "solution_report": "cvxlimit.plotting.reports:solution_report",
        "solution_problem": "cvxlimit.problem.problem:problem_of",
        "problem_table": "cvxlimit.results.tables:problem_table",
        "sensitivity_table": "cvxlimit.results.tables:sensitivity_table",
    },
}
"""By group the places of names."""

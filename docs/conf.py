"""Settings of the documentation site: ``.venv/bin/sphinx-build -W docs site`` builds it.

What other tools write is made on the way, into ``docs/_made``: the pages of the command line (from
the command line itself), the gallery of built-in scenes (solved anew) and the notebooks (from
``notebooks/``). Notebooks show the outputs of the
run they were saved with, which the tests repeat; ``-D nb_execution_mode=force`` runs them anew.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from making import make_all  # noqa: E402  (beside this file)

from cvxlimit import __version__  # noqa: E402

project = "cvxlimit"
author = "The cvxlimit engineers"
version = release = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "docstrings",
    "links",
    "mathml",
]
exclude_patterns = [
    f"_made/{name}.md"
    for name in ("commands", "gallery", "scenes", "notebooks", "columns-contacts", "columns-blocks")
]

html_theme = "furo"
html_title = f"cvxlimit {version}"
html_static_path = ["_static"]
html_favicon = "_static/logo.svg"
html_extra_path = ["_made/site"]  # pages to turn, made beside this file
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_copyright = False
html_show_sphinx = False

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
nb_execution_mode = "off"
nb_execution_timeout = 300
nb_merge_streams = True
copybutton_exclude = ".linenos, .gp, .go"

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name
    for name in ("ArrayLike", "BoolArray", "Coefficient", "FloatArray", "IntArray", "LinearForm")
}
python_maximum_signature_line_length = 88
numpydoc_show_class_members = False

make_all(HERE.parent, HERE / "_made")

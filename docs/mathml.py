"""Equations as MathML, made when the site is built: it needs neither a script nor a network.

Browsers draw MathML themselves; Sphinx offers MathJax from another server, or pictures from LaTeX.
"""

from __future__ import annotations

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """An equation within a line."""
    writer.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    """An equation on a line of its own, with its number if it has one."""
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    if node["number"]:
        writer.body.append(f'<span class="eqno">({get_node_equation_number(writer, node)})</span>')
    writer.body.append(mathml(node.astext(), "block"))
    writer.body.append("</div>\n")
    raise nodes.SkipNode


def mathml(latex: str, display: str) -> str:
    """The converter knows ``align*`` only, and bars of one side would stretch without the other."""
    made = str(convert(latex.replace("{aligned}", "{align*}"), display=display))
    return made.replace("<mo>&#x0007C;</mo>", '<mo stretchy="false">&#x0007C;</mo>')


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Equations as MathML, which every current browser draws by itself.

Sphinx's usual renderer leaves the TeX in the page and loads MathJax from a host when the page
is read; the manual is read in places with no internet (docs/decisions/0009).
"""

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Write ``$x$``."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write ``$$x$$`` or a ``math`` directive, with its number if it has one."""
    attributes = {"class": "equation", "ids": node.get("ids", [])}
    translator.body.append(translator.starttag(node, "div", **attributes))
    if node["number"]:
        translator.body.append(f'<span class="eqno">({node["number"]})</span>')
    translator.body.append(convert(node.astext(), display="block"))
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

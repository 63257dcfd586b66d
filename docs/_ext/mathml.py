"""Equations as MathML, which every current browser draws by itself.

Sphinx's usual renderer leaves the TeX in the page and loads MathJax from a host when the page
is read; the manual is read in places with no internet (docs/decisions/0009).
"""

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

# What latex2mathml does not know, in terms of what it knows. `align` would number each line,
# next to the number that Sphinx gives the whole.
REWRITE = (
    (re.compile(r"\\arg(?![a-zA-Z])"), r"\\operatorname{arg}"),
    (re.compile(r"\\(begin|end)\{(?:aligned|align|split)\}"), r"\\\1{align*}"),
    (re.compile(r"\\(begin|end)\{(?:gathered|gather)\}"), r"\\\1{gather*}"),
)
# latex2mathml writes an unknown command or a stray & into the page as it is.
UNKNOWN = re.compile(r">\s*(\\[a-zA-Z]+|&amp;)\s*<")

log = logging.getLogger(__name__)


def mathml(node: nodes.math | nodes.math_block, *, display: str) -> str:
    """Turn TeX into MathML; a part that is not understood is a warning."""
    tex = node.astext()
    for pattern, replacement in REWRITE:
        tex = pattern.sub(replacement, tex)
    result: str = convert(tex, display=display)
    for part in UNKNOWN.findall(result):
        log.warning("equation: %s is not understood by latex2mathml", part, location=node)
    return result


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Write ``$x$``."""
    translator.body.append(mathml(node, display="inline"))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write ``$$x$$`` or a ``math`` directive, with its number if it has one."""
    attributes = {"class": "equation", "ids": node.get("ids", [])}
    translator.body.append(translator.starttag(node, "div", **attributes))
    if node["number"]:
        translator.body.append(f'<span class="eqno">({node["number"]})</span>')
    translator.body.append(mathml(node, display="block"))
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Formulas as MathML: no script, no network; browsers set them and screen readers read them."""

import re

from docutils import nodes
from latex2mathml.converter import convert

#: Names that stand apart from what they are of; the converter sets them as letters.
FUNCTION = re.compile(r"<mi>(sin|cos|tan|exp|ln|log|max|min|arccos|sgn|clamp|wrap)</mi>")


def inline(self, node):
    """Write an inline formula."""
    self.body.append(_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def block(self, node):
    """Write a displayed formula, scrolled where it is wider than the page."""
    self.body.append(f'<div class="formula" tabindex="0">{_mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def _mathml(text, display):
    """Return MathML; refused where a command is unknown: it would be printed as text."""
    for form in ("begin", "end"):  # the converter knows the same table by another name
        text = text.replace(f"\\{form}{{aligned}}", f"\\{form}{{split}}")
    made = FUNCTION.sub(
        r'<mo lspace="0.17em" rspace="0.17em">\1</mo>', convert(text.strip(), display=display)
    )
    if left := re.search(r"\\[a-zA-Z]+|<m[io]>&<", made):
        raise ValueError(f"formula {text!r}: {left.group()} is not understood")
    return made

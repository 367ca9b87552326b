"""Formulas as MathML, which browsers draw by themselves: no script and no font from elsewhere."""

from __future__ import annotations

import re
from html import unescape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page with the formulas that pymdownx.arithmatex marked as MathML."""
    html = BLOCK.sub(lambda formula: mathml(formula[1], display="block"), html)
    return INLINE.sub(lambda formula: mathml(formula[1], display="inline"), html)


def mathml(escaped: str, *, display: str) -> str:
    """The formula, LaTeX with its &, < and > escaped, as a <math> element."""
    from latex2mathml.converter import convert

    return convert(unescape(escaped).strip(), display=display)

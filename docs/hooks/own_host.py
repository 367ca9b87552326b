"""Nothing on the site comes from another host: a script, style, font or picture from elsewhere fails a strict build."""

from __future__ import annotations

import logging
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.pages import Page

LOADED = re.compile(
    r"""<(?:script|img|iframe|source|video)\b[^>]*\bsrc=["']?(https?:)?//|<link\b[^>]*\bhref=["']?(https?:)?//"""
)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """The page as it is, with a warning if it loads something from another host."""
    for found in loads(output):
        logging.getLogger("mkdocs.hooks").warning("%s loads from another host: %s", page.file.src_uri, found)
    return output


def loads(html: str) -> list[str]:
    """The tags by which a page loads something from another host; links to follow are no such tags."""
    return [found[0] for found in LOADED.finditer(html)]

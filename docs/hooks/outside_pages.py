"""Pages of the site that lie at the root of the repository, and the links to and from them."""

from __future__ import annotations

import re
from os.path import normpath, relpath
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
PAGES = {"BENCHMARKS.md": "benchmarks.md", "CHANGELOG.md": "changelog.md", "README.md": "index.md"}
"""Files at the root, and the pages of the site that hold or stand for them."""
LINK = re.compile(r"(?<=\]\()(?P<path>[^)#:\s]+)(?=[)#])")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The pages of docs/, and those of the root that are not there in another form."""
    from mkdocs.structure.files import File

    for name, page in PAGES.items():
        if files.get_file_from_path(page) is None:
            files.append(File.generated(config, page, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page with links between root and docs/ as the site has them."""
    source = Path(page.file.abs_src_path).relative_to(ROOT).as_posix()
    return LINK.sub(lambda link: link_on_site(link["path"], source, page.file.src_uri), markdown)


def link_on_site(link: str, source: str, page: str) -> str:
    """The link to where the file lies on the site; unchanged if it is no part of it.

    Args:
        link: Relative path as the file at `source` has it.
        source: Path of that file in the repository.
        page: Path of its page in the site's sources.
    """
    target = normpath(PurePosixPath(source).parent / link)
    on_site = PAGES.get(target) or (target.removeprefix("docs/") if target.startswith("docs/") else None)
    return link if on_site is None else relpath(on_site, PurePosixPath(page).parent)

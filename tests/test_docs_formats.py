"""docs/formats.md names every format there is."""

from pathlib import Path

import ldls
from ldls.io.points import READERS
from ldls.viewing.formats import ENDINGS

PAGE = (Path(__file__).parents[1] / "docs/formats.md").read_text()
POINTS, RESULTS, CAMERAS = PAGE.split("\n## ")[1:]


def test_every_format_has_its_row():
    assert [suffix for suffix in READERS if f"`{suffix}`" not in POINTS] == []
    assert [
        word for word, ending in ENDINGS.items() if f"`{word}`" not in RESULTS or f"`{ending}`" not in RESULTS
    ] == []


def test_every_source_of_a_camera_has_its_row():
    sources = [name for name in vars(ldls.Camera) if name.startswith("from_")]
    assert [name for name in sources if f"Camera.{name}(" not in CAMERAS] == []

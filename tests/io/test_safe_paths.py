"""Paths that a file names."""

import pytest

import ldls
from ldls.io.files import below, strictly_below


@pytest.mark.parametrize("name", ["a/b.bin", "./a.bin", "a/..b/c"])
def test_paths_below_are_taken(tmp_path, name):
    assert strictly_below(tmp_path, name, place="table") == below(tmp_path, name, place="table") == tmp_path / name


@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "/etc/passwd", "C:/x", "C:x", "a\\..\\..\\x", "\\\\host\\share\\x", "a\0b", ""]
)
def test_paths_that_lead_out_are_refused(tmp_path, name):
    with pytest.raises(ldls.UnsafePathError, match="table: path"):
        below(tmp_path, name, place="table")


def test_links_may_lead_on_unless_strict(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in/link").symlink_to(tmp_path)
    assert below(tmp_path / "in", "link/x", place="table")
    with pytest.raises(ldls.UnsafePathError, match="by a link"):
        strictly_below(tmp_path / "in", "link/x", place="table")

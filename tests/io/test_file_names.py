"""Names of files that are long, no UTF-8 or from afar, and folders that may not be written."""

import errno
import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import ldls
from ldls.io.labels import read_labeling
from mask_samples import random_masks

NAMES = {
    "letters of many languages": "ÄÖü-Ω-Жук-叉车-🚗",
    "blanks and quotes": " a 'b' \"c\"; $(d) %s {e}",
    "a line break": "a\nb",
    "no UTF-8": os.fsdecode(b"\xff\xfe\x80"),
    "250 letters": "n" * 250,
    "a dash first": "-rf",
}


@pytest.mark.parametrize("name", [pytest.param(name, id=what) for what, name in NAMES.items()])
@pytest.mark.parametrize("suffix", [".npz", ".json", ".png", ".npy"])
def test_any_name_that_the_system_takes_is_written_and_read(tmp_path, name, suffix):
    masks = ldls.InstanceMasks.from_array(np.eye(4, dtype=bool)[None])
    ldls.save(masks, tmp_path / (name + suffix))
    assert ldls.read_masks(tmp_path / (name + suffix)) == masks
    assert [path.name for path in tmp_path.iterdir()] == [name + suffix]


@pytest.mark.parametrize("name", [pytest.param(name, id=what) for what, name in NAMES.items()])
def test_errors_name_such_files(tmp_path, name):
    path = tmp_path / f"{name[:240]}.label"
    path.write_bytes(b"abc")
    with pytest.raises(ldls.TruncatedFileError) as caught:
        read_labeling(path)
    assert str(caught.value).startswith(f"{path}: 3 bytes")


@pytest.mark.parametrize("read", [ldls.read_masks, read_labeling, ldls.read_result], ids=["masks", "labels", "result"])
def test_names_that_are_too_long_stay_errors_of_the_system(tmp_path, read):
    with pytest.raises(OSError, match="nnnn") as caught:
        read(tmp_path / ("n" * 300 + ".npz"))
    assert caught.value.errno == errno.ENAMETOOLONG


@contextmanager
def nobody():
    """Without the rights of root, to whom nothing is forbidden."""
    own = os.geteuid()
    if own == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(own)


@pytest.fixture
def closed():
    """Folder that may not be written."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o555)
        yield folder
        folder.chmod(0o755)


@pytest.mark.parametrize("suffix", [".npz", ".json", ".png"])
def test_a_folder_that_may_not_be_written_gives_an_error_with_the_path_and_stays_empty(closed, suffix):
    masks = random_masks(1).resolve_overlaps()
    with nobody(), pytest.raises(PermissionError, match=str(closed)):
        ldls.save(masks, closed / f"masks{suffix}")
    assert list(closed.iterdir()) == []


@pytest.mark.parametrize("suffix", [".npz", ".json", ".png", ".npy"])
def test_a_file_that_may_not_be_read_gives_an_error_with_the_path(closed, suffix):
    path = closed / f"masks{suffix}"
    closed.chmod(0o755)
    path.touch()
    path.chmod(0)
    with nobody(), pytest.raises(PermissionError, match=str(path)):
        ldls.read_masks(path)

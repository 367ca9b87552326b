import os

import pytest

import ldls
from ldls.io.masks.formats import READERS
from mask_samples import random_masks

MASKS = random_masks(1)


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize("make", [pytest.param(os.mkdir, id="folder"), pytest.param(os.mkfifo, id="pipe")])
def test_what_is_no_file_is_refused(tmp_path, suffix, make):
    path = tmp_path / f"masks{suffix}"
    make(path)
    with pytest.raises(ldls.FileFormatError, match=rf"masks\{suffix}: expected a regular file"):
        ldls.read_masks(path, image_size=(4, 5))


@pytest.mark.parametrize("suffix", READERS)
def test_a_missing_file_is_missing(tmp_path, suffix):
    with pytest.raises(FileNotFoundError):
        ldls.read_masks(tmp_path / f"masks{suffix}", image_size=(4, 5))


def test_an_unknown_suffix_is_answered_with_the_known(tmp_path):
    with pytest.raises(ldls.UnsupportedFormatError, match=r"read '.tif' masks, expected .json, .png, .npz, .npy, .txt"):
        ldls.read_masks(tmp_path / "masks.tif")
    with pytest.raises(ldls.UnsupportedFormatError, match=r"write '.txt' masks, expected .json, .png, .npz, .npy"):
        ldls.save(MASKS, tmp_path / "masks.txt")


def test_capitals_in_the_suffix_are_fine(tmp_path):
    ldls.save(MASKS, tmp_path / "MASKS.JSON")
    assert len(ldls.read_masks(tmp_path / "MASKS.JSON")) == len(MASKS)


def test_options_of_other_formats_are_refused(tmp_path):
    ldls.save(MASKS, tmp_path / "masks.npz")
    with pytest.raises(ldls.ParameterError, match=r"image_id: no option of .npz masks \(.*masks.npz\); they have none"):
        ldls.read_masks(tmp_path / "masks.npz", image_id=3)
    with pytest.raises(ldls.ParameterError, match="results: no option of .npz masks .*expected layout"):
        ldls.save(MASKS, tmp_path / "other.npz", results=True)


@pytest.mark.parametrize("name", ["masks.json", "masks.npz"])
def test_another_size_than_the_images_is_refused(tmp_path, name):
    ldls.save(MASKS, tmp_path / name)
    with pytest.raises(ldls.MaskError, match="swapped"):
        ldls.read_masks(tmp_path / name, image_size=MASKS.image_size[::-1])


@pytest.mark.parametrize("size", [5, (4, 5, 3), (4.0, 5), (-4, 5), "45"])
def test_a_size_that_is_none_is_refused(tmp_path, size):
    ldls.save(MASKS, tmp_path / "masks.npz")
    with pytest.raises(ldls.MaskError, match=r"size is .*expected \(height, width\)"):
        ldls.read_masks(tmp_path / "masks.npz", image_size=size)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_may_not_be_written_stays_empty(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OSError, match=str(tmp_path)):
        ldls.save(MASKS, tmp_path / "masks.json")
    assert list(tmp_path.iterdir()) == []

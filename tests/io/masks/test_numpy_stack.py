import numpy as np
import pytest

import ldls
from mask_samples import plain, random_masks

PIXELS = np.random.default_rng(1).random((3, 11, 17)) > 0.5
LAST = np.moveaxis(PIXELS, 0, -1)


def saved(tmp_path, array):
    np.save(tmp_path / "masks.npy", array)
    return tmp_path / "masks.npy"


@pytest.mark.parametrize(
    ("array", "options"),
    [
        pytest.param(PIXELS, {}, id="first by default"),
        pytest.param(PIXELS, {"image_size": (11, 17)}, id="first by the image's size"),
        pytest.param(LAST, {"image_size": (11, 17)}, id="last by the image's size"),
        pytest.param(LAST, {"instance_axis": -1}, id="last as said"),
        pytest.param(PIXELS, {"instance_axis": 0}, id="first as said"),
        pytest.param(PIXELS.astype(np.uint8) * 255, {}, id="0 and 255"),
        pytest.param(np.where(PIXELS, 0.9, 0.1).astype(">f4"), {}, id="big-endian probabilities"),
        pytest.param(np.asfortranarray(PIXELS), {}, id="Fortran order"),
    ],
)
def test_a_stack_becomes_masks(tmp_path, array, options):
    masks = ldls.read_masks(saved(tmp_path, array), **options)
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert masks[0].name == "object"


def test_arrays_say_which_axis_counts():
    np.testing.assert_array_equal(ldls.InstanceMasks.from_array(LAST, instance_axis=-1).to_array(), PIXELS)
    with pytest.raises(ldls.ParameterError, match="instance_axis: got 1, expected 0 or -1"):
        ldls.InstanceMasks.from_array(PIXELS, instance_axis=1)


def test_categories_and_scores_can_be_given(tmp_path):
    path = saved(tmp_path, PIXELS)
    masks = ldls.read_masks(path, categories=[1, 3, 101], scores=[0, 0.5, 1], names={1: "a", 3: "b", 101: "c"})
    assert [(mask.name, mask.score) for mask in masks] == [("a", 0.0), ("b", 0.5), ("c", 1.0)]


@pytest.mark.parametrize(
    ("array", "options", "error", "message"),
    [
        pytest.param(
            LAST,
            {},
            ldls.MaskError,
            "11 masks of 17 x 3 or 3 of 11 x 17 .*instance_axis=0 or instance_axis=-1",
            id="unclear",
        ),
        pytest.param(np.zeros((5, 5, 5)), {"image_size": (5, 5)}, ldls.MaskError, "pass instance_axis=", id="a cube"),
        pytest.param(PIXELS, {"image_size": (17, 11)}, ldls.MaskError, r"image is \(17, 11\)", id="another size"),
        pytest.param(
            PIXELS,
            {"image_size": (17, 11), "instance_axis": 0},
            ldls.MaskError,
            r"masks of \(11, 17\) .* image is \(17, 11\); swapped",
            id="swapped",
        ),
        pytest.param(PIXELS, {"instance_axis": 2}, ldls.ParameterError, "instance_axis: got 2", id="axis 2"),
        pytest.param(PIXELS[0], {}, ldls.MaskError, "from_instance_image", id="flat"),
        pytest.param(np.array([{}]), {}, ldls.UnsafeFileError, "object arrays are not loaded", id="pickle"),
        pytest.param(np.full((1, 4, 5), np.nan), {}, ldls.MaskError, r"mask 0: pixel \(0, 0\) is nan", id="NaN"),
        pytest.param(
            np.array([[[0.5, 0.25], [np.nan, 0]]]), {}, ldls.MaskError, r"pixel \(1, 0\) is nan", id="NaN among others"
        ),
        pytest.param(np.full((1, 4, 5), -1), {}, ldls.MaskError, r"mask 0: pixel \(0, 0\) is -1", id="-1"),
        pytest.param(np.array([[[0.5, 255.0]]]), {}, ldls.MaskError, "is 0.5", id="probabilities beside 255"),
    ],
)
def test_faults_of_stacks_are_named(tmp_path, array, options, error, message):
    with pytest.raises(error, match=message) as caught:
        ldls.read_masks(saved(tmp_path, array), **options)
    assert "masks.npy" in str(caught.value) or error is ldls.ParameterError


@pytest.mark.parametrize(
    ("content", "error"),
    [
        pytest.param(b"", ldls.CorruptFileError, id="empty"),
        pytest.param(b"\x93NUMPY\x01\x00", ldls.CorruptFileError, id="no header"),
        pytest.param(b"PK\x03\x04" + bytes(99), ldls.CorruptFileError, id="a zip archive"),
    ],
)
def test_files_that_are_no_arrays_are_corrupt(tmp_path, content, error):
    (tmp_path / "masks.npy").write_bytes(content)
    with pytest.raises(error, match=r"masks\.npy: not a whole \.npy file"):
        ldls.read_masks(tmp_path / "masks.npy")


def test_a_cut_stack_is_truncated(tmp_path):
    path = saved(tmp_path, PIXELS)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(
        ldls.TruncatedFileError, match=r"masks\.npy: shape \(3, 11, 17\) of bool needs 689 bytes, got 688"
    ):
        ldls.read_masks(path)


def test_what_would_be_lost_is_refused(tmp_path):
    masks = random_masks(1)
    with pytest.raises(ldls.MaskError, match=r"keep pixels only; save as .*pixels_only=True"):
        ldls.save(masks, tmp_path / "masks.npy")
    ldls.save(masks, tmp_path / "masks.npy", pixels_only=True)
    np.testing.assert_array_equal(np.load(tmp_path / "masks.npy"), masks.to_array())
    assert ldls.read_masks(tmp_path / "masks.npy") == plain(masks)

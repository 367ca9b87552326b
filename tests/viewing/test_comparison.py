"""The comparison says and marks what changed, and pictures become files."""

import importlib
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import ldls
from ldls.simulation import sample_frame
from ldls.viewing import comparison, save_pictures
from ldls.viewing.comparison import captions
from ldls.viewing.depth import depth_picture


def test_captions_count_what_changed(result) -> None:
    before, after = result.direct_labels, result.labels
    lost = moved = won = 0
    for one, other in zip(before.tolist(), after.tolist(), strict=True):
        lost += one > 0 and other == 0
        moved += one > 0 and other > 0 and one != other
        won += one == 0 and other > 0
    assert lost > 0
    numbers = [[int(n.replace(",", "")) for n in re.findall(r"[\d,]*\d", caption)] for caption in captions(result)]
    assert numbers == [[(before > 0).sum(), lost, moved], [(after > 0).sum(), won, moved]]


@pytest.mark.parametrize(
    ("size", "stacked"),
    [pytest.param((60, 80), False, id="side by side"), pytest.param((30, 80), True, id="wide images stacked")],
)
def test_the_two_stand_where_there_is_room(small_scene, size, stacked) -> None:
    points, _, camera = small_scene
    masks = ldls.InstanceMasks.from_boxes([[17, 5, 29, 28]], size, categories=[3])
    picture = comparison(ldls.segment(points, masks, camera))
    height = size[0] * 1800 / size[1]
    above = 2 * (height + 30) if stacked else height / 2 + 30
    assert picture.width == 1800
    assert picture.height == pytest.approx(above + 30 + 897, abs=4)


def test_without_change_nothing_is_marked(small_scene) -> None:
    points, masks, camera = small_scene
    nothing = ldls.segment(points, masks.select([]), camera)
    picture = np.asarray(comparison(nothing))
    top = picture[40 : picture.shape[0] // 3]
    assert not (top == 255).all(axis=2).any()


def test_a_ring_is_compared_too(small_scene) -> None:
    points, masks, camera = small_scene
    result = ldls.segment(points, [ldls.View(masks, camera, "left"), ldls.View(masks, camera, "right")])
    picture = comparison(result)
    # a row a camera, then the views from above
    assert picture.width == 1800
    assert picture.height == 2 * (round(897 * 60 / 80) + 30) + 30 + 897


def test_every_picture_of_a_ring_has_the_name_of_its_camera(small_scene, monkeypatch) -> None:
    points, masks, camera = small_scene
    result = ldls.segment(points, [ldls.View(masks, camera, "left"), ldls.View(masks, camera, "right")])
    written = []
    module = importlib.import_module("ldls.viewing.comparison")
    drawn = module.grid
    monkeypatch.setattr(module, "grid", lambda each, own=(), **how: written.append([*own]) or drawn(each, own, **how))
    comparison(result)
    of_cameras = [f"{name}: {method}" for name in ("left", "right") for method in ("direct projection", "ldls")]
    assert of_cameras in written
    assert captions(result) in written


def test_points_over_several_images_have_the_names_of_the_cameras() -> None:
    frame = sample_frame()
    (image,) = frame.images
    (alone, left, longer) = (
        np.asarray(depth_picture(replace(frame, images=images)))
        for images in (
            (image,),
            (replace(image, name="left"), replace(image, name="right")),
            (replace(image, name="left"), replace(image, name="right_front")),
        )
    )
    assert alone.shape[:2] == (375, 1242)
    assert left.shape[:2] == (290 + 30, 2 * 960)
    assert (left[:30, :960] == longer[:30, :960]).all() and (left[:30, 960:] != longer[:30, 960:]).any()


def test_three_files(result, tmp_path) -> None:
    written = save_pictures(tmp_path / "a.png", result)
    assert [path.name for path in written] == ["a.png", "a-birds-eye.png", "a-comparison.png"]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    for path in written:
        with Image.open(path) as picture:
            picture.load()
            assert picture.mode == "RGB"


def test_other_endings_are_refused(result, tmp_path) -> None:
    with pytest.raises(ldls.UnsupportedFormatError, match=r"cannot write '.jpg' pictures, expected .png"):
        save_pictures(tmp_path / "a.jpg", result)
    assert not list(tmp_path.iterdir())

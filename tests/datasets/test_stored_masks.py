"""Stored masks: a file for each image or one for all, beside a source or named by it."""

import json
import pickle

import pytest

import ldls
from datasets import layouts
from ldls.datasets import open_source
from ldls.datasets.stored_masks import StoredMasks, own_masks
from ldls.errors import CorruptFileError, InputError

NAMES = ("a", "b", "c", "d")
ONE_FILE = layouts.FOLDER_TOML.replace("masks/{frame}.npz", "instances.json")
TWO_CAMERAS = ONE_FILE + ONE_FILE[ONE_FILE.index("[cameras.front]") :].replace("front", "back")


def data_set(path, *names):
    """COCO's file of images, each with masks of its own."""
    documents = [layouts.coco(10 + 3 * k) for k in range(len(names))]
    images = [documents[0]["images"][0] | {"id": k, "file_name": name} for k, name in enumerate(names)]
    annotations = [a | {"image_id": k} for k, document in enumerate(documents) for a in document["annotations"]]
    content = {"images": images, "categories": documents[0]["categories"], "annotations": annotations}
    layouts.write_text(path, json.dumps(content))
    return path


def lefts(masks):
    return [each[0].bounding_box[1] for each in masks]


@pytest.mark.parametrize("name", ["{}.png", "front/{}.jpg", "task/{}"])
def test_one_file_serves_the_images_of_a_source(tmp_path, name):
    source = open_source(layouts.plain_folder(tmp_path / "rig", frames=NAMES))
    stored = StoredMasks(str(data_set(tmp_path / "all.json", *(name.format(frame) for frame in "dcba"))))
    stored.check_names(source)
    assert [lefts(stored.read(frame)) for frame in source] == [[19], [16], [13], [10]]
    assert stored.files("a", ["front"]) == ()


def test_one_file_of_other_images_is_refused_with_names_of_both(tmp_path):
    source = open_source(layouts.plain_folder(tmp_path / "rig", frames=NAMES))
    stored = StoredMasks(str(data_set(tmp_path / "all.json", "w.png", "x.png", "y.png", "z.png")))
    with pytest.raises(
        InputError, match=r"it has 'w\.png', 'x\.png', 'y\.png' and 1 more, the frames are 'a', 'b', 'c'"
    ):
        stored.check_names(source)


def test_a_folder_names_one_file_of_all_masks(tmp_path):
    folder = layouts.plain_folder(tmp_path / "rig", ONE_FILE)
    data_set(folder / "instances.json", "front/b.png", "front/a.png")
    source = open_source(folder)
    assert own_masks(source) == {"front": "instances.json"}
    assert folder / "instances.json" in source.files(0)
    for opened in (source, pickle.loads(pickle.dumps(source))):
        assert [lefts([frame.images[0].masks]) for frame in opened] == [[13], [10]]


def test_cameras_of_a_folder_share_a_file(tmp_path):
    folder = layouts.plain_folder(tmp_path / "rig", TWO_CAMERAS)
    for name in "ab":
        layouts.write_image(folder / f"back/{name}.png")
    data_set(folder / "instances.json", "front/a.png", "back/a.png", "front/b.png")
    source = open_source(folder)
    assert lefts(image.masks for image in source[0].images) == [10, 13]
    with pytest.raises(InputError, match=r"'front/b.png' may be of another camera of frame b than back"):
        source[1]


def test_a_folder_whose_file_of_masks_is_broken_is_refused(tmp_path):
    folder = layouts.plain_folder(tmp_path / "rig", ONE_FILE)
    layouts.write_text(folder / "instances.json", "{")
    with pytest.raises(CorruptFileError, match=r"instances\.json: not a whole JSON file"):
        open_source(folder)


def test_masks_named_by_the_source_and_none(tmp_path):
    layouts.kitti_object(tmp_path / "kitti")
    (tmp_path / "kitti/masks").mkdir()
    for name in ("000000", "000001", "000002"):
        ldls.save(ldls.InstanceMasks([], layouts.SIZE), tmp_path / f"kitti/masks/{name}.json")
    assert own_masks(open_source(tmp_path / "kitti", masks="masks")) == {"image_2": "masks"}
    assert own_masks(open_source(tmp_path / "kitti")) == {}
    assert own_masks(open_source(layouts.kitti_raw(tmp_path / "raw"))) == {}


@pytest.mark.parametrize(
    ("place", "message"),
    [("none", "there is no"), ("all.txt", "is no folder and has no {frame} in it"), ("masks.npz", "there is no")],
)
def test_places_that_are_none(tmp_path, place, message):
    layouts.write_text(tmp_path / "all.txt", "0 0.1 0.1 0.2 0.2 0.3 0.3\n")
    with pytest.raises(InputError, match=rf"{message}.*; .* or one \.json with the masks of all"):
        StoredMasks(str(tmp_path / place))

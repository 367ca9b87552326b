"""One file with the masks of many images: images are found by their names, and read as those of a file for each."""

import hashlib
import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import ldls
from datasets import layouts
from ldls.errors import CorruptFileError, InputError, MaskError, UnsupportedFormatError
from ldls.io.masks.data_set import MaskDataSet


def data_set(*names, **changed):
    """COCO's file of images with two objects each, at another place in each."""
    documents = [layouts.coco(10 + k) for k in range(len(names))]
    images = [
        document["images"][0] | {"id": k, "file_name": name}
        for k, (name, document) in enumerate(zip(names, documents, strict=True))
    ]
    annotations = [a | {"image_id": k} for k, document in enumerate(documents) for a in document["annotations"]]
    return {"images": images, "categories": documents[0]["categories"], "annotations": annotations} | changed


def write(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def find(path, frame, image=None, camera="front", **others):
    return MaskDataSet(path).find(frame, camera, {camera: None if image is None else Path(image), **others})


@pytest.mark.parametrize("order", ["images first", "annotations first", "indented", "with a byte order mark"])
def test_masks_of_an_image_are_those_that_read_masks_finds(tmp_path, order):
    content = data_set("a.png", "b.png", "c.png") | {"info": {"annotations": [1]}, "licenses": []}
    if order == "annotations first":
        content = dict(reversed(content.items()))
    text = json.dumps(content, indent=1 if order == "indented" else None)
    path = write(tmp_path / "all.json", "\ufeff" + text if order == "with a byte order mark" else text)
    opened = MaskDataSet(path)
    assert opened.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert opened.names == {0: "a.png", 1: "b.png", 2: "c.png"}
    for image_id in range(3):
        expected = ldls.read_masks(path, image_id=image_id).to_coco()
        assert opened.masks(image_id, layouts.SIZE).to_coco() == expected
        assert pickle.loads(pickle.dumps(opened)).masks(image_id).to_coco() == expected
    assert opened.masks(0).to_coco() != opened.masks(1).to_coco()


@pytest.mark.parametrize(
    ("name", "frame", "image"),
    [
        pytest.param("000571.png", "000571", "/kitti/image_2/000571.png", id="the same name"),
        pytest.param("000571.jpg", "000571", "/kitti/image_2/000571.png", id="another ending"),
        pytest.param("image_2/000571.PNG", "000571", "/kitti/image_2/000571.png", id="with the folder"),
        pytest.param("train\\b\\000571.png", "000571", "/kitti/image_2/000571.png", id="of Windows, of other folders"),
        pytest.param("000571", "000571", "/kitti/image_2/000571.png", id="without ending"),
        pytest.param("000571_png.rf.0a1B2c.jpg", "000571", "/kitti/image_2/000571.png", id="as Roboflow exports it"),
        pytest.param("17000.25.png", "17000.25", None, id="a stamp with a point, no file"),
        pytest.param("front/000571.png", "000571", "/rig/left_571.png", id="frame, not image"),
    ],
)  # fmt: skip
def test_images_are_found_by_name(tmp_path, name, frame, image):
    path = write(tmp_path / "all.json", data_set("other.png", name))
    assert find(path, frame, image) == 1


def test_numbers_of_results_are_names_without_zeros(tmp_path):
    segment = {"size": [60, 80], "counts": [10, 20, 4770]}
    results = [{"image_id": 571, "category_id": 1, "score": 0.5, "segmentation": segment}]
    path = write(tmp_path / "predictions.json", [results[0] | {"image_id": 3}, *results, *results])
    assert find(path, "000571", "image_2/000571.png") == 571
    assert len(MaskDataSet(path).masks(571, layouts.SIZE)) == 2


def test_folders_tell_images_of_one_name_apart(tmp_path):
    names = ["one/image_2/000001.png", "one/image_3/000001.png", "two/image_2/000001.png"]
    path = write(tmp_path / "all.json", data_set(*names))
    assert [find(path, "000001", f"/data/{name}") for name in names] == [0, 1, 2]
    assert find(path, "000001", "/data/two/000001.png") == 2
    with pytest.raises(InputError, match=r"'one/image_2/000001.png', 'two/image_2/000001.png' may all be the image of"):
        find(path, "000001", "/data/image_2/000001.png")


def test_cameras_are_told_by_folder_by_name_or_by_the_file(tmp_path):
    path = write(tmp_path / "all.json", data_set("left/1.png", "right/1.png"))
    assert find(path, "1", camera="left", right=None) == 0
    assert find(path, "1", "/rig/right/1.png", camera="b", a=Path("/rig/left/1.png")) == 1
    path = write(tmp_path / "own.json", data_set("1_left.png", "1_right.png"))
    assert find(path, "1", "/rig/1_right.png", camera="b", a=Path("/rig/1_left.png")) == 1


@pytest.mark.parametrize("name", ["rig/1.png", "1.png", "right/1.png"])
def test_an_image_that_may_be_of_another_camera_is_refused(tmp_path, name):
    path = write(tmp_path / "all.json", data_set(name))
    with pytest.raises(InputError, match=r"may be of another camera of frame 1 than left; .* as left/1\.png"):
        find(path, "1", "/rig/left/1.png", camera="left", right=Path("/rig/right/1.png"))


def test_a_name_that_is_not_there(tmp_path):
    path = write(tmp_path / "all.json", data_set(*(f"{name}.png" for name in "abcde")))
    with pytest.raises(InputError, match=r"all\.json: has no x, the image of camera front in frame x; its file names"):
        find(path, "x")
    with pytest.raises(InputError, match=r"'a\.png', 'b\.png', 'c\.png' and 2 more"):
        find(path, "x")


def test_an_image_without_annotations_has_no_masks(tmp_path):
    content = data_set("a.png", "b.png")
    content["annotations"] = content["annotations"][:2]
    masks = MaskDataSet(write(tmp_path / "all.json", content)).masks(1, layouts.SIZE)
    assert (len(masks), masks.image_size) == (0, layouts.SIZE)


def test_an_image_of_another_size_is_refused(tmp_path):
    opened = MaskDataSet(write(tmp_path / "all.json", data_set("a.png")))
    with pytest.raises(MaskError, match=r"all\.json: masks of \(60, 80\) \(height, width\), the image is \(80, 60\)"):
        opened.masks(0, (80, 60))


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        pytest.param({"shapes": []}, UnsupportedFormatError, "has no file names of images", id="labelme"),
        pytest.param([{"segmentation": {}, "predicted_iou": 1}], UnsupportedFormatError, "of one image", id="SAM"),
        pytest.param(data_set("a", images=[{"id": 0}]), UnsupportedFormatError, "no file names", id="no file name"),
        pytest.param(data_set("a", annotations=[{"image_id": 7}]), MaskError, "image_id 7, which no", id="no image"),
        pytest.param(data_set("a", annotations=[5]), CorruptFileError, "list of objects", id="no object"),
        pytest.param(data_set("a", images=5), CorruptFileError, "images to be a list of objects", id="no images"),
        pytest.param(json.dumps(data_set("a"))[:-3], CorruptFileError, "not a whole JSON file", id="cut off"),
        pytest.param('{"annotations": [NaN]}', CorruptFileError, "not a whole JSON file", id="NaN"),
        pytest.param("5", CorruptFileError, "not a whole JSON file", id="a number"),
        pytest.param("", CorruptFileError, "not a whole JSON file", id="empty"),
    ],
)
def test_what_is_no_data_set_is_refused_by_name(tmp_path, content, error, message):
    path = write(tmp_path / "all.json", content)
    with pytest.raises(error, match=message) as caught:
        MaskDataSet(path)
    assert str(caught.value).startswith(str(path))


def test_panoptic_segments_of_many_images(tmp_path):
    layouts.write_image(tmp_path / "b.png")  # one colour: segment 10 + 90 * 256 + 200 * 65536
    segment = {"id": 10 + 90 * 256 + 200 * 65536, "category_id": 3, "isthing": 1}
    content = data_set("a.jpg", "b.jpg", categories=[{"id": 3, "name": "car", "isthing": 1}])
    content["annotations"] = [{"image_id": 1, "file_name": "b.png", "segments_info": [segment]}]
    opened = MaskDataSet(write(tmp_path / "all.json", content))
    assert opened.find("b", "front", {"front": None}) == 1
    assert [mask.area for mask in opened.masks(1, layouts.SIZE)] == [60 * 80]
    assert len(opened.masks(0, layouts.SIZE)) == 0


MEASURE = """
import sys, tracemalloc
from ldls.io.masks.data_set import MaskDataSet
tracemalloc.start()
opened = MaskDataSet(sys.argv[1])
print(len(opened.names), *tracemalloc.get_traced_memory())
"""


def test_memory_is_about_the_size_of_the_file(tmp_path):
    content = data_set(*(f"{k}.png" for k in range(2000)))
    for annotation in content["annotations"]:
        annotation["segmentation"] = [[float(k % 50) for k in range(200)]]
    path = write(tmp_path / "all.json", content)
    del content
    # in a process of its own, where nobody else allocates
    done = subprocess.run([sys.executable, "-c", MEASURE, path], capture_output=True, text=True, check=True)
    count, kept, peak = map(int, done.stdout.split())
    assert count == 2000
    assert kept < 2 * path.stat().st_size < peak + path.stat().st_size < 4 * path.stat().st_size

import json

import numpy as np
import pytest
from pycocotools import mask as cocomask
from pycocotools.coco import COCO

import ldls
from mask_samples import NAMES, random_masks

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools
RLE = {"size": [4, 5], "counts": [3, 2, 15]}


def document(**parts):
    return {
        "images": [{"id": 1, "height": 4, "width": 5}],
        "categories": [{"id": 1, "name": "person"}],
        "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "segmentation": RLE}],
    } | parts


def test_the_coco_tools_read_what_is_written(tmp_path):
    masks = random_masks(1)
    ldls.save(masks, tmp_path / "masks.json", image_id=7, file_name="000007.png")
    coco = COCO(tmp_path / "masks.json")
    assert coco.imgs[7] == {"id": 7, "height": masks.height, "width": masks.width, "file_name": "000007.png"}
    assert {category["id"]: category["name"] for category in coco.cats.values()} == NAMES
    for mask, annotation in zip(masks, coco.loadAnns(coco.getAnnIds(imgIds=7)), strict=True):
        np.testing.assert_array_equal(coco.annToMask(annotation), mask.to_array())
        assert annotation["area"] == cocomask.area(annotation["segmentation"])
        assert annotation["bbox"] == cocomask.toBbox(annotation["segmentation"]).tolist()
        assert (annotation["category_id"], annotation["score"]) == (mask.category, mask.score)
        assert annotation["iscrowd"] == 0
    assert [annotation["id"] for annotation in coco.dataset["annotations"]] == list(range(1, len(masks) + 1))


def test_the_coco_tools_read_bare_results(tmp_path):
    masks = random_masks(2)
    ldls.save(masks, tmp_path / "masks.json")
    ldls.save(masks, tmp_path / "results.json", results=True)
    found = COCO(tmp_path / "masks.json").loadRes(str(tmp_path / "results.json"))
    assert [a["score"] for a in found.dataset["annotations"]] == masks.scores.tolist()


def test_the_document_of_masks_is_the_content_of_their_file(tmp_path):
    masks = random_masks(4)
    ldls.save(masks, tmp_path / "masks.json", file_name="a.png")
    assert json.loads((tmp_path / "masks.json").read_text()) == masks.to_coco(file_name="a.png")
    assert ldls.InstanceMasks.from_coco(masks.to_coco()) == masks


def test_ids_and_names_of_numpy_are_written(tmp_path):
    names = {np.int64(3): np.str_("car")}
    masks = ldls.InstanceMasks.from_array(np.ones((1, 4, 5)), categories=[3], names=names)
    ldls.save(masks, tmp_path / "a.json", image_id=np.int64(4))
    ldls.save(masks, tmp_path / "results.json", image_id=np.int64(4), results=True)
    assert json.loads((tmp_path / "a.json").read_text()) == masks.to_coco(image_id=np.int64(4))
    assert {type(key) for key in masks.names} == {int} and {type(name) for name in masks.names.values()} == {str}
    (result,) = json.loads((tmp_path / "results.json").read_text())
    assert result["image_id"] == 4
    assert len(ldls.read_masks(tmp_path / "a.json", image_id=np.int64(4))) == 1


def test_names_serve_where_the_source_has_none():
    results = [{"category_id": 104, "segmentation": RLE}]
    assert ldls.InstanceMasks.from_coco(results, names={104: "crane"})[0].name == "crane"
    assert ldls.InstanceMasks.from_coco(document(), names={1: "pedestrian"})[0].name == "person"


def test_annotations_of_a_category_that_is_named_background_are_left_out():
    (one,) = document()["annotations"]
    categories = [{"id": 0, "name": "Background"}, {"id": 1, "name": "person"}]
    masks = ldls.InstanceMasks.from_coco(document(annotations=[one | {"category_id": 0}, one], categories=categories))
    assert [mask.name for mask in masks] == ["person"]


def test_ids_of_annotations_may_repeat_and_crowds_are_instances():
    annotation = document()["annotations"][0]
    masks = ldls.InstanceMasks.from_coco(document(annotations=[annotation, annotation | {"iscrowd": 1}]))
    assert [mask.area for mask in masks] == [2, 2]


@pytest.mark.parametrize(
    ("parts", "error", "message"),
    [
        pytest.param(
            {
                "categories": [{"id": 0, "name": "person"}],
                "annotations": [{"id": 9, "category_id": 0, "segmentation": RLE}],
            },
            ldls.MaskError,
            "annotation 9: category_id is 0, which stands for background .* number categories from 1",
            id="category 0",
        ),
        pytest.param(
            {"categories": [{"id": 1, "name": "car"}, {"id": 1, "name": "bus"}]},
            ldls.CorruptFileError,
            r"categories\[1\] has id 1, which another",
            id="two categories of one id",
        ),
        pytest.param(
            {"images": [{"id": 1, "height": 4, "width": 5}, {"id": 1, "height": 5, "width": 4}]},
            ldls.CorruptFileError,
            r"images\[1\] has id 1, which another",
            id="two images of one id",
        ),
        pytest.param({"categories": [{"name": "car"}]}, ldls.CorruptFileError, "id None", id="category without id"),
        pytest.param(
            {"images": [{"id": [1]}]}, ldls.CorruptFileError, r"id \[1\], expected int or str", id="list as id"
        ),
        pytest.param(
            {"annotations": [{"image_id": {}}]},
            ldls.CorruptFileError,
            "annotation 0: image_id is {}",
            id="object as id",
        ),
        pytest.param({"images": [{"id": 1, "height": 4.0, "width": 5}]}, ldls.MaskError, "size is", id="height 4.0"),
        pytest.param(
            {"images": [], "annotations": [{"segmentation": {"size": 5}}]}, ldls.MaskError, "size is 5", id="size 5"
        ),
        pytest.param({"images": [{"id": 1}], "annotations": []}, ldls.MaskError, "pass image_size=", id="no size"),
        pytest.param(
            {"images": [{"id": 1, "height": 1 << 20, "width": 1 << 20}]}, ldls.MaskError, "image is", id="huge image"
        ),
        pytest.param(
            {"annotations": [{"category_id": 1, "segmentation": [[0, 0, 1e999, 1, 3, 3]]}]},
            ldls.MaskError,
            "annotation 0: .*inf",
            id="polygon to infinity",
        ),
    ],
)
def test_faults_of_documents_are_named(parts, error, message):
    with pytest.raises(error, match=message):
        ldls.InstanceMasks.from_coco(document(**parts))


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("[" * 1_000_000, id="a million lists"),
        pytest.param('{"a":' * 1_000_000, id="a million objects"),
        pytest.param('{"annotations": [], "images": [{"id": 1, "height": NaN}]}', id="NaN"),
        pytest.param('{"annotations": [' + "9" * 10_000 + "]}", id="number of 10,000 digits"),
        pytest.param(b'{"annotations": ["\xff"]}', id="not UTF-8"),
    ],
)
def test_json_that_cannot_be_parsed_is_corrupt(tmp_path, text):
    path = tmp_path / "masks.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ldls.CorruptFileError, match=r"masks\.json: not a (whole JSON|text) file"):
        ldls.read_masks(path)


def test_a_file_of_two_gigabytes_is_refused(tmp_path):
    path = tmp_path / "masks.json"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    with pytest.raises(
        ldls.LimitError, match=r"masks\.json: 2,147,483,648 bytes, expected at most 1,073,741,824 .*; split it"
    ):
        ldls.read_masks(path)


def test_polygons_of_an_image_of_another_size_are_refused(tmp_path):
    triangle = [[1, 1, 9, 1, 5, 8]]
    document = {
        "images": [{"id": 1, "height": 20, "width": 30}],
        "categories": [{"id": 3, "name": "car"}],
        "annotations": [{"id": 1, "image_id": 1, "category_id": 3, "segmentation": triangle}],
    }
    (tmp_path / "masks.json").write_text(json.dumps(document))
    assert len(ldls.read_masks(tmp_path / "masks.json", image_size=(20, 30))) == 1
    with pytest.raises(ldls.MaskError, match=r"masks of \(20, 30\).*the image is \(30, 20\); swapped"):
        ldls.read_masks(tmp_path / "masks.json", image_size=(30, 20))


@pytest.mark.parametrize("lost", [2, "1"], ids=["another number", "text for a number"])
@pytest.mark.parametrize("image_id", [None, 1], ids=["only image", "chosen image"])
def test_annotations_whose_image_id_no_image_has_are_refused(lost, image_id):
    annotation = document()["annotations"][0]
    lost_one = document(annotations=[annotation, annotation | {"id": 7, "image_id": lost}])
    with pytest.raises(ldls.MaskError, match=rf"annotation 7: image_id is {lost!r}, which no image has; found \[1\]"):
        ldls.InstanceMasks.from_coco(lost_one, image_id=image_id)


@pytest.mark.parametrize("given", [{}, {"image_id": None}], ids=["missing", "null"])
def test_annotations_without_image_id_belong_to_the_only_image(given):
    annotation = {"id": 1, "category_id": 1, "segmentation": RLE} | given
    assert len(ldls.InstanceMasks.from_coco(document(annotations=[annotation]))) == 1


@pytest.mark.parametrize(
    ("ids", "chosen", "found"),
    [
        pytest.param([4, 5], "5", 5, id="a number as text"),
        pytest.param(["a", "b"], "b", "b", id="text"),
        pytest.param(["4", "5"], "5", "5", id="text of digits"),
        pytest.param([5, "5"], "5", "5", id="both"),
        pytest.param([4, -5], "-5", -5, id="below 0"),
        pytest.param([4, 7], "007", 7, id="zeros before it"),
    ],
)
@pytest.mark.parametrize("bare", [False, True], ids=["data set", "results"])
def test_text_chooses_an_image_by_its_number(ids, chosen, found, bare):
    annotation = document()["annotations"][0]
    annotations = [annotation | {"image_id": each, "score": 1 if each == found else 0} for each in ids]
    images = [{"id": each, "height": 4, "width": 5} for each in ids]
    content = annotations if bare else document(annotations=annotations, images=images)
    assert ldls.InstanceMasks.from_coco(content, image_id=chosen).scores.tolist() == [1]
    with pytest.raises(ldls.MaskError, match="no image with id '6'"):
        ldls.InstanceMasks.from_coco(content, image_id="6")


def test_numbers_of_numpy_are_understood():
    numpy_s = {"image_id": np.int64(1), "category_id": np.int64(1), "score": np.float64(0.5)}
    triangle = {"segmentation": [list(np.array([0, 0, 4, 0, 0, 4], np.float32))]}
    content = document(
        images=[{"id": np.int32(1), "height": np.int64(4), "width": np.int64(5)}],
        categories=[{"id": np.int64(1), "name": "person"}],
        annotations=[document()["annotations"][0] | numpy_s | each for each in ({}, triangle)],
    )
    for each in (content, content["annotations"]):
        masks = ldls.InstanceMasks.from_coco(each)
        assert (masks.scores.tolist(), masks.categories.tolist()) == ([0.5, 0.5], [1, 1])
        assert {type(key) for key in masks.names} == {int}
    annotation = content["annotations"][0] | {"score": np.bool_(True)}
    with pytest.raises(ldls.MaskError, match=r"score is .*True.*, expected a number"):
        ldls.InstanceMasks.from_coco([annotation])

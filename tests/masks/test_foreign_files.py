"""Mask files of other programs, beside what their own documentation says of them."""

import base64
import functools
import io
import json
import re

import numpy as np
import pytest
from PIL import Image

import ldls
from ldls.errors import LdlsWarning, LeftOutWarning

SQUARE = np.zeros((60, 80), bool)
SQUARE[15:30, 20:40] = True
# its corners, as shares of width and height
YOLO = "0.25 0.25 0.5 0.25 0.5 0.5 0.25 0.5"


def pixels(masks):
    return [mask.to_array() for mask in masks]


def test_polygons_of_yolo(tmp_path):
    (tmp_path / "a.txt").write_text(f"2 {YOLO}\n0 {YOLO} 0.75\n")
    masks = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))
    np.testing.assert_array_equal(pixels(masks), [SQUARE, SQUARE])
    # COCO's 80 classes, by the ids of its list of 91
    assert masks.categories.tolist() == [3, 1] and masks.scores.tolist() == [1, 0.75]
    own = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80), names={0: "forklift", 2: "person"})
    assert own.categories.tolist() == [1, 100] and own.names[100] == "forklift"


@pytest.mark.parametrize(
    ("text", "scores"),
    [
        pytest.param(f"2 {YOLO} 0.75 2\n0 {YOLO} 1 1\n", [0.75, 1], id="scores and tracks"),
        pytest.param(f"2 {YOLO} 0.75 12\n", [0.75], id="score and track"),
        pytest.param(f"2 {YOLO} 2\n0 {YOLO} 1\n", [1, 1], id="tracks"),
        pytest.param(f"2 {YOLO} 1\n", [1], id="track 1"),
        pytest.param(f"2 {YOLO} 1\n0 {YOLO} 1\n", [1, 1], id="scores of 1"),
        pytest.param(f"2 {YOLO} 1\n0 {YOLO}\n", [1, 1], id="some with scores"),
    ],
)
def test_numbers_of_tracks_are_no_corners(tmp_path, text, scores):
    (tmp_path / "a.txt").write_text(text)
    masks = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))
    np.testing.assert_array_equal(pixels(masks), [SQUARE] * len(scores))
    assert masks.scores.tolist() == scores


def test_a_corner_that_may_be_a_track_is_warned_of(tmp_path):
    (tmp_path / "a.txt").write_text(f"2 {YOLO} 0.25 1\n")
    with pytest.warns(LdlsWarning, match=r"a\.txt, line 1: 0\.25 1 is taken for a corner; if") as caught:
        assert ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))[0].area > SQUARE.sum() / 2
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "text", [pytest.param("2 0 0 1 0 1 1 0 1", id="whole image"), pytest.param(f"2 {YOLO} 0 1\n" * 2, id="twice")]
)
def test_polygons_may_end_at_the_lower_edge(tmp_path, text):
    (tmp_path / "a.txt").write_text(text)
    assert all(mask.score == 1 and mask.area for mask in ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80)))


@pytest.mark.parametrize(
    ("tiny", "behind"),
    [
        pytest.param("", "", id="no corner"),
        pytest.param(" 0.31", " 0.75", id="score"),
        pytest.param(" 0.31 4", " 0.75 3", id="score and track"),
        pytest.param(" 0.5 0.5 0.31", " 0.75", id="a corner"),
        pytest.param(" 0.5 0.5 0.5 0.508", "", id="upright line"),
        pytest.param(" 0.5 0.5 0.506 0.508", "", id="diagonal line"),
    ],
)
def test_instances_of_yolo_too_small_for_an_outline_have_no_pixel(tmp_path, tiny, behind):
    (tmp_path / "a.txt").write_text(f"2{tiny}\n0 {YOLO}{behind}\n")
    masks = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))
    np.testing.assert_array_equal(pixels(masks), [np.zeros_like(SQUARE), SQUARE])
    np.testing.assert_array_equal(masks.scores, np.float32([0.31 if "0.31" in tiny else 1, 0.75 if behind else 1]))


@pytest.mark.parametrize("text", ["2 0.31", "2 0.5 0.6", "2 0.31 1\n2 0.5 2"], ids=["score", "corner", "tracked"])
def test_a_file_of_yolo_may_have_no_other(tmp_path, text):
    (tmp_path / "a.txt").write_text(text)
    assert not np.any(pixels(ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))))


def test_a_class_of_yolo_that_is_named_background_has_no_objects(tmp_path):
    (tmp_path / "a.txt").write_text(f"0 {YOLO}\n1 {YOLO} 0.75\n")
    masks = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80), names={0: "background", 1: "Car"})
    assert [(mask.name, mask.score) for mask in masks] == [("car", 0.75)]


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        pytest.param(f"2 {YOLO}", {"image_size": None}, "give its image_size=", id="no size"),
        pytest.param("2 0.5 0.5 0.1 0.2", {}, r"line 1: a box, expected a polygon", id="boxes"),
        pytest.param("2 0.5 0.5 0.1 0.2 0.9 3\n", {}, r"line 1: a box, expected a polygon", id="boxes of tracks"),
        pytest.param(f"0 {YOLO}\n2 0.5 0.5 0.1 0.2", {}, r"line 2: a box, expected", id="a box among polygons"),
        pytest.param(f"0 {YOLO}\n2 0.5 0.5 1 1", {}, r"line 2: a box, expected", id="the whole image among polygons"),
        pytest.param("2 1.31", {}, "line 1: expected a class and x y of three", id="no share"),
        pytest.param(f"2 {YOLO} 2 2", {}, "as shares of the image from 0 to 1", id="score above 1"),
        pytest.param(f"2 {YOLO} 2\n2 {YOLO} 2", {}, "as shares of the image from 0 to 1", id="a track twice"),
        pytest.param(f"80 {YOLO}", {}, "class 80 has no name; pass names=", id="unknown class"),
        pytest.param("2 10 10 20 10 20 20", {}, "as shares of the image from 0 to 1", id="pixels"),
        pytest.param("2 0.1 0.2 0.3 0.4 0.5 x", {}, "expected a class and numbers", id="word"),
        pytest.param("2 0.1 0.2 0.3 0.4 0.5 0_6", {}, "expected a class and numbers", id="underscore"),
        pytest.param(f"2.0 {YOLO}", {}, "line 1: class is '2.0', expected a whole", id="class of a float"),
        pytest.param(f"2 {YOLO}\n-1 {YOLO}", {}, "line 2: class is '-1', expected a whole", id="negative class"),
        pytest.param(f"2 {YOLO}\ncar {YOLO}", {}, "line 2: class is 'car', expected a whole", id="name among numbers"),
    ],
)
def test_faults_of_yolo_are_named(tmp_path, text, options, message):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises((ldls.MaskError, ldls.CorruptFileError), match=rf"a\.txt.*{message}"):
        ldls.read_masks(tmp_path / "a.txt", **{"image_size": (60, 80), **options})


def test_shapes_of_labelme(tmp_path):
    corners = [[20, 15], [40, 15], [40, 30], [20, 30]]
    shapes = [
        {"label": "Person", "points": corners, "shape_type": "polygon", "group_id": None},
        {"label": "cart", "points": [[20, 15], [30, 30]], "shape_type": "rectangle", "group_id": 7},
        {"label": "Cart", "points": [[40, 30], [30, 15]], "shape_type": "rectangle", "group_id": 7},
    ]
    content = {"shapes": shapes, "imageHeight": 60, "imageWidth": 80, "imageData": None}
    (tmp_path / "a.json").write_text(json.dumps(content))
    masks = ldls.read_masks(tmp_path / "a.json")
    np.testing.assert_array_equal(pixels(masks), [SQUARE, SQUARE])
    assert [masks.names[each] for each in masks.categories.tolist()] == ["person", "cart"], "capitals do not count"
    assert masks.categories[0] == 1
    named = ldls.read_masks(tmp_path / "a.json", names={7: "CART"})
    assert named.categories.tolist() == [1, 7] and named.names[7] == "CART"
    content["shapes"][0]["shape_type"] = "linestrip"
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(ldls.MaskError, match=r"a\.json: shape 0: linestrip of 4 points, expected a polygon"):
        ldls.read_masks(tmp_path / "a.json")


@pytest.mark.parametrize("kind", ["rectangle", "oriented_rectangle"])
def test_rectangles_of_labelme_may_have_four_corners(tmp_path, kind):
    shape = {"label": "car", "points": [[20, 15], [40, 15], [40, 30], [20, 30]], "shape_type": kind}
    content = {"shapes": [shape], "imageHeight": 60, "imageWidth": 80}
    (tmp_path / "a.json").write_text(json.dumps(content))
    np.testing.assert_array_equal(pixels(ldls.read_masks(tmp_path / "a.json")), [SQUARE])
    shape["points"].pop()
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(ldls.MaskError, match=f"shape 0: {kind} of 3 points, expected .* a rectangle of 2 or 4, or"):
        ldls.read_masks(tmp_path / "a.json")


def labelme_mask(values=None, **changes):
    """labelme's content of one shape of pixels: the square's upper left triangle, and a polygon of its group."""
    file = io.BytesIO()
    Image.fromarray(np.tril(np.ones((15, 20), np.uint8)) if values is None else values).save(file, "PNG")
    text = base64.b64encode(file.getvalue()).decode()
    shape = {"label": "car", "points": [[20.0, 15.0], [39.0, 29.0]], "shape_type": "mask", "mask": text, "group_id": 1}
    return {"shapes": [shape | changes], "imageHeight": 60, "imageWidth": 80}


def test_pixels_of_labelme(tmp_path):
    content = labelme_mask()
    (tmp_path / "a.json").write_text(json.dumps(content))
    expected = np.zeros_like(SQUARE)
    expected[15:30, 20:40] = np.tril(np.ones((15, 20)))
    np.testing.assert_array_equal(pixels(ldls.read_masks(tmp_path / "a.json")), [expected])
    beside = {"label": "car", "points": [[50, 5], [60, 15]], "shape_type": "rectangle", "group_id": 1}
    (tmp_path / "a.json").write_text(json.dumps(content | {"shapes": [*content["shapes"], beside]}))
    expected[5:15, 50:60] = True
    np.testing.assert_array_equal(pixels(ldls.read_masks(tmp_path / "a.json")), [expected])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        pytest.param({"mask": None}, "mask: got None, expected a PNG in base64", id="no pixels"),
        pytest.param({"mask": "a b"}, "mask: got 'a b', expected a PNG in base64", id="no base64"),
        pytest.param({"mask": "AAAA"}, "mask: not a whole image: begins with", id="no PNG"),
        pytest.param({"mask": ""}, "mask: ", id="no byte"),
        pytest.param({"points": [[20, 15]]}, r"mask of 15 x 20 pixels .* got \[\[20.0, 15.0\]\]", id="one point"),
        pytest.param({"points": [[70, 15], [89, 29]]}, "mask of 15 x 20 .* in an image of 60 x 80", id="outside"),
        pytest.param({"points": [[-1, 15], [18, 29]]}, "mask of 15 x 20 .* in an image of 60 x 80", id="before it"),
        pytest.param({"points": [[20, 15], [30, 29]]}, "mask of 15 x 20 pixels", id="box of another size"),
        pytest.param({"group_id": [1]}, r"group_id is \[1\], expected a number or text", id="group of a list"),
        pytest.param({"group_id": {}}, r"group_id is {}, expected a number or text", id="group of an object"),
    ],
)
def test_faults_of_labelme_are_named(tmp_path, changes, message):
    (tmp_path / "a.json").write_text(json.dumps(labelme_mask(**changes)))
    with pytest.raises((ldls.MaskError, ldls.CorruptFileError, ldls.UnsupportedFormatError)) as caught:
        ldls.read_masks(tmp_path / "a.json")
    assert re.search(rf"a\.json: shape 0: {message}", str(caught.value)), str(caught.value)


def test_what_labelme_calls_no_object_is_none(tmp_path):
    corners = [[20, 15], [40, 15], [40, 30], [20, 30]]
    line = {"label": "__ignore__", "points": corners[:2], "shape_type": "line"}
    shapes = [{"label": label, "points": corners} for label in ("__ignore__", "car", "_Background_", "background")]
    content = {"shapes": [*shapes, line], "imageHeight": 60, "imageWidth": 80}
    (tmp_path / "a.json").write_text(json.dumps(content))
    masks = ldls.read_masks(tmp_path / "a.json")
    assert [mask.name for mask in masks] == ["car"] and "__ignore__" not in masks.names.values()
    with pytest.raises(ldls.MaskError, match="shape 1: line of 2 points"):
        (tmp_path / "a.json").write_text(json.dumps(content | {"shapes": [shapes[0], line | {"label": "car"}]}))
        ldls.read_masks(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("labels", "names", "found"),
    [
        pytest.param(
            ["box", "forklift", "pallet"],
            {100: "forklift", 101: "pallet"},
            [(102, "box"), (100, "forklift"), (101, "pallet")],
            id="of others",
        ),
        pytest.param(["car", "truck"], {3: "truck"}, [(100, "car"), (3, "truck")], id="COCO's id of another"),
        pytest.param(["car", "cart"], {7: "Wagon"}, [(3, "car"), (101, "cart")], id="no label of the file"),
        pytest.param(["tin", "box"], {100: "car"}, [(102, "tin"), (101, "box")], id="the next free ones"),
    ],
)
def test_labels_keep_off_the_ids_of_names(tmp_path, labels, names, found):
    corners = [[20, 15], [40, 15], [40, 30], [20, 30]]
    content = {"shapes": [{"label": label, "points": corners} for label in labels]}
    (tmp_path / "a.json").write_text(json.dumps(content | {"imageHeight": 60, "imageWidth": 80}))
    masks = ldls.read_masks(tmp_path / "a.json", names=names)
    assert sorted((mask.category, mask.name) for mask in masks) == sorted(found)
    assert [mask.name for mask in masks] == labels and names.items() <= masks.names.items()


@pytest.mark.parametrize(
    ("size", "thing", "surface", "name"),
    [
        pytest.param({"imgHeight": 60, "imgWidth": 80}, "car", "road", "car", id="Cityscapes"),
        pytest.param({"imgHeight": 60, "imgWidth": 80}, "caravan", "cargroup", "caravan", id="Cityscapes' own class"),
        pytest.param(
            {"height": 60, "width": 80}, "object--vehicle--car", "construction--flat--road", "car", id="Mapillary"
        ),
        pytest.param({"height": 60, "width": 80}, "human--person--individual", "nature--sky", "person", id="v2"),
        pytest.param({"height": 60, "width": 80}, "object--street-light", "void--static", "street light", id="other"),
    ],
)
def test_polygons_of_cityscapes_and_mapillary(tmp_path, size, thing, surface, name):
    whole = [[0, 0], [80, 0], [80, 60], [0, 60]]
    corners = [[20, 15], [40, 15], [40, 30], [20, 30]]
    objects = [{"label": surface, "polygon": whole}, {"label": thing, "polygon": corners}]
    (tmp_path / "a.json").write_text(json.dumps(size | {"objects": objects}))
    masks = ldls.read_masks(tmp_path / "a.json")
    np.testing.assert_array_equal(pixels(masks), [SQUARE])
    assert [mask.name for mask in masks] == [name]
    (tmp_path / "a.json").write_text(json.dumps(size | {"objects": [{"label": thing, "polygon": corners[:2]}]}))
    with pytest.raises(ldls.MaskError, match=r"a\.json: object 0: polygon of 2 points"):
        ldls.read_masks(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("polygon", "found"),
    [
        pytest.param(5, "expected shape (n, 2), got ()", id="a number"),
        pytest.param("abc", "expected numbers, got 'abc'", id="text"),
        pytest.param([[1, 2], [3]], "expected an array of numbers, got [[1, 2], [3]]", id="half a point"),
        pytest.param([[1, 2], [3, None]], "expected numbers, got [[1, 2], [3, None]]", id="half a point of two"),
    ],
)
@pytest.mark.parametrize("label", ["car", "road"])
def test_what_is_no_polygon_is_named_with_its_object(tmp_path, label, polygon, found):
    content = {"imgHeight": 60, "imgWidth": 80, "objects": [{"label": label, "polygon": polygon}]}
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(ldls.MaskError, match=re.escape(f"a.json: object 0: polygon: {found}")):
        ldls.read_masks(tmp_path / "a.json")


def test_later_objects_of_cityscapes_cover_earlier_ones(tmp_path):
    corners = [[20, 15], [40, 15], [40, 30], [20, 30]]
    pole = [[25, 0], [30, 0], [30, 60], [25, 60]]
    objects = [
        {"label": "pole", "polygon": corners},
        {"label": "car", "polygon": corners},
        {"label": "person", "polygon": [[35, 10], [50, 10], [50, 40], [35, 40]]},
        {"label": "pole", "polygon": pole},
        {"label": "pole", "polygon": corners[:2]},
        {"label": "license plate", "polygon": corners},
        {"label": "road", "polygon": corners, "deleted": 1},
    ]
    person = np.zeros_like(SQUARE)
    person[10:40, 35:50] = True
    car = SQUARE & ~person
    car[:, 25:30] = False
    (tmp_path / "a.json").write_text(json.dumps({"imgHeight": 60, "imgWidth": 80, "objects": objects}))
    masks = ldls.read_masks(tmp_path / "a.json")
    assert [mask.name for mask in masks] == ["car", "person"]
    np.testing.assert_array_equal(pixels(masks), [car, person])
    (tmp_path / "a.json").write_text(json.dumps({"height": 60, "width": 80, "objects": objects}))
    assert ldls.read_masks(tmp_path / "a.json")[0].area == SQUARE.sum(), "Mapillary's are whole"


@pytest.mark.parametrize("wrapped", [False, True], ids=["list", "SA-1B"])
def test_records_of_segment_anything(tmp_path, wrapped):
    rle = ldls.InstanceMasks.from_array(SQUARE[None]).to_coco()["annotations"][0]["segmentation"]
    records = [{"segmentation": rle, "predicted_iou": 0.5, "stability_score": 0.9, "area": 300}]
    (tmp_path / "a.json").write_text(
        json.dumps({"image": {"image_id": 1}, "annotations": records} if wrapped else records)
    )
    masks = ldls.read_masks(tmp_path / "a.json")
    np.testing.assert_array_equal(pixels(masks), [SQUARE])
    assert (masks.categories.tolist(), masks.scores.tolist(), masks.names[1]) == ([1], [0.5], "object")


def test_the_image_of_segment_anything_says_its_size(tmp_path):
    content = {"image": {"image_id": 1, "width": 80, "height": 60, "file_name": "a.jpg"}, "annotations": []}
    (tmp_path / "a.json").write_text(json.dumps(content))
    masks = ldls.read_masks(tmp_path / "a.json")
    assert (len(masks), masks.image_size) == (0, (60, 80))
    with pytest.raises(ldls.MaskError, match=r"a\.json: masks of \(60, 80\).* image is \(80, 60\); swapped"):
        ldls.read_masks(tmp_path / "a.json", image_size=(80, 60))
    rle = ldls.InstanceMasks.from_array(SQUARE.T[None]).to_coco()["annotations"][0]["segmentation"]
    content["annotations"] = [{"segmentation": rle, "predicted_iou": 0.5}]
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(ldls.MaskError, match=r"a\.json: .*80.*60"):
        ldls.read_masks(tmp_path / "a.json")
    del content["image"]["width"], content["annotations"][0]
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(ldls.MaskError, match=r"a\.json: records: none, so the image's size is not known"):
        ldls.read_masks(tmp_path / "a.json")


def test_a_folder_of_one_png_an_instance(tmp_path):
    for number in (10, 2):
        Image.fromarray(np.where(SQUARE, 255, 0).astype(np.uint8)[:, :: -1 if number == 2 else 1]).save(
            tmp_path / f"{number}.png"
        )
    masks = ldls.read_masks(tmp_path)
    np.testing.assert_array_equal(pixels(masks), [SQUARE[:, ::-1], SQUARE])
    (tmp_path / "metadata.csv").write_text("id,area,predicted_iou\n2,300,1.01\n10,300,0.875\n")
    assert ldls.read_masks(tmp_path).scores.tolist() == [1.0, 0.875]
    (tmp_path / "metadata.csv").write_text("id,area,predicted_iou\n2,300,1.01\n")
    with pytest.raises(ldls.MaskError, match=r"metadata\.csv: has no row of 10\.png"):
        ldls.read_masks(tmp_path)
    with pytest.raises(ldls.MaskError, match="a folder without .png"):
        (tmp_path / "empty").mkdir()
        ldls.read_masks(tmp_path / "empty")


def panoptic(path):
    """The content of a JSON file of one image, whose PNG is written to `path`: a car, road and background."""
    colours = np.zeros((60, 80, 3), np.uint8)
    colours[SQUARE], colours[~SQUARE] = [44, 1, 2], [9, 0, 0]
    colours[0, 0] = [10, 0, 0]
    Image.fromarray(colours).save(path)
    segments = [
        {"id": 44 + 256 + 2 * 65536, "category_id": 3},
        {"id": 9, "category_id": 7},
        {"id": 10, "category_id": 8},
    ]
    return {
        "images": [{"id": 5, "height": 60, "width": 80, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 5, "file_name": "a.png", "segments_info": segments}],
        "categories": [
            {"id": 3, "name": "car", "isthing": 1},
            {"id": 7, "name": "road", "isthing": 0},
            {"id": 8, "name": "background", "isthing": 1},
        ],
    }


@pytest.mark.parametrize("folder", ["", "panoptic"])
def test_coco_panoptic(tmp_path, folder):
    (tmp_path / folder).mkdir(exist_ok=True)
    content = panoptic(tmp_path / folder / "a.png")
    (tmp_path / "panoptic.json").write_text(json.dumps(content))
    masks = ldls.read_masks(tmp_path / "panoptic.json")
    np.testing.assert_array_equal(pixels(masks), [SQUARE])
    assert masks.categories.tolist() == [3]


SEGMENT = ("annotations", 0, "segments_info", 0)
NO_SEGMENT = {"image_id": 5, "file_name": "a.png", "segments_info": []}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param({SEGMENT: {"id": 1, "category_id": 3}}, "segment 1 has no pixel in a.png", id="no such segment"),
        pytest.param({(*SEGMENT, "id"): 9}, r"segments_info\[1\] has id 9, which another of", id="segment twice"),
        pytest.param({(*SEGMENT, "id"): None}, r"segments_info\[0\] has id None", id="segment without id"),
        pytest.param({(*SEGMENT, "category_id"): 4}, "category_id 4 is not among the cat", id="no such category"),
        pytest.param({(*SEGMENT, "category_id"): [3]}, r"category_id \[3\] is not among", id="category of a list"),
        pytest.param({SEGMENT[:3]: None}, "expected segments_info to be a list", id="no segments"),
        pytest.param({("categories", 0, "id"): 7}, r"categories\[1\] has id 7, which another", id="category twice"),
        pytest.param({("categories", 0, "id"): None}, r"categories\[0\] has id None", id="category without id"),
        pytest.param({("categories",): None}, "expected categories to be a list", id="no list of categories"),
        pytest.param({("categories",): ...}, "category_id 3 is not among the categories", id="no categories"),
        pytest.param({("images", 0, "id"): ...}, r"images\[0\] has id None", id="image without id"),
        pytest.param({("images",): ..., ("annotations", 0, "file_name"): ...}, "image 5 has file_name None", id="PNG"),
        pytest.param({("annotations", 0, "image_id"): 6}, "image_id is 6, which no image has", id="other image"),
        pytest.param({("annotations",): [NO_SEGMENT] * 2}, "one annotation of image 5, .* got 2", id="two of an image"),
    ],
)
def test_faults_of_coco_panoptic_are_named(tmp_path, change, message):
    content = panoptic(tmp_path / "a.png")
    for (*within, last), value in change.items():
        place = functools.reduce(lambda inner, key: inner[key], within, content)
        if value is ...:
            del place[last]
        else:
            place[last] = value
    (tmp_path / "panoptic.json").write_text(json.dumps(content))
    with pytest.raises(ldls.LdlsError, match=rf"panoptic\.json: .*{message}"):
        ldls.read_masks(tmp_path / "panoptic.json")


def test_coco_panoptic_does_without_what_nobody_needs(tmp_path):
    content = panoptic(tmp_path / "a.png")
    del content["annotations"][0]["image_id"], content["categories"][0]["name"]
    (tmp_path / "panoptic.json").write_text(json.dumps(content))
    assert [mask.name for mask in ldls.read_masks(tmp_path / "panoptic.json")] == ["3"]


@pytest.mark.parametrize(
    ("size", "message"),
    [
        pytest.param((60, 81), r"\(60, 81\) \(height, width\), its .*a\.png is \(60, 80\), .*own PNG$", id="another"),
        pytest.param((80, 60), r"\(80, 60\) .*; swapped\?", id="swapped"),
    ],
)
def test_coco_panoptic_of_another_size_than_its_png_is_warned_of(tmp_path, size, message):
    content = panoptic(tmp_path / "a.png")
    content["images"][0].update(zip(("height", "width"), size, strict=True))
    (tmp_path / "panoptic.json").write_text(json.dumps(content))
    with pytest.warns(LdlsWarning, match=rf"panoptic\.json: image 5 is {message}") as caught:
        assert ldls.read_masks(tmp_path / "panoptic.json").image_size == (60, 80)
    assert caught[0].filename == __file__


def test_stuff_and_groups_of_cityscapes_are_background(tmp_path):
    values = np.where(SQUARE, 26001, 26).astype(np.uint16)
    values[0], values[1] = 25002, 7
    Image.fromarray(values).save(tmp_path / "city_000001_gtFine_instanceIds.png")
    masks = ldls.read_masks(tmp_path / "city_000001_gtFine_instanceIds.png")
    assert [masks.names[each] for each in masks.categories.tolist()] == ["rider", "car"]
    np.testing.assert_array_equal(masks[1].to_array(), SQUARE)


def test_cityscapes_numbers_instances_from_0(tmp_path):
    values = np.where(SQUARE, 26000, 7).astype(np.uint16)
    values[0], values[1] = 26001, 24000
    Image.fromarray(values).save(tmp_path / "city_000001_gtFine_instanceIds.png")
    masks = ldls.read_masks(tmp_path / "city_000001_gtFine_instanceIds.png", scores=[0.5, 0.75, 1])
    assert [(mask.name, mask.score, mask.area) for mask in masks] == [
        ("person", 0.5, 80),
        ("car", 0.75, 300),
        ("car", 1, 80),
    ]


@pytest.mark.parametrize("empty", [[], [[]], [[], []]], ids=["no polygon", "empty polygon", "empty polygons"])
def test_an_empty_segmentation_is_left_out(tmp_path, empty):
    content = ldls.InstanceMasks.from_array(SQUARE[None], categories=[1]).to_coco()
    content["annotations"].append(content["annotations"][0] | {"id": 9, "segmentation": empty})
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.warns(LeftOutWarning, match="1 of 2 annotations have an empty segmentation"):
        assert len(ldls.read_masks(tmp_path / "a.json")) == 1


@pytest.mark.filterwarnings("ignore::ldls.errors.LdlsWarning")
@pytest.mark.parametrize(
    ("name", "options", "names"),
    [
        pytest.param("labelme.json", {}, None, id="labelme"),
        pytest.param("sa1b.json", {}, ["object"], id="SA-1B"),
        pytest.param("sam_amg.json", {}, ["object"], id="Segment Anything"),
        pytest.param("yolo_seg.txt", {"image_size": (60, 80)}, ["person", "car"], id="YOLO"),
        pytest.param("defaultcity_000001_000031_gtFine_instanceIds.png", {}, ["bus?"], id="Cityscapes"),
        pytest.param("panoptic.json", {}, [], id="panoptic, stuff alone"),
    ],
)
def test_files_of_others_are_read(data_folder, name, options, names):
    masks = ldls.read_masks(data_folder / "real/masks" / name, **options)
    found = [masks.names[each] for each in masks.categories.tolist()]
    if name == "labelme.json":
        shapes = json.loads((data_folder / "real/masks" / name).read_text())["shapes"]
        assert found == [shape["label"] for shape in shapes if shape["label"] != "__ignore__"] and len(masks) == 4
    elif name.startswith("defaultcity"):
        assert found == ["truck", "truck"]
    else:
        assert found == names


@pytest.mark.parametrize(
    ("name", "text"),
    [
        pytest.param("classes.txt", "forklift\npallet\nperson\n", id="labelling tools"),
        pytest.param("data.yaml", "path: x\nnames: [forklift, pallet, person]\n", id="list"),
        pytest.param("data.yaml", "names:\n  0: forklift\n  2: person\n", id="numbers"),
    ],
)
@pytest.mark.parametrize("above", [0, 2])
def test_names_of_yolo_lie_beside_its_labels(tmp_path, name, text, above):
    if name == "data.yaml":
        pytest.importorskip("yaml", reason="the extra yaml is not installed")
    labels = tmp_path / "labels/train"
    labels.mkdir(parents=True)
    (labels / "a.txt").write_text(f"0 {YOLO}\n2 {YOLO}\n")
    (labels.parents[above - 1] / name if above else labels / name).write_text(text)
    masks = ldls.read_masks(labels / "a.txt", image_size=(60, 80))
    assert [masks.names[each] for each in masks.categories.tolist()] == ["forklift", "person"]


def test_xml_of_cvat_is_refused_with_what_it_exports_besides(tmp_path):
    (tmp_path / "annotations.xml").write_text("<annotations/>")
    with pytest.raises(ldls.UnsupportedFormatError, match=r"annotations\.xml: cannot read.*of CVAT, export COCO 1\.0"):
        ldls.read_masks(tmp_path / "annotations.xml")

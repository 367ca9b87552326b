import json

import numpy as np
import pytest
from pycocotools import mask as cocomask
from scipy import ndimage

import ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools
GENERATOR = np.random.default_rng(3)
HEIGHT, WIDTH = 11, 7


def coco_document(segmentation, **annotation):
    return {
        "images": [{"id": 5, "height": HEIGHT, "width": WIDTH}],
        "categories": [{"id": 3, "name": "car"}],
        "annotations": [{"id": 17, "image_id": 5, "category_id": 3, "segmentation": segmentation} | annotation],
    }


def random_pixels(count=4, height=HEIGHT, width=WIDTH):
    return GENERATOR.random((count, height, width)) > GENERATOR.random((count, 1, 1))


@pytest.mark.parametrize(
    "convert",
    [
        pytest.param(lambda pixels: pixels, id="bool"),
        pytest.param(lambda pixels: pixels.astype(np.uint8), id="0 and 1"),
        pytest.param(lambda pixels: pixels.astype(np.uint8) * 255, id="0 and 255"),
        pytest.param(lambda pixels: np.where(pixels, 0.9, 0.2), id="probabilities"),
        pytest.param(np.asfortranarray, id="Fortran order"),
        pytest.param(list, id="list of arrays"),
        pytest.param(lambda pixels: (m for m in list(pixels)), id="generator"),
    ],
)
def test_arrays_keep_every_pixel(convert):
    pixels = random_pixels()
    masks = ldls.InstanceMasks.from_array(convert(pixels))
    np.testing.assert_array_equal(masks.to_array(), pixels)
    assert [mask.area for mask in masks] == pixels.sum(axis=(1, 2)).tolist()
    assert masks[0].name == "object"


def test_an_instance_is_the_mask_before_its_label():
    masks = ldls.InstanceMasks.from_array(random_pixels(), categories=[1, 3, 18, 64], scores=[1, 0.5, 0, 0.25])
    assert (masks[2].category, masks[2].name, masks[3].score) == (18, "dog", 0.25)
    assert masks[-1].name == "potted plant"
    with pytest.raises(IndexError):
        masks[4]
    top, left, height, width = masks[1].bounding_box
    np.testing.assert_array_equal(masks[1].crop(), masks[1].to_array()[top : top + height, left : left + width])


def test_no_masks_are_masks_too():
    assert len(ldls.InstanceMasks.from_array(np.zeros((0, 4, 5), bool))) == 0
    assert ldls.InstanceMasks.from_array([], image_size=(4, 5)).image_size == (4, 5)
    with pytest.raises(ldls.MaskError, match="image_size"):
        ldls.InstanceMasks.from_array([])


def test_many_large_masks_stay_small():
    def blobs():
        for i in range(100):
            pixels = np.zeros((2160, 3840), bool)
            pixels[i * 10 : i * 10 + 400, i * 20 : i * 20 + 300] = True
            yield pixels

    masks = ldls.InstanceMasks.from_array(blobs())
    runs = sum(mask.rle.runs().nbytes for mask in masks)
    assert runs < 1_000_000, "dense masks would take 800 MB"


@pytest.mark.parametrize(
    ("pixels", "options", "message"),
    [
        pytest.param(np.full((1, 4, 5), np.nan), {}, r"mask 0: pixel \(0, 0\) is nan", id="NaN"),
        pytest.param(np.full((1, 4, 5), -1), {}, r"mask 0: pixel \(0, 0\) is -1", id="-1"),
        pytest.param(np.arange(20).reshape(1, 4, 5), {}, "is 2, .*from_instance_image", id="numbers"),
        pytest.param(np.full((1, 4, 5), "x"), {}, "dtype", id="text"),
        pytest.param(np.zeros((4, 5), bool), {}, "mask 0: expected", id="one flat mask"),
        pytest.param(
            [np.zeros((4, 5), bool), np.zeros((5, 4), bool)],
            {},
            "mask 1: 5 x 4 pixels, the image is 4 x 5; swapped",
            id="sizes differ",
        ),
        pytest.param(np.zeros((2, 4, 5)), {"categories": [1]}, "categories: exp", id="too few"),
        pytest.param(np.zeros((1, 4, 5)), {"categories": [12]}, "mask 0: category 12", id="unknown"),
        pytest.param(
            np.zeros((2, 4, 5)),
            {"categories": [1, 2], "names": {1: "car", 2: "Background"}},
            "mask 1: category 2 is named 'Background', .*leave the mask out, or name its category otherwise",
            id="background",
        ),
        pytest.param(np.zeros((1, 4, 5)), {"categories": [1.5]}, "whole numbers", id="fraction"),
        pytest.param(np.zeros((2, 4, 5)), {"scores": [1, 2]}, "mask 1: score is 2", id="score > 1"),
        pytest.param(
            np.zeros((2, 4, 5)),
            {"scores": [None, 0.5]},
            r"got \[None, 0.5\]; give numbers alone, of 64 bits at most",
            id="no score",
        ),
        pytest.param(
            np.zeros((1, 4, 5)), {"scores": np.array(["0.5"])}, r"pass scores.astype\(float32\)", id="text scores"
        ),
        pytest.param(np.zeros((1, 4, 5)), {"scores": [np.nan]}, "mask 0: score is nan", id="nan score"),
        pytest.param(np.zeros((1, 0, 5)), {}, "image of 0 x 5", id="no rows"),
    ],
)
def test_faults_of_arrays_are_named(pixels, options, message):
    with pytest.raises((ldls.MaskError, ldls.LimitError), match=message):
        ldls.InstanceMasks.from_array(pixels, **options)


@pytest.mark.parametrize("seed", range(50))
def test_rle_equals_the_coco_tools(seed):
    generator = np.random.default_rng(seed)
    height, width = generator.integers(1, 60, 2)
    pixels = generator.random((height, width)) > generator.random()
    compressed = cocomask.encode(np.asfortranarray(pixels.astype(np.uint8)))
    runs = ldls.InstanceMasks.from_array([pixels])[0].rle.runs()
    for counts in (compressed["counts"], compressed["counts"].decode(), runs.tolist()):
        rle = {"size": [int(height), int(width)], "counts": counts}
        masks = ldls.InstanceMasks.from_coco([{"category_id": 1, "segmentation": rle}])
        np.testing.assert_array_equal(masks.to_array()[0], pixels)


@pytest.mark.parametrize("seed", range(100))
def test_polygons_cover_the_pixels_that_the_coco_tools_give_them(seed):
    generator = np.random.default_rng(seed)
    height, width = (int(side) for side in generator.integers(2, 90, 2))
    polygons = [
        (generator.uniform(-0.2, 1.2, (generator.integers(3, 12), 2)) * [width, height]).ravel().tolist()
        for _ in range(generator.integers(1, 4))
    ]
    expected = cocomask.decode(cocomask.merge(cocomask.frPyObjects(polygons, height, width)))
    masks = ldls.InstanceMasks.from_coco([{"category_id": 1, "segmentation": polygons}], image_size=(height, width))
    np.testing.assert_array_equal(masks.to_array()[0], expected.astype(bool))


def test_both_files_of_a_real_frame_are_read(frame_571):
    path = frame_571.masks_path
    document = json.loads(path.read_text())
    masks = ldls.read_masks(path)
    for mask, annotation in zip(masks, document["annotations"], strict=True):
        np.testing.assert_array_equal(mask.to_array(), cocomask.decode(annotation["segmentation"]))
        assert mask.category == annotation["category_id"]
        assert mask.score == pytest.approx(annotation["score"])
    polygons = ldls.read_masks(path.with_name("000571_polygons.json"))
    both = (polygons.to_array() & masks.to_array()).sum(axis=(1, 2))
    either = (polygons.to_array() | masks.to_array()).sum(axis=(1, 2))
    assert (both / either > 0.8).all()


RLE = {"size": [HEIGHT, WIDTH], "counts": [HEIGHT * WIDTH]}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        pytest.param(
            coco_document(RLE | {"counts": [3, 5]}),
            "annotation 17: RLE: runs sum to 8, size 11 x 7 needs 77",
            id="runs too short",
        ),
        pytest.param(coco_document(RLE | {"counts": [70, 9]}), "runs sum to 79", id="runs too long"),
        pytest.param(coco_document(RLE | {"counts": b""}), "runs sum to 0", id="no counts"),
        pytest.param(coco_document(RLE | {"counts": "PP"}), "byte 2 of counts", id="cut string"),
        pytest.param(coco_document(RLE | {"counts": "o" * 7 + "0"}), "more than 7 digits", id="number over 7 digits"),
        pytest.param(coco_document(RLE | {"counts": "000@"}), "negative or over 32 bits", id="negative difference"),
        pytest.param(coco_document(RLE | {"counts": "\u20ac"}), "outside 48 to 111", id="odd bytes"),
        pytest.param(coco_document(RLE | {"counts": [-1, 78]}), "run 0 is -1", id="negative run"),
        pytest.param(coco_document(RLE | {"counts": [1.5]}), "whole numbers", id="fractions"),
        pytest.param(coco_document(RLE | {"counts": None}), "counts must be", id="no counts at all"),
        pytest.param(
            coco_document(RLE | {"size": [WIDTH, HEIGHT]}),
            r"RLE of size \(7, 11\), image is \(11, 7\); swapped",
            id="height and width swapped",
        ),
        pytest.param(coco_document(RLE | {"size": [2**31, 2**31]}), "size is", id="huge size"),
        pytest.param(coco_document(RLE | {"size": [11.0, 7.0]}), "size is", id="size in floats"),
        pytest.param(coco_document(RLE, category_id=99), "category_id is 99", id="unknown category"),
        pytest.param(coco_document(RLE, score=1.5), "score is 1.5", id="score above 1"),
        pytest.param(coco_document(RLE, score=float("nan")), "score is nan", id="score NaN"),
        pytest.param(coco_document([[0, 0, 1]]), "3 numbers", id="half a polygon"),
        pytest.param(coco_document([[0, 0, 1, 1, 1e12, 0]]), "1000000000000", id="far polygon"),
        pytest.param(coco_document(None), "a box alone is no mask", id="no segmentation"),
    ],
)
def test_faults_of_annotations_are_named(document, message):
    with pytest.raises(ldls.MaskError, match=message) as caught:
        ldls.InstanceMasks.from_coco(document)
    assert "annotation 17" in str(caught.value)


def test_scores_that_only_some_results_have_are_refused():
    results = [
        {"category_id": 1, "segmentation": RLE, "score": 0.5},
        {"category_id": 1, "segmentation": RLE},
    ]
    with pytest.raises(ldls.MaskError, match="annotation 1: score is None"):
        ldls.InstanceMasks.from_coco(results)


def test_a_file_with_several_images_needs_a_choice():
    document = coco_document(RLE)
    document["images"].append({"id": 6, "height": 4, "width": 4})
    with pytest.raises(ldls.MaskError, match="holds 2 images; pass image_id="):
        ldls.InstanceMasks.from_coco(document)
    assert len(ldls.InstanceMasks.from_coco(document, image_id=5)) == 1
    assert ldls.InstanceMasks.from_coco(document, image_id=6).image_size == (4, 4)
    with pytest.raises(ldls.MaskError, match="no image with id 7"):
        ldls.InstanceMasks.from_coco(document, image_id=7)


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"annotations": [NaN]}', "3", '{"annotations": 1}'])
def test_files_that_are_not_coco_json_are_refused(tmp_path, text):
    path = tmp_path / "masks.json"
    path.write_text(text)
    with pytest.raises(ldls.CorruptFileError, match=r"masks\.json"):
        ldls.read_masks(path)


def test_own_npz_keeps_everything(tmp_path):
    pixels = random_pixels()
    masks = ldls.InstanceMasks.from_array(
        pixels, categories=[7, 8, 7, 8], scores=[1, 0.5, 0, 0.25], names={7: "crane", 8: "barrow"}
    )
    ldls.save(masks, tmp_path / "masks.npz")
    again = ldls.read_masks(tmp_path / "masks.npz")
    np.testing.assert_array_equal(again.to_array(), pixels)
    np.testing.assert_array_equal(again.scores, masks.scores)
    assert again.names == {7: "crane", 8: "barrow"}
    empty = ldls.InstanceMasks.from_array([], image_size=(4, 5))
    ldls.save(empty, tmp_path / "empty.npz")
    assert ldls.read_masks(tmp_path / "empty.npz").image_size == (4, 5)


def research_arrays(pixels, class_ids):
    return {
        "shape": np.array(pixels.shape[1:]),
        "rois": np.zeros((len(pixels), 4)),
        "masks": np.moveaxis(pixels, 0, 2),
        "class_ids": np.array(class_ids),
        "scores": np.full(len(pixels), 0.5),
    }


def test_masks_of_the_research_code_get_coco_ids(tmp_path):
    pixels = random_pixels()
    np.savez(tmp_path / "old.npz", **research_arrays(pixels, [1, 3, 17, 80]))
    masks = ldls.read_masks(tmp_path / "old.npz")
    np.testing.assert_array_equal(masks.to_array(), pixels)
    assert [mask.name for mask in masks] == ["person", "car", "dog", "toothbrush"]
    assert len(CONTIGUOUS_IDS) == len(COCO_NAMES) == 80


@pytest.mark.parametrize(
    ("arrays", "error", "message"),
    [
        pytest.param({"a": np.zeros(3)}, ldls.UnsupportedFormatError, "found arrays", id="other"),
        pytest.param(research_arrays(np.array([[[{}]]]), [1]), ldls.UnsafeFileError, "object arrays", id="objects"),
        pytest.param(research_arrays(random_pixels(1), [81]), ldls.MaskError, "class_ids: 81", id="class 81"),
        pytest.param(research_arrays(random_pixels(2), [1]), ldls.MaskError, "one mask a class", id="unequal"),
    ],
)
def test_faults_of_npz_files_are_named(tmp_path, arrays, error, message):
    np.savez(tmp_path / "masks.npz", **arrays)
    with pytest.raises(error, match=message):
        ldls.read_masks(tmp_path / "masks.npz")


def test_a_cut_npz_is_corrupt(tmp_path):
    path = tmp_path / "masks.npz"
    ldls.save(ldls.InstanceMasks.from_array(random_pixels()), path)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(ldls.CorruptFileError, match="not a whole"):
        ldls.read_masks(path)


def disk(radius):
    v, u = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return u * u + v * v <= radius * radius


def three_masks():
    pixels = np.zeros((3, 20, 30), bool)
    pixels[0, 2:12, 3:15] = True
    pixels[1, 8:18, 10:28] = True
    pixels[2, 9:11, 11:13] = True
    return ldls.InstanceMasks.from_array(pixels, categories=[3, 1, 18], scores=[0.9, 0.5, 0.7])


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        pytest.param({}, [0, 1, 2], id="all"),
        pytest.param({"min_score": 0.7}, [0, 2], id="score as given in single precision"),
        pytest.param({"categories": ["car", 1]}, [0, 1], id="names and ids"),
        pytest.param({"min_area": 5}, [0, 1], id="area"),
        pytest.param({"categories": ["bus"]}, [], id="none left"),
    ],
)
def test_a_filter_keeps_what_is_wanted(options, kept):
    masks = three_masks()
    found = masks.filter(**options)
    np.testing.assert_array_equal(found.to_array(), masks.to_array()[kept])
    assert found.categories.tolist() == masks.categories[kept].tolist()
    assert found.scores.tolist() == masks.scores[kept].tolist()


@pytest.mark.parametrize(
    ("wanted", "nearest"),
    [
        pytest.param("persn", "person", id="misspelt"),
        pytest.param("PERSN", "person", id="in capitals"),
        pytest.param("Pedestrian", "person", id="the name of another data set"),
    ],
)
def test_an_unknown_category_is_answered_with_the_nearest(wanted, nearest):
    with pytest.raises(ldls.ParameterError, match=f"'{wanted}' is unknown; did you mean '{nearest}'"):
        three_masks().filter(categories=[wanted])


def test_capitals_of_categories_do_not_count():
    masks = ldls.InstanceMasks.from_array(
        np.ones((3, 6, 8), bool), categories=[1, 2, 3], names={1: "Car", 2: "van", 3: "car"}
    )
    assert masks.filter(categories=["CAR"]).categories.tolist() == [1, 3]
    assert masks.filter(categories=["Van ", 3]).categories.tolist() == [2, 3]


@pytest.mark.parametrize(
    ("by", "order"),
    [
        pytest.param("score", [0, 2, 1], id="highest score"),
        pytest.param("area", [2, 0, 1], id="smallest"),
        pytest.param("order", [0, 1, 2], id="first"),
    ],
)
def test_overlaps_go_to_one_mask(by, order):
    pixels = three_masks().to_array()
    expected, taken = np.zeros_like(pixels), np.zeros(pixels.shape[1:], bool)
    for i in order:
        expected[i] = pixels[i] & ~taken
        taken |= pixels[i]
    found = three_masks().resolve_overlaps(by)
    np.testing.assert_array_equal(found.to_array(), expected)
    assert found.scores.tolist() == three_masks().scores.tolist()


@pytest.mark.parametrize("radius", [0, 1, 2, 5, 40])
def test_masks_grow_and_shrink_by_a_disk(radius):
    masks = ldls.InstanceMasks.from_array(random_pixels(3, 23, 31))
    pixels = masks.to_array()
    grown = [ndimage.binary_dilation(p, disk(radius)) if radius else p for p in pixels]
    shrunk = [ndimage.binary_erosion(p, disk(radius), border_value=1) if radius else p for p in pixels]
    np.testing.assert_array_equal(masks.grow(radius).to_array(), grown)
    np.testing.assert_array_equal(masks.shrink(radius).to_array(), shrunk)


@pytest.mark.parametrize("radius", [-1, 1.5, 10**9])
def test_a_radius_that_is_none_is_refused(radius):
    with pytest.raises(ldls.ParameterError, match="radius"):
        three_masks().grow(radius)


def test_an_array_with_the_masks_last_is_refused_until_it_says_so():
    pixels = np.zeros((120, 160, 2), bool)
    pixels[5:9, 5:9, 1] = True
    with pytest.raises(
        ldls.MaskError, match=r"looks like 2 masks of 120 x 160; pass instance_axis=-1, or instance_axis=0 if it is 120"
    ):
        ldls.InstanceMasks.from_array(pixels)
    assert ldls.InstanceMasks.from_array(pixels, instance_axis=-1).image_size == (120, 160)
    assert ldls.InstanceMasks.from_array(pixels, instance_axis=0).image_size == (160, 2)
    assert len(ldls.InstanceMasks.from_array(np.zeros((200, 60, 80), bool))) == 200


def test_background_may_have_a_name_where_no_mask_is_of_it():
    names = {1: "background", 2: "car"}
    masks = ldls.InstanceMasks.from_array(np.zeros((1, 60, 80)), categories=[2], names=names)
    assert masks.names == names and masks[0].name == "car"


def test_categories_may_be_names():
    pixels = np.zeros((2, 60, 80), bool)
    assert ldls.InstanceMasks.from_array(pixels, categories=["Car", "person"]).categories.tolist() == [3, 1]
    with pytest.raises(ldls.ParameterError, match="categories: 'caar' is unknown; did you mean 'car'"):
        ldls.InstanceMasks.from_array(pixels, categories=["caar", "person"])


@pytest.mark.parametrize(
    ("categories", "expected"),
    [
        pytest.param(np.array(["Car", "person"]), [3, 1], id="array"),
        pytest.param(np.array(["car", 1], object), [3, 1], id="objects"),
        pytest.param(("car", "person"), [3, 1], id="tuple"),
        pytest.param("car", [3, 3], id="one for all"),
        pytest.param(np.str_("car"), [3, 3], id="one of NumPy"),
        pytest.param(np.array("car"), [3, 3], id="an array of one"),
        pytest.param(3, [3, 3], id="one number"),
    ],
)
def test_names_of_categories_may_be_given_in_any_way_that_numbers_may(categories, expected):
    found = ldls.InstanceMasks.from_array(np.zeros((2, 60, 80), bool), categories=categories).categories
    assert found.tolist() == expected and found.dtype == np.int32

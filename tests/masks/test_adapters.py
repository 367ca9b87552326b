"""Results of other programs, as stand-ins with the same attributes and, where they are installed, as themselves."""

from types import SimpleNamespace

import numpy as np
import pytest

import ldls
from segmenters.test_pasting import slow_resize

PIXELS = np.random.default_rng(2).random((3, 11, 17)) > 0.5
BOXES = np.array([[0, 0, 5, 5], [1, 1, 9, 9], [2, 2, 16, 10.0]])
CLASSES = {0: "person", 1: "forklift", 2: "car"}


class Tensor:
    """A stand-in that permits the calls of a tensor on a GPU, in their order."""

    def __init__(self, values, steps=()):
        self.values, self.steps = np.asarray(values), steps

    def detach(self):
        return Tensor(self.values, (*self.steps, "detach"))

    def cpu(self):
        return Tensor(self.values, (*self.steps, "cpu"))

    def float(self):
        return Tensor(self.values.astype(np.float32), (*self.steps, "float"))

    def numpy(self):
        if self.steps[:2] != ("detach", "cpu"):
            raise RuntimeError("on a GPU, or requires grad")
        if self.values.dtype == np.float16 and "float" not in self.steps:
            raise TypeError("unsupported ScalarType")
        return self.values

    def __array__(self, *_, **__):
        raise RuntimeError("on a GPU, or requires grad")


def torchvision_output(**changes):
    soft = np.where(PIXELS, 0.8, 0.3)[:, None].astype(np.float32)
    output = {"boxes": Tensor(BOXES), "labels": Tensor([1, 3, 18]), "scores": Tensor(np.float32([0.9, 0.5, 0.25]))}
    return output | {"masks": Tensor(soft)} | changes


def test_torchvision_labels_are_cocos():
    masks = ldls.InstanceMasks.from_torchvision(torchvision_output())
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [mask.name for mask in masks] == ["person", "car", "dog"]
    np.testing.assert_array_equal(masks.scores, np.float32([0.9, 0.5, 0.25]))
    everything = ldls.InstanceMasks.from_torchvision(torchvision_output(), threshold=0.3)
    assert all(mask.area == 11 * 17 for mask in everything)
    half = torchvision_output(masks=Tensor(PIXELS[:, None].astype(np.float16)))
    np.testing.assert_array_equal(ldls.InstanceMasks.from_torchvision(half).to_array(), PIXELS)


def test_torchvision_may_find_nothing():
    output = torchvision_output(masks=Tensor(np.zeros((0, 1, 4, 5))), labels=Tensor([]), scores=Tensor([]))
    masks = ldls.InstanceMasks.from_torchvision(output)
    assert (len(masks), masks.image_size) == (0, (4, 5))


def test_torchvision_networks_of_ones_own_have_names():
    masks = ldls.InstanceMasks.from_torchvision(torchvision_output(), names={1: "crane", 3: "barrow", 18: "pit"})
    assert [mask.name for mask in masks] == ["crane", "barrow", "pit"]


NAN_MASKS = np.full((3, 1, 4, 5), 0.5)
NAN_MASKS[1, 0, 2, 3] = np.nan


@pytest.mark.parametrize(
    ("changes", "options", "error", "message"),
    [
        pytest.param({"labels": Tensor([1, 0, 3])}, {}, ldls.MaskError, "mask 1: category is 0", id="background"),
        pytest.param({"labels": Tensor([1, 12, 3])}, {}, ldls.MaskError, "mask 1: category 12 is", id="no such label"),
        pytest.param({"labels": Tensor([1, 3])}, {}, ldls.MaskError, "one for each of 3", id="too few labels"),
        pytest.param({"labels": Tensor([1, 2.5, 3])}, {}, ldls.MaskError, "mask 1: labels is 2.5", id="label 2.5"),
        pytest.param({"labels": Tensor([1, 2, np.nan])}, {}, ldls.MaskError, "mask 2: labels is nan", id="NaN label"),
        pytest.param({"scores": Tensor([0.5, np.nan, 1])}, {}, ldls.MaskError, "mask 1: score is nan", id="NaN score"),
        pytest.param({"scores": Tensor([0.5, 1])}, {}, ldls.MaskError, "scores: expected one for", id="too few scores"),
        pytest.param({"masks": Tensor(NAN_MASKS)}, {}, ldls.MaskError, r"mask 1: pixel \(2, 3\) is nan", id="NaN mask"),
        pytest.param({"masks": Tensor(PIXELS)}, {}, ldls.MaskError, r"expected \(N, 1, height, width\)", id="3 axes"),
        pytest.param({}, {"threshold": np.nan}, ldls.ParameterError, "threshold: got nan", id="NaN threshold"),
        pytest.param({}, {"threshold": 0}, ldls.ParameterError, "threshold: got 0", id="threshold 0"),
    ],
)
def test_faults_of_torchvision_output_are_named(changes, options, error, message):
    with pytest.raises(error, match=message):
        ldls.InstanceMasks.from_torchvision(torchvision_output(**changes), **options)


def test_a_detector_of_boxes_is_no_segmenter():
    output = torchvision_output()
    del output["masks"]
    with pytest.raises(ldls.MaskError, match="'masks' is missing, found .*boxes"):
        ldls.InstanceMasks.from_torchvision(output)


def detections(**changes):
    parts = {
        "xyxy": BOXES,
        "mask": PIXELS,
        "confidence": np.float32([0.9, 0.5, 0.25]),
        "class_id": np.array([0, 1, 2]),
        "data": {"class_name": np.array(["person", "forklift", "car"])},
    }
    return SimpleNamespace(**parts | changes)


def test_supervision_classes_go_by_their_names():
    masks = ldls.InstanceMasks.from_supervision(detections())
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [(mask.category, mask.name) for mask in masks] == [(1, "person"), (101, "forklift"), (3, "car")]
    np.testing.assert_array_equal(masks.scores, np.float32([0.9, 0.5, 0.25]))


@pytest.mark.parametrize(
    ("changes", "options", "categories"),
    [
        pytest.param({"data": {}}, {}, [(100, "class 0"), (101, "class 1"), (102, "class 2")], id="numbers alone"),
        pytest.param(
            {"data": {}}, {"names": {0: "dog", 2: "bus"}}, [(18, "dog"), (101, "class 1"), (6, "bus")], id="names"
        ),
        pytest.param({"class_id": None, "data": {}}, {}, [(1, "object")] * 3, id="no classes"),
        pytest.param({"class_id": None, "data": None}, {}, [(1, "object")] * 3, id="no data"),
        pytest.param({"class_id": None}, {}, [(1, "person"), (101, "forklift"), (3, "car")], id="names alone"),
        pytest.param(
            {"class_id": None, "data": {"class_name": ["pit", "crane", "pit"]}},
            {"names": {0: "car", 4: "pit"}},
            [(104, "pit"), (105, "crane"), (104, "pit")],
            id="names alone, some known",
        ),
    ],
)
def test_supervision_may_lack_names(changes, options, categories):
    masks = ldls.InstanceMasks.from_supervision(detections(confidence=None, **changes), **options)
    assert [(mask.category, mask.name) for mask in masks] == categories
    assert masks.scores.tolist() == [1, 1, 1]


def test_supervision_may_find_nothing():
    nothing = detections(xyxy=np.zeros((0, 4)), mask=None, confidence=np.array([]), class_id=np.array([]), data={})
    assert ldls.InstanceMasks.from_supervision(nothing, image_size=(4, 5)).image_size == (4, 5)
    with pytest.raises(ldls.MaskError, match="pass image_size="):
        ldls.InstanceMasks.from_supervision(nothing)
    nothing.mask = np.zeros((0, 4, 5), bool)
    assert ldls.InstanceMasks.from_supervision(nothing).image_size == (4, 5)
    assert ldls.InstanceMasks.from_supervision(nothing, image_size=(6, 5)).image_size == (6, 5)
    nothing.mask = np.zeros((0, 0, 0), bool)
    with pytest.raises(ldls.MaskError, match="pass image_size="):
        ldls.InstanceMasks.from_supervision(nothing)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        pytest.param({"mask": None}, "3 boxes without masks, .*InstanceMasks.from_boxes .*Box", id="boxes only"),
        pytest.param({"class_id": np.array([0, 1])}, "3 masks, 2 class ids, 3 class names", id="too few classes"),
        pytest.param(
            {"class_id": None, "data": {"class_name": ["car"]}},
            "3 masks, 1 class ids, 1 class names",
            id="too few names",
        ),
        pytest.param({"class_id": np.array([0, 0, 2])}, "mask 0: class 0 is 'person', elsewhere", id="two names"),
        pytest.param({"class_id": np.array([0, -200, 2])}, "mask 1: class -200", id="class -200"),
        pytest.param({"confidence": np.array([1, 1])}, "scores: expected one for each of 3", id="too few scores"),
        pytest.param({"confidence": np.array([1, 1, 1.5])}, "mask 2: score is 1.5", id="score above 1"),
        pytest.param({"mask": NAN_MASKS[:, 0]}, r"mask 1: pixel \(2, 3\) is nan", id="NaN mask"),
    ],
)
def test_faults_of_detections_are_named(changes, message):
    with pytest.raises(ldls.MaskError, match=message):
        ldls.InstanceMasks.from_supervision(detections(**changes))


def ultralytics_result(masks="all", **changes):
    parts = {
        "orig_shape": (11, 17),
        "names": CLASSES,
        "boxes": SimpleNamespace(cls=Tensor([0.0, 1.0, 2.0]), conf=Tensor(np.float32([0.9, 0.5, 0.25]))),
        "masks": SimpleNamespace(data=Tensor(PIXELS.astype(np.float32)), xy=[]) if masks == "all" else masks,
    }
    return SimpleNamespace(**parts | changes)


def test_ultralytics_masks_of_the_images_size_are_taken_as_they_are():
    masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result())
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [(mask.category, mask.name) for mask in masks] == [(1, "person"), (101, "forklift"), (3, "car")]
    np.testing.assert_array_equal(masks.scores, np.float32([0.9, 0.5, 0.25]))


def test_ultralytics_masks_of_the_padded_input_are_cut_out_and_resampled():
    padded = (np.random.default_rng(3).random((3, 64, 64)) > 0.5).astype(np.float32)
    padded[0] = 1
    padded[0, :11] = 0  # of grey rows 11 and 12, as Ultralytics rounds 23 / 2
    padded[0, 52:] = 0
    masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result(SimpleNamespace(data=Tensor(padded))))
    expected = [slow_resize(mask[11:52], 11, 17) > 0.5 for mask in padded]
    np.testing.assert_array_equal(masks.to_array(), expected)
    assert masks[0].area == 11 * 17


def test_small_ultralytics_masks_lose_no_edges():
    rows, columns = np.mgrid[:375, :1242]
    truth = ((columns - 700) / 4) ** 2 + ((rows - 180) / 8) ** 2 <= 1
    rows, columns = (np.mgrid[:224, :640] + 0.5 - np.reshape([15, 0], (2, 1, 1))) * 1242 / 640 - 0.5
    of_network = ((columns - 700) / 4) ** 2 + ((rows - 180) / 8) ** 2 <= 1
    result = ultralytics_result(
        SimpleNamespace(data=of_network[None]), orig_shape=truth.shape, boxes=SimpleNamespace(cls=[0.0], conf=[0.5])
    )
    found = ldls.InstanceMasks.from_ultralytics(result).to_array()[0]
    assert (found & truth).sum() / (found | truth).sum() > 0.8
    for axis in (0, 1):
        assert abs(np.nonzero(found)[axis].mean() - np.nonzero(truth)[axis].mean()) < 0.25


def test_ultralytics_outlines_serve_where_there_are_no_pixels():
    outline = np.array([[2, 1], [9, 1], [9, 6], [2, 6]], np.float32)
    shapes = SimpleNamespace(xy=[outline, np.zeros((0, 2)), outline + 1])
    masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result(shapes))
    expected = np.zeros((3, 11, 17), bool)
    expected[0, 1:6, 2:9] = True
    expected[2, 2:7, 3:10] = True
    np.testing.assert_array_equal(masks.to_array(), expected)


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(["person", "forklift", "car"], id="list"),
        pytest.param({"0": "person", "1": "forklift", "2": "car"}, id="numbers as text"),
        pytest.param({np.int64(i): name for i, name in CLASSES.items()}, id="numbers of NumPy"),
    ],
)
def test_ultralytics_names_may_be_of_json(names):
    masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result(names=names))
    assert [(mask.category, mask.name) for mask in masks] == [(1, "person"), (101, "forklift"), (3, "car")]


def test_ultralytics_masks_may_have_no_boxes():
    masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result(boxes=None))
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [(mask.name, mask.score) for mask in masks] == [("object", 1)] * 3


def test_ultralytics_may_find_nothing():
    for boxes in (SimpleNamespace(cls=Tensor(np.zeros(0)), conf=Tensor(np.zeros(0))), None):
        masks = ldls.InstanceMasks.from_ultralytics(ultralytics_result(None, boxes=boxes))
        assert (len(masks), masks.image_size) == (0, (11, 17))


@pytest.mark.parametrize(
    ("result", "message"),
    [
        pytest.param(ultralytics_result(names={0: "person"}), "mask 1: class 1 has no name", id="no name"),
        pytest.param(ultralytics_result(names={"a": "b"}), "names: got {'a': 'b'}, expected class names", id="key a"),
        pytest.param(ultralytics_result(names=None), "names: got None, expected class names by", id="names None"),
        pytest.param(ultralytics_result(None), "result: 3 boxes without masks, expected a result", id="boxes only"),
        pytest.param(
            ultralytics_result(boxes=SimpleNamespace(cls=Tensor([0.0]), conf=Tensor([1.0]))),
            "categories: expected one for each of 3",
            id="too few boxes",
        ),
        pytest.param(
            ultralytics_result(boxes=SimpleNamespace(cls=Tensor([0, 1, np.nan]), conf=Tensor([1.0]))),
            "mask 2: boxes.cls is nan",
            id="NaN class",
        ),
        pytest.param(
            ultralytics_result(SimpleNamespace(data=Tensor(NAN_MASKS[:, 0]))),
            r"mask 1: pixel \(2, 3\) is nan",
            id="NaN",
        ),
        pytest.param(
            ultralytics_result(SimpleNamespace(data=None, xy=[np.full((3, 2), np.nan)] * 3)),
            "mask 0: .*NaN",
            id="NaN outline",
        ),
    ],
)
def test_faults_of_ultralytics_results_are_named(result, message):
    with pytest.raises(ldls.MaskError, match=message):
        ldls.InstanceMasks.from_ultralytics(result)


def sam_records(scores=(0.9, 1.02, 0.25)):
    compressed = ldls.InstanceMasks.from_array(PIXELS).to_coco()["annotations"][1]["segmentation"]
    runs = ldls.InstanceMasks.from_array(PIXELS)[2].rle.runs().tolist()
    segmentations = [PIXELS[0], compressed, {"size": [11, 17], "counts": runs}]
    return [{"segmentation": s, "predicted_iou": iou} for s, iou in zip(segmentations, scores, strict=True)]


def test_sam_masks_are_objects_with_their_predicted_iou():
    masks = ldls.InstanceMasks.from_sam(sam_records())
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [mask.name for mask in masks] == ["object"] * 3
    np.testing.assert_array_equal(masks.scores, np.float32([0.9, 1, 0.25]))
    masks = ldls.InstanceMasks.from_sam(sam_records(), categories=[1, 3, 18])
    assert [mask.name for mask in masks] == ["person", "car", "dog"]


def test_sam_may_find_nothing():
    assert ldls.InstanceMasks.from_sam([], image_size=(4, 5)).image_size == (4, 5)
    with pytest.raises(ldls.MaskError, match="pass image_size="):
        ldls.InstanceMasks.from_sam([])


@pytest.mark.parametrize(
    ("records", "message"),
    [
        pytest.param(sam_records([1, np.nan, 1]), "records: mask 1: score is nan", id="NaN score"),
        pytest.param([{"bbox": [0, 0, 1, 1]}], "record 0: 'segmentation' is missing, found", id="no segmentation"),
        pytest.param([{"segmentation": {"size": [4, 5], "counts": [3]}}], "record 0: RLE: runs sum to 3", id="runs"),
        pytest.param([{"segmentation": {"counts": [20]}}], "record 0: RLE: size is None", id="no size"),
        pytest.param([{"segmentation": NAN_MASKS[1, 0]}], r"mask 0: pixel \(2, 3\) is nan", id="NaN mask"),
    ],
)
def test_faults_of_sam_records_are_named(records, message):
    with pytest.raises(ldls.MaskError, match=message):
        ldls.InstanceMasks.from_sam(records)


def test_boxes_may_be_tensors():
    assert len(ldls.InstanceMasks.from_boxes(Tensor(BOXES), (11, 17))) == 3


def test_a_real_torchvision_network_is_understood():
    torch = pytest.importorskip("torch")
    detection = pytest.importorskip("torchvision.models.detection")
    torch.manual_seed(0)
    network = detection.maskrcnn_resnet50_fpn(
        weights=None, weights_backbone=None, min_size=64, max_size=96, box_score_thresh=0, box_detections_per_img=5
    )
    (output,) = network.eval()([torch.rand(3, 60, 80)])
    assert output["scores"].requires_grad
    masks = ldls.InstanceMasks.from_torchvision(output)
    assert masks.image_size == (60, 80)
    np.testing.assert_array_equal(masks.to_array(), output["masks"].detach().numpy()[:, 0] >= 0.5)
    assert masks.categories.tolist() == output["labels"].tolist()
    brief = output | {"masks": output["masks"].bfloat16()}
    assert len(ldls.InstanceMasks.from_torchvision(brief)) == len(masks)


def test_real_detections_are_understood():
    sv = pytest.importorskip("supervision")
    found = sv.Detections(**vars(detections()))
    masks = ldls.InstanceMasks.from_supervision(found)
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [mask.name for mask in masks] == ["person", "forklift", "car"]
    assert len(ldls.InstanceMasks.from_supervision(sv.Detections.empty(), image_size=(4, 5))) == 0
    if hasattr(sv, "CompactMask"):
        whole = np.tile([0.0, 0, 16, 10], (3, 1))
        found.mask = sv.CompactMask.from_dense(PIXELS, whole, image_shape=(11, 17))
        np.testing.assert_array_equal(ldls.InstanceMasks.from_supervision(found).to_array(), PIXELS)
    with pytest.raises(ldls.MaskError, match="from_boxes"):
        ldls.InstanceMasks.from_supervision(sv.Detections(xyxy=BOXES))


def test_real_ultralytics_results_are_understood():
    torch = pytest.importorskip("torch")
    results = pytest.importorskip("ultralytics.engine.results")
    boxes = torch.tensor([[0, 0, 5, 5, 0.9, 0], [1, 1, 9, 9, 0.5, 1], [2, 2, 16, 10, 0.25, 2]])
    image = np.zeros((11, 17, 3), np.uint8)
    parts = {"orig_img": image, "path": "a.jpg", "names": CLASSES}
    found = results.Results(**parts, boxes=boxes, masks=torch.from_numpy(PIXELS.astype(np.float32)))
    masks = ldls.InstanceMasks.from_ultralytics(found)
    np.testing.assert_array_equal(masks.to_array(), PIXELS)
    assert [mask.name for mask in masks] == ["person", "forklift", "car"]
    padded = torch.zeros(3, 32, 32)
    padded[0, 8:24, 4:20] = 1
    masks = ldls.InstanceMasks.from_ultralytics(results.Results(**parts, boxes=boxes, masks=padded))
    assert masks.image_size == (11, 17)
    assert masks[0].area > 20
    assert [mask.area for mask in masks][1:] == [0, 0]
    nothing = results.Results(**parts, boxes=torch.zeros(0, 6))
    assert len(ldls.InstanceMasks.from_ultralytics(nothing)) == 0


def test_real_supervision_reads_what_ultralytics_finds():
    torch = pytest.importorskip("torch")
    sv = pytest.importorskip("supervision")
    results = pytest.importorskip("ultralytics.engine.results")
    boxes = torch.tensor([[0, 0, 5, 5, 0.9, 0], [1, 1, 9, 9, 0.5, 1], [2, 2, 16, 10, 0.25, 2]])
    found = results.Results(
        orig_img=np.zeros((11, 17, 3), np.uint8),
        path="a.jpg",
        names=CLASSES,
        boxes=boxes,
        masks=torch.from_numpy(PIXELS.astype(np.float32)),
    )
    direct = ldls.InstanceMasks.from_ultralytics(found)
    through = ldls.InstanceMasks.from_supervision(sv.Detections.from_ultralytics(found))
    np.testing.assert_array_equal(through.to_array(), direct.to_array())
    assert through.categories.tolist() == direct.categories.tolist()

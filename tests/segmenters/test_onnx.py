"""ONNX models of every family, from the image to the labels of points."""

import numpy as np
import pytest
from onnx import TensorProto
from PIL import Image

import ldls
from command import command
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS
from ldls.errors import (
    DtypeError,
    FileFormatError,
    LimitError,
    MaskError,
    ParameterError,
    ShapeError,
    UnsupportedFormatError,
)
from ldls.segmenters import OnnxSegmenter
from ldls.simulation import SegmenterErrors, SensorErrors, scene_frame
from segmenters import graphs

MIN_PIXELS, MIN_POINTS = 400, 100


class Street:
    """A street whose objects have flat colours of their own, and its truth."""

    def __init__(self, seed=4):
        frame = scene_frame(seed, segmenter=SegmenterErrors.none(), sensors=SensorErrors.none())
        (image,) = frame.images
        self.points, self.truth, self.camera = frame.points, frame.truth.instances, image.camera
        owners, categories = image.pixels.instances, np.array([one.category for one in frame.objects])
        sizes = np.bincount(owners.ravel(), minlength=len(categories) + 1)
        self.objects = [m for m in range(1, len(categories) + 1) if sizes[m] >= MIN_PIXELS]
        palette = np.random.default_rng(5).permutation(np.array(np.meshgrid(*[[60, 150, 240]] * 3)).reshape(3, -1).T)
        levels = np.zeros((len(categories) + 1, 3), np.uint8)
        levels[self.objects] = palette[: len(self.objects)]
        self.image = levels[owners]
        self.colours = levels[self.objects].astype(np.float32) / 255
        self.categories = categories[np.array(self.objects) - 1]
        self.silhouettes = np.stack([owners == m for m in self.objects])
        self.scores = 0.95 - 0.01 * np.arange(len(self.objects))

    @property
    def contiguous(self):
        return np.searchsorted(CONTIGUOUS_IDS, self.categories)


@pytest.fixture(scope="module")
def scene():
    return Street()


SIZE = (375, 1242)
ZOO_SIZE = (800, 2656)
YOLO_SIZE = (384, 1248)


FAMILIES = [
    pytest.param(lambda s: graphs.mask_rcnn(s.colours, s.categories, s.scores, SIZE), "mask-rcnn", 0.999, id="pasted"),
    pytest.param(
        lambda s: graphs.mask_rcnn(s.colours, s.categories, s.scores, SIZE, batched=True, named=False),
        "mask-rcnn",
        0.999,
        id="a batch of one, outputs without names",
    ),
    pytest.param(
        lambda s: graphs.mask_rcnn(s.colours, s.categories, s.scores, SIZE, half=True), "mask-rcnn", 0.999, id="fp16"
    ),
    pytest.param(
        lambda s: graphs.mask_rcnn(s.colours, s.categories, s.scores, SIZE, cells=28), "mask-rcnn", 0.8, id="28 x 28"
    ),
    pytest.param(
        lambda s: graphs.zoo_mask_rcnn(s.colours, s.contiguous + 1, s.scores, ZOO_SIZE), "mask-rcnn-zoo", 0.8, id="zoo"
    ),
    pytest.param(lambda s: graphs.yolo(s.colours, s.contiguous, s.scores, YOLO_SIZE), "yolo", 0.6, id="YOLOv8"),
    pytest.param(
        lambda s: graphs.yolo(s.colours, s.contiguous, s.scores, YOLO_SIZE, layout="yolov5"), "yolo", 0.6, id="YOLOv5"
    ),
    pytest.param(
        lambda s: graphs.yolo(
            s.colours,
            s.contiguous,
            s.scores,
            YOLO_SIZE,
            layout="end-to-end",
            notes={"names": repr(dict(enumerate(COCO_NAMES.values())))},
        ),
        "yolo",
        0.6,
        id="end to end",
    ),
]


@pytest.mark.parametrize(("build", "kind", "least_iou"), FAMILIES)
def test_colours_become_labels_of_points(build, kind, least_iou, scene, tmp_path):
    segmenter = OnnxSegmenter(graphs.save(build(scene), tmp_path / "model.onnx"), threads=1)
    assert segmenter.kind == kind
    masks = segmenter(scene.image)
    np.testing.assert_array_equal(masks.categories, scene.categories)
    np.testing.assert_allclose(masks.scores, scene.scores, atol=1e-3)
    found = masks.to_array()
    ious = (found & scene.silhouettes).sum((1, 2)) / (found | scene.silhouettes).sum((1, 2))
    assert ious.min() >= least_iou
    labels = ldls.segment(scene.points, masks, scene.camera).labels
    of_points = [_iou(labels == k, (scene.truth == m) & (labels >= 0)) for k, m in enumerate(scene.objects, 1)]
    counts = [np.count_nonzero((scene.truth == m) & (labels >= 0)) for m in scene.objects]
    compared = [iou for iou, count in zip(of_points, counts, strict=True) if count >= MIN_POINTS]
    assert len(compared) >= 3
    assert min(compared) > 0.7


@pytest.mark.parametrize(("build", "kind", "least_iou"), FAMILIES)
def test_the_command_reaches_the_same_labels(build, kind, least_iou, scene, tmp_path):
    model = graphs.save(build(scene), tmp_path / "model.onnx")
    files = frame_files(scene, tmp_path)
    words = [word for name, path in files.items() for word in (f"--{name}", path)]
    outcome = command("segment", *words, "--segmenter", f"onnx:{model}", "--out", tmp_path)
    assert outcome.exit_code == 0, outcome.output
    masks = OnnxSegmenter(model, kind=kind)(scene.image)
    expected = ldls.segment(scene.points, masks, ldls.read_camera(files["calib"])).labels
    with np.load(tmp_path / "points.npz") as written:
        np.testing.assert_array_equal(written["labels"], expected)


def frame_files(scene, folder):
    """The frame as files that `ldls segment` reads."""
    matrices = {
        "P2": scene.camera.projection,
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": scene.camera.T_camera_lidar[:3],
    }
    lines = (f"{key}: {' '.join(map(repr, matrix.ravel().tolist()))}\n" for key, matrix in matrices.items())
    (folder / "calib.txt").write_text("".join(lines))
    scene.points.astype("<f4").tofile(folder / "points.bin")
    Image.fromarray(scene.image).save(folder / "image.png")
    return {"points": folder / "points.bin", "calib": folder / "calib.txt", "image": folder / "image.png"}


def _iou(one, other):
    return np.count_nonzero(one & other) / max(np.count_nonzero(one | other), 1)


BLANK = np.zeros((20, 30, 3), np.uint8)
BOX = np.array([[2, 3, 12, 13]], np.float32)
LABEL, SCORE = np.array([3]), np.array([0.9], np.float32)
FULL = np.ones((1, 1, 20, 30), np.float32)
GRID = np.ones((1, 1, 28, 28), np.float32)
NAN = np.float32(np.nan)


def opened(tmp_path, model, **options):
    return OnnxSegmenter(graphs.save(model, tmp_path / "model.onnx"), **{"threads": 1, **options})


def found(tmp_path, boxes=BOX, labels=LABEL, scores=SCORE, masks=FULL, **options):
    return opened(tmp_path, graphs.constant_detections(boxes, labels, scores, masks), **options)(BLANK)


def test_scores_only_just_outside_are_clipped(tmp_path):
    assert found(tmp_path, scores=np.array([1.0005], np.float32)).scores.tolist() == [1]


def test_low_scores_are_left_out(tmp_path):
    two = {
        "boxes": BOX.repeat(2, 0),
        "labels": LABEL.repeat(2),
        "scores": np.array([0.9, 0.5], np.float32),
        "masks": FULL.repeat(2, 0),
    }
    assert [len(found(tmp_path, **two, min_score=score)) for score in (0.0, 0.5, 0.6, 1.0)] == [2, 2, 1, 0]


def test_nothing_found_is_no_masks(tmp_path):
    none = {"boxes": BOX[:0], "labels": LABEL[:0], "scores": SCORE[:0], "masks": FULL[:0]}
    masks = found(tmp_path, **none)
    assert (len(masks), masks.image_size) == (0, (20, 30))


def test_names_decide_the_categories(tmp_path):
    (mask,) = found(tmp_path, names={3: "traffic cone"})
    assert (mask.category, mask.name) == (103, "traffic cone")


@pytest.mark.parametrize(
    "box",
    [
        pytest.param([5, 5, 5, 12], id="no width"),
        pytest.param([12, 5, 5, 12], id="turned round"),
        pytest.param([100, 5, 120, 12], id="beside the image"),
        pytest.param([-50, -50, -9, -9], id="before the image"),
    ],
)
def test_boxes_that_show_nothing_are_left_out(box, tmp_path):
    assert len(found(tmp_path, boxes=np.array([box], np.float32), masks=GRID)) == 0


@pytest.mark.parametrize(
    ("outputs", "error", "match"),
    [
        pytest.param({"scores": np.array([NAN])}, MaskError, r"\.onnx: instance 0: score is nan", id="score NaN"),
        pytest.param({"scores": SCORE + 1}, MaskError, r"instance 0: score is 1\.8999", id="score above 1"),
        pytest.param({"scores": SCORE - 1.2}, MaskError, "instance 0: score is -0.3", id="score below 0"),
        pytest.param({"boxes": BOX * NAN}, MaskError, "instance 0: box holds NaN", id="box NaN"),
        pytest.param({"masks": FULL * NAN}, MaskError, "instance 0: mask holds NaN", id="mask NaN"),
        pytest.param({"masks": GRID * np.inf}, MaskError, "instance 0: mask holds NaN or inf", id="grid infinite"),
        pytest.param({"labels": np.array([91])}, MaskError, "instance 0: class 91 is unknown", id="unknown class"),
        pytest.param({"masks": FULL[:, :, 1:]}, FileFormatError, "19 x 30 cells", id="masks of another size"),
        pytest.param({"boxes": BOX[:, :3]}, FileFormatError, r"boxes: expected shape \(1, 4\)", id="box of three"),
        pytest.param({"labels": LABEL[:0]}, FileFormatError, r"labels: expected shape \(1\)", id="too few labels"),
        pytest.param({"masks": FULL[:, 0]}, FileFormatError, "masks: expected shape", id="masks of three sides"),
        pytest.param({"scores": SCORE[:, None]}, FileFormatError, "scores: expected shape", id="scores of two sides"),
    ],
)
def test_outputs_that_cannot_be(outputs, error, match, tmp_path):
    with pytest.raises(error, match=match):
        found(tmp_path, **outputs)


IMAGE = ("image", TensorProto.FLOAT, (3, "h", "w"))


def declared(inputs, outputs):
    g = graphs.Graph()
    for name, _, _ in outputs:
        g("Identity", np.zeros(1, np.float32), output=name)
    return g.model(inputs, outputs)


DETECTIONS = graphs.detection_values(("boxes", "labels", "scores", "masks"), None)


@pytest.mark.parametrize(
    ("inputs", "outputs", "match"),
    [
        pytest.param([IMAGE], DETECTIONS[:3], "no known kind .*boxes float32 .n, 4.*labels int64", id="no masks"),
        pytest.param([IMAGE], [("logits", TensorProto.FLOAT, (1, 1000))], "logits float32", id="a classifier"),
        pytest.param(
            [("image", TensorProto.FLOAT, (4, 3, 64, 64))], DETECTIONS, "batch; export it for a batch of 1", id="batch"
        ),
        pytest.param([IMAGE, ("scale", TensorProto.FLOAT, (1,))], DETECTIONS, "one input", id="two inputs"),
        pytest.param([("image", TensorProto.UINT8, (3, "h", "w"))], DETECTIONS, "image uint8", id="bytes in"),
        pytest.param([("image", TensorProto.FLOAT, (1, 64, 64, 3))], DETECTIONS, "one input", id="channels last"),
        pytest.param([("image", TensorProto.FLOAT, (1, 1, 64, 64))], DETECTIONS, "one input", id="grey"),
        pytest.param([("image", TensorProto.FLOAT, None)], DETECTIONS, r"image float32 \(\?\)", id="no shape"),
        pytest.param([IMAGE], DETECTIONS, "onnxruntime cannot run it", id="outputs of other types than declared"),
    ],
)
def test_models_of_no_known_kind(inputs, outputs, match, tmp_path):
    with pytest.raises(UnsupportedFormatError, match=match):
        opened(tmp_path, declared(inputs, outputs))


@pytest.mark.parametrize(
    ("options", "match"),
    [
        pytest.param({"min_score": 1.5}, "min_score: got 1.5", id="score above 1"),
        pytest.param({"min_score": NAN}, "min_score: got", id="score NaN"),
        pytest.param({"threads": 0}, "threads: got 0", id="no threads"),
        pytest.param({"kind": "yolov9"}, "expected one of mask-rcnn-zoo, mask-rcnn, yolo", id="unknown kind"),
        pytest.param({"providers": ["NoSuchProvider"]}, "expected some of .*CPUExecution", id="unknown provider"),
    ],
)
def test_parameters(options, match, tmp_path):
    with pytest.raises(ParameterError, match=match):
        found(tmp_path, **options)


def test_a_kind_that_the_model_is_not(tmp_path):
    with pytest.raises(UnsupportedFormatError, match="expected boxes and prototypes of YOLO, got inputs image"):
        found(tmp_path, kind="yolo")


def test_an_image_of_another_size_than_the_model_takes(tmp_path):
    model = graphs.mask_rcnn(np.ones((1, 3), np.float32), [1], [0.9], (20, 31))
    with pytest.raises(ShapeError, match="20 x 30 pixels.*export it with sides that vary"):
        opened(tmp_path, model)(BLANK)


def test_a_model_that_fails(tmp_path):
    g = graphs.Graph()
    g("Add", np.zeros((3, 7, 7), np.float32), "image", output="masks")
    for name, _, _ in DETECTIONS[:3]:
        g("Identity", LABEL if name == "labels" else SCORE, output=name)
    with pytest.raises(FileFormatError, match=r"the model failed on an input \(3, 20, 30\)"):
        opened(tmp_path, g.model([IMAGE], DETECTIONS))(BLANK)


@pytest.mark.parametrize(
    ("image", "error"),
    [
        pytest.param(BLANK[:, :, 0], ShapeError, id="grey"),
        pytest.param(BLANK.astype(float), DtypeError, id="floats"),
    ],
)
def test_images_are_checked(image, error, tmp_path):
    with pytest.raises(error):
        opened(tmp_path, graphs.constant_detections(BOX, LABEL, SCORE, FULL))(image)


def test_an_image_too_long_for_the_zoo(tmp_path):
    model = graphs.zoo_mask_rcnn(np.ones((1, 3), np.float32), [1], [0.9], (800, 32))
    with pytest.raises(LimitError, match="1 x 3000 pixels make an input of 800 x 2400000"):
        opened(tmp_path, model)(np.zeros((1, 3000, 3), np.uint8))

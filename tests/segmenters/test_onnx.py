"""ONNX models of every family, from the image to the labels of points."""

import numpy as np
import pytest

import ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS
from ldls.errors import DtypeError, FileFormatError, MaskError, ParameterError, ShapeError, UnsupportedFormatError
from ldls.segmenters import OnnxSegmenter
from ldls.segmenters.letterbox import Letterbox
from ldls.simulation.demo.layout import street
from ldls.simulation.demo.street import PROJECTION, T_CAMERA_LIDAR, photograph, scan

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

from onnx import TensorProto  # noqa: E402
from segmenters import graphs  # noqa: E402

MIN_PIXELS, MIN_POINTS = 400, 60


class Street:
    """A street whose objects have flat colours of their own, and its truth."""

    def __init__(self, seed=3):
        rng = np.random.default_rng(seed)
        solids, categories = street(rng)
        self.points, self.truth = scan(solids, rng)
        _, owners = photograph(solids)
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
        self.camera = ldls.Camera(projection=PROJECTION, T_camera_lidar=T_CAMERA_LIDAR)

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


def _iou(one, other):
    return np.count_nonzero(one & other) / max(np.count_nonzero(one | other), 1)

"""torchvision's models, and what becomes of them when they are exported; weights are random."""

import warnings

import numpy as np
import pytest

from ldls.errors import ParameterError
from ldls.segmenters import OnnxSegmenter, TorchvisionSegmenter
from ldls.simulation import sample_frame

torch = pytest.importorskip("torch")
torchvision = pytest.importorskip("torchvision")
N = 10


@pytest.fixture(scope="module")
def image():
    return np.ascontiguousarray(sample_frame().images[0].read()[100:220, 300:500])


@pytest.fixture(scope="module")
def model():
    torch.manual_seed(0)
    sizes = {"min_size": 120, "max_size": 240, "box_score_thresh": 0.0, "box_detections_per_img": N}
    make = torchvision.models.detection.maskrcnn_resnet50_fpn
    return make(weights=None, weights_backbone=None, **sizes).eval()


def expected(model, image):
    """Masks that are not empty, labels and scores, as the model itself gives them."""
    with torch.inference_mode():
        found = model([torch.from_numpy(image.transpose(2, 0, 1).copy()).float() / 255])[0]
    masks = found["masks"][:, 0].numpy() >= 0.5
    shown = masks.any((1, 2))
    return masks[shown], found["labels"].numpy()[shown], found["scores"].numpy()[shown]


def test_an_exported_model_finds_what_the_model_finds(model, image, tmp_path):
    path = tmp_path / "model.onnx"
    export(model, image, path)
    found = OnnxSegmenter(path, min_score=0.0, threads=2)(image)
    masks, labels, scores = expected(model, image)
    assert len(found) == len(masks) > 0
    np.testing.assert_array_equal(found.categories, labels)
    np.testing.assert_allclose(found.scores, scores, atol=1e-4)
    assert np.mean(found.to_array() != masks) < 1e-4


def export(model, image, path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter
        torch.onnx.export(
            model,
            ([torch.rand(3, *image.shape[:2])],),
            path,
            dynamo=False,
            opset_version=17,
            input_names=["image"],
            output_names=["boxes", "labels", "scores", "masks"],
            dynamic_axes={"image": {1: "height", 2: "width"}},
        )


def test_the_segmenter_finds_what_the_model_finds(model, image):
    segmenter = TorchvisionSegmenter("maskrcnn_resnet50_fpn", weights=None, device="cpu", min_score=0.0)
    segmenter.model = model
    found = segmenter(image)
    masks, labels, scores = expected(model, image)
    np.testing.assert_array_equal(found.to_array(), masks)
    np.testing.assert_array_equal(found.categories, labels)
    np.testing.assert_array_equal(found.scores, scores)


@pytest.mark.parametrize(
    ("name", "match"),
    [
        pytest.param("maskrcnn_resnet50", "did you mean 'maskrcnn_resnet50_fpn", id="misspelt"),
        pytest.param("fasterrcnn_resnet50_fpn", "is no mask model.*maskrcnn_resnet50_fpn_v2", id="boxes alone"),
    ],
)
def test_names_that_are_no_mask_model(name, match):
    with pytest.raises(ParameterError, match=match):
        TorchvisionSegmenter(name, weights=None)

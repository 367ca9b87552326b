import subprocess
import sys

import numpy as np
import pytest

from ldls import _optional
from ldls.errors import ParameterError
from ldls.segmenters import SEGMENTERS, BoxSegmenter, OnnxSegmenter, TorchvisionSegmenter, open_segmenter
from segmenters import graphs

MODEL = graphs.constant_detections(
    np.array([[2, 3, 12, 13]], np.float32),
    np.array([3]),
    np.array([0.9], np.float32),
    np.ones((1, 1, 9, 9), np.float32),
)


@pytest.mark.parametrize(
    "name",
    [pytest.param("model.onnx", id="plain"), pytest.param("a: b:c.onnx", id="colons in the path")],
)
def test_onnx_files_are_opened(name, tmp_path):
    path = graphs.save(MODEL, tmp_path / name)
    segmenter = open_segmenter(f"onnx:{path}", min_score=0.25, threads=1)
    assert isinstance(segmenter, OnnxSegmenter)
    assert segmenter.min_score == 0.25
    assert segmenter.names[3] == "car"


@pytest.mark.parametrize(("name", "grabcut"), [("boxes", False), ("grabcut", True)])
def test_label_files_are_opened(name, grabcut, tmp_path):
    path = tmp_path / "1:2.txt"
    path.write_text("Car 0 0 0 1 2 3 4 1 1 1 1 1 1 0 0.5\n")
    segmenter = open_segmenter(f"{name}:{path}")
    assert isinstance(segmenter, BoxSegmenter)
    assert (len(segmenter.boxes), segmenter.grabcut, segmenter.min_score) == (1, grabcut, 0)
    assert (segmenter.names[3], segmenter.names[102]) == ("car", "Cyclist")


def test_torchvision_is_opened():
    pytest.importorskip("torchvision")
    segmenter = open_segmenter("torchvision:maskrcnn_resnet50_fpn", weights=None, device="cpu")
    assert isinstance(segmenter, TorchvisionSegmenter)
    assert segmenter.names[3] == "car"


@pytest.mark.parametrize(
    ("spec", "match"),
    [
        pytest.param("onx:model.onnx", "did you mean 'onnx'", id="misspelt"),
        pytest.param("model.onnx", "expected onnx:model.onnx, torchvision or", id="a bare path"),
        pytest.param("C:\\model.onnx", "is unknown", id="a bare path of Windows"),
        pytest.param("", "'' is unknown", id="empty"),
        pytest.param("onnx", "'onnx' names no file", id="no file"),
        pytest.param("boxes:", "expected boxes:label_2", id="no file after the colon"),
    ],
)
def test_specs_that_say_nothing(spec, match):
    with pytest.raises(ParameterError, match=match):
        open_segmenter(spec)


def test_every_segmenter_can_be_opened():
    assert set(SEGMENTERS) == {"onnx", "torchvision", "boxes", "grabcut"}


def test_nothing_heavy_is_imported():
    heavy = ["onnx", "onnxruntime", "torch", "torchvision", "cv2"]
    code = f"import sys, ldls.segmenters; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("spec", "extra"),
    [
        pytest.param("onnx:{folder}/model.onnx", "onnx", id="onnx"),
        pytest.param("torchvision", "torch", id="torchvision"),
        pytest.param("grabcut:{folder}/label.txt", "grabcut", id="grabcut"),
    ],
)
def test_a_missing_library_is_named_with_its_extra(spec, extra, tmp_path, monkeypatch):
    def missing(module):
        raise ImportError(module)

    graphs.save(MODEL, tmp_path / "model.onnx")
    (tmp_path / "label.txt").write_text("Car 0 0 0 1 2 30 40 1 1 1 1 1 1 0\n")
    monkeypatch.setattr(_optional, "import_module", missing)
    with pytest.raises(ImportError, match=rf"pip install 'ldls\[{extra}\]'"):
        open_segmenter(spec.format(folder=tmp_path))(np.zeros((50, 60, 3), np.uint8))

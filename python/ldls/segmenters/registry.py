"""Segmenters by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ldls.checks import did_you_mean
from ldls.errors import ParameterError
from ldls.io.masks.kitti_boxes import KITTI_NAMES
from ldls.segmenters.boxes import BoxSegmenter
from ldls.segmenters.onnx import OnnxSegmenter
from ldls.segmenters.segmenter import Segmenter
from ldls.segmenters.torchvision import DEFAULT_MODEL, TorchvisionSegmenter


def _torchvision(name: str, **options: Any) -> Segmenter:  # noqa: ANN401
    return TorchvisionSegmenter(name or DEFAULT_MODEL, **options)


SEGMENTERS: dict[str, Callable[..., Segmenter]] = {
    "onnx": OnnxSegmenter,
    "torchvision": _torchvision,
    "boxes": BoxSegmenter.read_kitti,
    "grabcut": partial(BoxSegmenter.read_kitti, grabcut=True),
}
"""Makers of the segmenters by name; they take the text after the colon."""
EXAMPLES = {
    "onnx": "onnx:model.onnx",
    "torchvision": "torchvision or torchvision:maskrcnn_resnet50_fpn_v2",
    "boxes": "boxes:label_2/000001.txt",
    "grabcut": "grabcut:label_2/000001.txt",
}
WITHOUT_ARGUMENT = frozenset({"torchvision"})
OF_ONE_IMAGE: dict[str, Mapping[int, str]] = {"boxes": KITTI_NAMES, "grabcut": KITTI_NAMES}
"""Those whose file is of one image, and the name of each category id that their masks can have."""


def segmenter_file(spec: str | None) -> Path | None:
    """The file that `spec` names, as a model or boxes; None where there is none."""
    path = Path((spec or "").partition(":")[2])
    return path if path.is_file() else None


def resolved(spec: str) -> str:
    """`spec` with the absolute path of its file, if it names one: the same from any folder."""
    name, colon, argument = spec.partition(":")
    return spec if name in WITHOUT_ARGUMENT or not argument else f"{name}{colon}{Path(argument).resolve()}"


def open_segmenter(spec: str, *, min_score: float | None = None, **options: Any) -> Segmenter:  # noqa: ANN401
    """The segmenter that `spec` says: a name of `SEGMENTERS`, then after a colon its file or model.

    Args:
        spec: `onnx:model.onnx`, `torchvision`, `torchvision:maskrcnn_resnet50_fpn_v2`, `boxes:label_2/000001.txt` or
            `grabcut:label_2/000001.txt`; only the first colon divides, so paths may have more.
        min_score: Lowest score that is kept, 0 to 1; each segmenter has its own without it.
        options: Further options of the segmenter.

    Raises:
        ParameterError: There is no such segmenter, or its file is missing from `spec`.
    """
    name, _, argument = spec.partition(":")
    if name not in SEGMENTERS:
        expected = f"expected {', '.join(EXAMPLES.values())}{did_you_mean(name, SEGMENTERS)}"
        raise ParameterError(f"segmenter: {spec!r} is unknown; {expected}")
    if not argument and name not in WITHOUT_ARGUMENT:
        raise ParameterError(f"segmenter: {spec!r} names no file, expected {EXAMPLES[name]}")
    if min_score is not None:
        options["min_score"] = min_score
    return SEGMENTERS[name](argument, **options)

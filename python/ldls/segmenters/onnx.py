"""Segmenters that are ONNX files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls._optional import require
from ldls.checks import choice
from ldls.errors import FileFormatError, ParameterError, ShapeError, UnsupportedFormatError, within
from ldls.masks import InstanceMasks
from ldls.segmenters.classes import Classes, coco_classes, contiguous_coco_classes, named_classes
from ldls.segmenters.mask_rcnn import MaskRcnn, ZooMaskRcnn, detection_outputs, zoo_masks
from ldls.segmenters.onnx_file import OnnxFile, read_onnx
from ldls.segmenters.onnx_graph import Signature, image_input
from ldls.segmenters.segmenter import check_image, check_min_score
from ldls.segmenters.yolo import YoloSeg, segmentation_outputs

Names = Mapping[int, str]


class Family(Protocol):
    """Models whose inputs and outputs mean the same."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that `masks` takes, in its order."""
        ...

    @property
    def classes(self) -> Classes | None:
        """Its classes; None until an output tells their number."""
        ...

    def tensor(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(3, h, w) input for an image (H, W, 3), uint8 RGB."""
        ...

    def masks(self, outputs: list[NDArray[Any]], image_size: tuple[int, int], min_score: float) -> InstanceMasks:
        """Instances of at least `min_score` in an image of (height, width) pixels, from the network's outputs."""
        ...


@dataclass(frozen=True)
class Kind:
    """One row of `KINDS`: how to know a model of this kind, and its family."""

    fits: Callable[[Signature], bool]
    family: Callable[[Signature, Names | None], Family]


class OnnxSegmenter:
    """A Mask R-CNN or YOLO model in an ONNX file, run by onnxruntime.

    The file is looked through before it runs: see `ldls.segmenters.onnx_file`. What kind it is, its classes and the
    size of its input are read from its graph and metadata.

    Attributes:
        kind: Key of `KINDS`.
        min_score: Lowest score that is kept.
        names: Name of each category id that masks can have; None where only an output tells.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        min_score: float = 0.5,
        providers: Sequence[str] | None = None,
        kind: str | None = None,
        names: Mapping[int, str] | Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """The model at `path`.

        Args:
            path: An `.onnx` file.
            min_score: Lowest score that is kept, 0 to 1.
            providers: Execution providers of onnxruntime, the first that can run a part runs it; the CPU by default.
            kind: Key of `KINDS`, for a model that is taken for another.
            names: Name of each class, by its number or from 0 on; those of the file or COCO's without them.
            threads: Threads of onnxruntime; as many as cores without it.

        Raises:
            FileFormatError: The file is truncated, corrupt, of no known kind or cannot be run.
            UnsafePathError: Its weights lie outside its folder.
            LimitError: It is too large.
            ParameterError: A parameter outside its range, or missing names.
            ImportError: `ldls[onnx]` is not installed.
        """
        self.min_score = check_min_score(min_score)
        file = read_onnx(path)
        signature = Signature.of(str(file.path), file.model)
        named = names if names is None or isinstance(names, Mapping) else dict(enumerate(names))
        self._image = image_input(signature)
        self.kind = _kind(signature) if kind is None else choice("kind", kind, KINDS)
        self._family = KINDS[self.kind].family(signature, named)
        classes = self._family.classes
        self.names = None if classes is None else classes.names
        self._source = signature.source
        self._session = _session(file, providers, threads)

    def __call__(self, image: ArrayLike) -> InstanceMasks:
        """The instances of an image (H, W, 3), uint8 RGB.

        Raises:
            ShapeError: It is not (H, W, 3), or not of the one size that the model takes.
            DtypeError: It is not uint8.
            MaskError: The model gave NaN, a score outside 0 to 1 or an unknown class; the message names the file of the
                model and the instance.
            FileFormatError: The model fails, or its outputs are of other shapes than its kind has.
        """
        pixels = check_image(image)
        size = (pixels.shape[0], pixels.shape[1])
        outputs = self._run(self._feed(pixels))
        with within(self._source):
            return self._family.masks(outputs, size, self.min_score)

    def __repr__(self) -> str:
        return f"OnnxSegmenter({self._source!r}, kind={self.kind!r}, min_score={self.min_score})"

    def _feed(self, pixels: NDArray[np.uint8]) -> NDArray[Any]:
        tensor = self._family.tensor(pixels)
        shape = (3, *tensor.shape[1:])
        if self._image.rank == 4:
            tensor, shape = tensor[None], (1, *shape)
        if not self._image.may_be(*shape):
            raise ShapeError(
                f"image: {pixels.shape[0]} x {pixels.shape[1]} pixels make an input {shape}, the model takes "
                f"{self._image}; export it with sides that vary, or resize the image"
            )
        return tensor.astype(self._image.dtype, copy=False)

    def _run(self, tensor: NDArray[Any]) -> list[NDArray[Any]]:
        try:
            outputs: list[NDArray[Any]] = self._session.run(list(self._family.outputs), {self._image.name: tensor})
        except MemoryError:
            raise
        except Exception as error:  # onnxruntime's errors have nothing else in common
            raise FileFormatError(f"{self._source}: the model failed on an input {tensor.shape}: {error}") from error
        return outputs


def _mask_rcnn(signature: Signature, names: Names | None) -> Family:
    classes = coco_classes() if names is None else named_classes(names)
    return MaskRcnn(_detection_names(signature), classes)


def _zoo_mask_rcnn(signature: Signature, names: Names | None) -> Family:
    classes = contiguous_coco_classes(1) if names is None else named_classes(names)
    return ZooMaskRcnn(_detection_names(signature), classes)


def _detection_names(signature: Signature) -> tuple[str, ...]:
    names = detection_outputs(signature)
    if names is None:
        raise UnsupportedFormatError(
            f"{signature.source}: expected outputs boxes, labels, scores and masks, got {signature}"
        )
    return names


KINDS: dict[str, Kind] = {
    "mask-rcnn-zoo": Kind(zoo_masks, _zoo_mask_rcnn),
    "mask-rcnn": Kind(lambda signature: detection_outputs(signature) is not None, _mask_rcnn),
    "yolo": Kind(lambda signature: segmentation_outputs(signature) is not None, YoloSeg.of),
}
"""Kinds of models; the first that fits a graph reads it."""


def _kind(signature: Signature) -> str:
    fitting = (name for name, kind in KINDS.items() if kind.fits(signature))
    family = next(fitting, None)
    if family is None:
        raise UnsupportedFormatError(
            f"{signature.source}: no known kind of model ({', '.join(KINDS)}) has {signature}; "
            "docs/segmenters.md says how to export one"
        )
    return family


def _session(file: OnnxFile, providers: Sequence[str] | None, threads: int | None) -> Any:  # noqa: ANN401
    runtime = require("onnxruntime", "onnx")
    options = runtime.SessionOptions()
    options.log_severity_level = 3
    if threads is not None:
        if threads < 1:
            raise ParameterError(f"threads: got {threads}, expected at least 1")
        options.intra_op_num_threads = threads
    # the bytes that were looked through, unless onnxruntime must find weights beside the file
    source = str(file.path) if file.has_external_data else file.content
    try:
        return runtime.InferenceSession(source, options, providers=_providers(runtime, providers), enable_fallback=0)
    except (MemoryError, ParameterError):
        raise
    except Exception as error:  # onnxruntime's errors have nothing else in common
        raise UnsupportedFormatError(f"{file.path}: onnxruntime cannot run it: {error}") from error


def _providers(runtime: Any, providers: Sequence[str] | None) -> list[str]:  # noqa: ANN401
    chosen = ["CPUExecutionProvider"] if providers is None else list(providers)
    there = runtime.get_available_providers()
    missing = [name for name in chosen if name not in there]
    if missing:
        raise ParameterError(f"providers: {missing[0]!r} is not installed, expected some of {', '.join(there)}")
    return chosen

"""Mask models of torchvision, run by PyTorch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls._optional import require
from ldls.checks import choice
from ldls.masks import InstanceMasks
from ldls.segmenters.classes import coco_classes
from ldls.segmenters.crops import Crop, assemble
from ldls.segmenters.outputs import check_scores
from ldls.segmenters.segmenter import check_image, check_min_score

DEFAULT_MODEL = "maskrcnn_resnet50_fpn_v2"


class TorchvisionSegmenter:
    """A mask model of `torchvision.models.detection`; its labels are ids of COCO's 91-entry list.

    Attributes:
        name: Its name.
        model: The PyTorch module.
        device: Where it runs.
        min_score: Lowest score that is kept.
        names: Name of each category id that masks can have.
    """

    def __init__(
        self,
        name: str = DEFAULT_MODEL,
        *,
        weights: Any = "DEFAULT",  # noqa: ANN401
        device: str | None = None,
        min_score: float = 0.5,
    ) -> None:
        """The model called `name`.

        Args:
            name: As `torchvision.models` calls it.
            weights: As `torchvision.models.get_model` takes them; "DEFAULT" downloads the best at first use, None
                leaves them random.
            device: As PyTorch calls it; CUDA where there is one, otherwise the CPU.
            min_score: Lowest score that is kept, 0 to 1.

        Raises:
            ParameterError: There is no such mask model, or a score out of range.
            ImportError: `ldls[torch]` is not installed.
        """
        self.min_score = check_min_score(min_score)
        self.name = name
        self._classes = coco_classes()
        self.names = self._classes.names
        self._torch = require("torch", "torch")
        models = require("torchvision", "torch").models
        choice("name", name, mask_models())
        self.device = device or ("cuda" if self._torch.cuda.is_available() else "cpu")
        # without this, random weights would still fetch those of the backbone
        backbone = {"weights_backbone": None} if weights is None else {}
        self.model = models.get_model(name, weights=weights, **backbone).eval().to(self.device)

    def __call__(self, image: ArrayLike) -> InstanceMasks:
        """The instances of an image (H, W, 3), uint8 RGB.

        Raises:
            ShapeError: It is not (H, W, 3).
            DtypeError: It is not uint8.
            MaskError: A score is NaN; the message names the instance.
        """
        pixels = check_image(image)
        output = self._output(pixels)
        scores = check_scores(output["scores"].cpu().numpy())
        crops = (
            Crop(
                output["masks"][i, 0].ge(0.5).cpu().numpy(),
                0,
                0,
                self._classes.id(i, int(output["labels"][i])),
                float(scores[i]),
            )
            for i in np.flatnonzero(scores >= np.float32(self.min_score)).tolist()
        )
        return assemble(crops, (pixels.shape[0], pixels.shape[1]), self.names)

    def __repr__(self) -> str:
        return f"TorchvisionSegmenter({self.name!r}, device={self.device!r}, min_score={self.min_score})"

    def _output(self, pixels: NDArray[np.uint8]) -> dict[str, Any]:
        # a copy, as PyTorch warns of arrays that it may not write to
        tensor = self._torch.from_numpy(pixels.transpose(2, 0, 1).copy()).to(self.device)
        with self._torch.inference_mode():
            output: dict[str, Any] = self.model([tensor.float() / 255])[0]
        return output


def mask_models() -> list[str]:
    """Names of torchvision's models that give instance masks.

    Raises:
        ImportError: `ldls[torch]` is not installed.
    """
    models = require("torchvision", "torch").models
    return [name for name in models.list_models(module=models.detection) if name.startswith("mask")]

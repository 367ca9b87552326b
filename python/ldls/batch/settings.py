"""Settings of a run: all that labels depend on, for a run goes on only as it began, and the formats of its files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import ldls._ldls as _ldls
from ldls.datasets.stored_masks import fill
from ldls.errors import ParameterError
from ldls.label_diffusion import SAME_OBJECT
from ldls.params import Params
from ldls.viewing.formats import BAG, RESULT, check_formats


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Settings that hold for every frame of a run.

    Attributes:
        masks: Where stored masks lie: a folder, a path with {frame} and, for several cameras, {camera}, or one `.json`
            of all images.
        segmenter: What makes masks instead, as "onnx:model.onnx". Without either the source has masks itself.
        min_score: Lowest score of a mask that counts; the segmenter's own, or 0 of stored masks, without one.
        categories: Categories that count, by name or id; all without them.
        params: Parameters of the method; their number of threads does not matter to the result.
        formats: Files written for each frame, by the words of `ldls.viewing.formats`: npz, label, ply and so on, and
            png for the image with masks and points; bag for one labelled bag of all frames of a ROS bag, which is made
            of their npz, so that these are written too.
        same_object: See `ldls.segment`.

    Raises:
        ParameterError: Both `masks` and `segmenter` are given, or there is no format, or an unknown one.
    """

    masks: str | None = None
    segmenter: str | None = None
    min_score: float | None = None
    categories: tuple[int | str, ...] | None = None
    params: Params = field(default_factory=Params)
    formats: tuple[str, ...] = ("npz", "label")
    same_object: float = SAME_OBJECT

    def __post_init__(self) -> None:
        if self.masks is not None and self.segmenter is not None:
            raise ParameterError("masks, segmenter: give one of them, got both")
        check_formats(self.formats, of_run=True)

    @property
    def frame_formats(self) -> tuple[str, ...]:
        """The formats of each frame; those that the bag of the run is made of are among them."""
        needed = (RESULT,) if BAG in self.formats else ()
        return tuple(dict.fromkeys([*(word for word in self.formats if word != BAG), *needed]))

    def segmenter_file(self, frame: str, camera: str) -> Path | None:
        """The file that the segmenter of an image is made of, as a model or boxes; None where there is none."""
        path = Path(fill(self.segmenter or "", frame, camera).partition(":")[2])
        return path if path.is_file() else None

    def record(self) -> dict[str, Any]:
        """What labels depend on, as a journal stores it."""
        settings = asdict(self)
        # other files of the same labels may be added
        del settings["formats"]
        # the same bits for any number of threads
        del settings["params"]["threads"]
        if self.masks is not None:
            settings["masks"] = str(Path(self.masks).absolute())
        settings["version"] = _ldls.__version__
        recorded: dict[str, Any] = json.loads(json.dumps(settings))
        return recorded


def source_record(kind: str, path: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """A source as a journal stores it: its path and the options that it was opened with."""
    return {"kind": kind, "path": path, "options": {name: str(value) for name, value in sorted(options.items())}}

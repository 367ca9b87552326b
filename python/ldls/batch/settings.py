"""Settings of a run: all that labels depend on, for a run goes on only as it began, and the formats of its files."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import ldls._ldls as _ldls
from ldls.checks import as_python, checked, hold_python_values
from ldls.datasets.stored_masks import FRAME, fill
from ldls.errors import ParameterError
from ldls.label_diffusion import SAME_OBJECT
from ldls.params import Params
from ldls.segmenters.registry import OF_ONE_IMAGE, resolved, segmenter_file
from ldls.sequences.sweeps import SAME_OBJECT as SAME_OBJECT_OF_SWEEPS
from ldls.viewing.formats import BAG, RESULT, check_formats

MOST_SWEEPS = 100
"""More than memory has room for."""


@checked
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
        same_object: By default that of `ldls.segment`, or of `ldls.segment_sweeps` where sweeps are joined.
        sweeps: Sweeps before and after the middle one of a window, whose 2 `sweeps` + 1 frames in a row are labelled
            together; 0 for each frame alone.
        poses: File of poses in TUM's or KITTI's format, instead of those that the source has, if it has any; "kiss-icp"
            for those that the sweeps tell, which the folder of the run keeps in poses.txt.
        track: Number the objects over the drive when its frames are done, which is made of their npz, so that these
            are written too; those of `formats` that name instances are there with tracks besides; run_tracks.py.

    Raises:
        InputError: A setting is of another type; ParameterError of numbers, text and flags.
        ParameterError: Both `masks` and `segmenter` are given, there is no format, or an unknown one, or `sweeps` is
            out of its range.
    """

    masks: str | PathLike[str] | None = None
    segmenter: str | None = None
    min_score: float | None = None
    categories: tuple[int | str, ...] | None = None
    params: Params = field(default_factory=Params)
    formats: tuple[str, ...] = ("npz", "label")
    same_object: float | None = None
    sweeps: int = 0
    poses: str | PathLike[str] | None = None
    track: bool = False

    def __post_init__(self) -> None:
        hold_python_values(self)
        if self.categories is not None:
            object.__setattr__(self, "categories", tuple(map(as_python, self.categories)))
        if self.masks is not None and self.segmenter is not None:
            raise ParameterError("masks, segmenter: give one of them, got both")
        if not 0 <= self.sweeps <= MOST_SWEEPS:
            raise ParameterError(f"sweeps: got {self.sweeps}, expected 0 to {MOST_SWEEPS}; 2 is a good number")
        check_formats(self.formats, of_run=True)

    @property
    def frame_formats(self) -> tuple[str, ...]:
        """The formats of each frame; those that the bag of the run and the tracks are made of are among them."""
        needed = (RESULT,) if self.track or BAG in self.formats else ()
        return tuple(dict.fromkeys([*(word for word in self.formats if word != BAG), *needed]))

    @property
    def share_of_same(self) -> float:
        """Share of common points from which on instances of two images are one object."""
        usual = SAME_OBJECT_OF_SWEEPS if self.sweeps else SAME_OBJECT
        return usual if self.same_object is None else self.same_object

    def check_images(self, n_frames: int, n_cameras: int) -> None:
        """Refuse a format of one camera, and a file of one image, where there are several that would all get its masks.

        Args:
            n_frames: Number of frames that are to be done.
            n_cameras: Number of images of each.

        Raises:
            ParameterError: The place of masks or boxes does not tell frames or cameras apart, or a format cannot.
        """
        if "kitti-boxes" in self.formats and n_cameras > 1:
            raise ParameterError(
                f"formats: kitti-boxes are of one camera, the source has {n_cameras}; leave them out, and give "
                "objects=, a .csv or .json file for a table of all objects"
            )
        name, place = "masks", None if self.masks is None else fspath(self.masks)
        if self.segmenter is not None and self.segmenter.partition(":")[0] in OF_ONE_IMAGE:
            name, place = "segmenter", self.segmenter
        # what of masks has no {frame} is a folder, or a file of all images
        elif place is None or FRAME not in place:
            return
        for word, count in (("frame", n_frames), ("camera", n_cameras)):
            if count > 1 and f"{{{word}}}" not in place:
                raise ParameterError(
                    f"{name}: {place} is the file of one image, there are {count:,} {word}s, which would all get its "
                    f"masks; put {{{word}}} into the path, where the name of the {word} stands"
                )

    def segmenter_file(self, frame: str, camera: str) -> Path | None:
        """The file that the segmenter of an image is made of, as a model or boxes; None where there is none."""
        return segmenter_file(fill(self.segmenter or "", frame, camera))

    def record(self) -> dict[str, Any]:
        """What labels depend on, as a journal stores it."""
        settings = asdict(self)
        # other files of the same labels may be added
        del settings["formats"], settings["track"]
        # the same bits for any number of threads
        del settings["params"]["threads"]
        settings["same_object"] = self.share_of_same
        for name, path in (("masks", self.masks), ("poses", self.poses)):
            settings[name] = None if path is None else str(Path(path).resolve())
        settings["segmenter"] = None if self.segmenter is None else resolved(self.segmenter)
        settings["version"] = _ldls.__version__
        recorded: dict[str, Any] = json.loads(json.dumps(settings))
        return recorded

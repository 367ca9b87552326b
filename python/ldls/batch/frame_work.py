"""The work on one frame, the same for every engine: read, get masks, segment, write."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any

from ldls.batch.journal import KeptRecords, Record
from ldls.batch.settings import RunSettings
from ldls.datasets import CameraImage, Frame, Source
from ldls.datasets.stored_masks import StoredMasks, fill, own_masks
from ldls.errors import BatchError, InputError, ParameterError
from ldls.io import read_result
from ldls.io.files import digest_of
from ldls.io.objects import FrameObjects
from ldls.label_diffusion import LabelDiffusion, nothing_in_view
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation
from ldls.segmenters import Segmenter, open_segmenter
from ldls.view import View
from ldls.viewing.formats import PICTURE, RESULT, file_name, file_names, write_formats

LARGEST_DIGESTED_BYTES = 1 << 26
"""Larger inputs hold many frames, as bags do, and are known by size and time of change alone."""
DIGESTS_KEPT = 256
"""More than the frames on their way have files, so that what many share, as a model, is read once."""


class Earlier(Enum):
    """What an earlier run left of a frame: nothing or part of it, all of it, or files that were changed since."""

    OPEN = "open"
    DONE = "done"
    CHANGED = "changed"


@dataclass(frozen=True)
class Outcome:
    """A frame that is finished, well or not.

    Attributes:
        record: Its line of the journal (journal.py).
        seconds: Time that each stage took.
    """

    record: Mapping[str, Any]
    seconds: Mapping[str, float] = field(default_factory=dict)


class StageError(Exception):
    """An error of one frame, and the stage at which it happened."""

    def __init__(self, stage: str, error: Exception) -> None:
        """The `error` of `stage`."""
        super().__init__(str(error))
        self.stage = stage
        self.error = error


@dataclass(eq=False)
class Work:
    """A frame on its way through the stages.

    Attributes:
        index: Its number in the source.
        name: Its name.
        frame: What was read.
        images: The images of the frame, for its picture.
        masks: Stored masks of each image.
        inputs: Size, time of change and digest of the files that it is made of, by path; None for one that is not
            there, and for the digest of one that is not read.
        earlier: What the journal says of it, if an earlier run did it.
        kept: Its files of earlier runs that need not be written again, with size and digest.
        result: What came of it.
        record: Its line for the journal.
        seconds: Time that each stage took.
    """

    index: int
    name: str
    frame: Frame | None = None
    images: tuple[CameraImage, ...] = ()
    masks: tuple[InstanceMasks, ...] | None = None
    inputs: dict[str, list[int | str | None] | None] = field(default_factory=dict)
    earlier: Record | None = None
    kept: Mapping[str, list[int | str]] = field(default_factory=dict)
    result: Segmentation | None = None
    record: Mapping[str, Any] | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def outcome(self) -> Outcome:
        """Return the outcome of a frame with all stages done."""
        assert self.record is not None
        return Outcome(self.record, self.seconds)

    def failed(self, error: StageError) -> Outcome:
        """Return the outcome of a frame with a failed stage."""
        cause = error.error
        record = {
            "stage": error.stage,
            "code": getattr(cause, "code", type(cause).__name__),
            "message": str(cause) or type(cause).__name__,
        }
        return Outcome({"frame": self.name, "error": record}, self.seconds)


class FrameWork:
    """Does the stages of frames; several threads may do so at a time."""

    def __init__(self, source: Source, settings: RunSettings, out: Path, earlier: KeptRecords | None = None) -> None:
        """Prepare for the frames of `source`: the segmenter is opened here, limited to one thread.

        Args:
            source: The frames.
            settings: How they are treated.
            out: Folder of the results.
            earlier: What the journal says of frames of which an earlier run did a part.

        Raises:
            LdlsError: The segmenter, or the place of the masks, cannot be used.
            ParameterError: Neither is given, and the source has no masks itself.
        """
        self._source = source
        self._settings = settings
        self.out = out
        self.records = earlier
        self._diffusion = LabelDiffusion(params=replace(settings.params, threads=1))
        self._own_masks = own_masks(source)
        if settings.masks is None and settings.segmenter is None and not self._own_masks:
            raise ParameterError(
                f"masks, segmenter: give one of them, got neither, and {source.path} names no masks of its own"
            )
        self._stored = None if settings.masks is None else StoredMasks(settings.masks)
        if self._stored is not None:
            self._stored.check_names(source)
        self._segmenter = None if settings.segmenter is None else _segmenters(settings.segmenter, settings.min_score)
        self._reads_images = self._segmenter is not None or PICTURE in settings.frame_formats
        self._digest = lru_cache(DIGESTS_KEPT)(_digest)

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process all is opened anew."""
        return FrameWork, (self._source, self._settings, self.out, self.records)

    @property
    def masks_sha256(self) -> str | None:
        """Digest of the one file that has the masks of all frames, for the journal; None without one."""
        data_set = None if self._stored is None else self._stored.data_set
        return None if data_set is None else data_set.sha256

    def read(self, work: Work) -> None:
        """Read points and stored masks, or the result that an earlier run wrote of them.

        Files are looked at before they are read, so that no change is missed.
        """
        with _stage(work, "read"):
            self._read_earlier(work)
            if work.result is not None and PICTURE not in self._missing(work):
                return
            seen = {path: _look(path) for path in self._source.files(work.index)}
            work.frame = self._source[work.index]
            unread = set() if self._reads_images else {image.path for image in work.frame.images}
            for path, look in seen.items():
                work.inputs[str(path.absolute())] = self._state(path, look, read=path not in unread)
        if work.result is not None:
            work.images = tuple(_image_of(seen.view, work.frame) for seen in work.result.views)
        elif self._segmenter is None:
            with _stage(work, "masks"):
                masks = self._of_source(work) if self._stored is None else self._of_files(work, self._stored)
                work.masks = tuple(map(self._wanted, masks))

    def segment(self, work: Work) -> None:
        """Make masks, unless they are stored, and label the points, unless they are labelled."""
        if work.result is not None:
            return
        frame = work.frame
        assert frame is not None
        if work.masks is None:
            with _stage(work, "masks"):
                work.masks = tuple(self._make(work, image) for image in frame.images)
        with _stage(work, "segment"):
            pairs = zip(work.masks, frame.images, strict=True)
            views = [View(masks, image.camera, image.name) for masks, image in pairs]
            work.result = self._diffusion.segment(frame.points, views, same_object=self._settings.same_object)
        work.images = frame.images
        work.frame = work.masks = None

    def write(self, work: Work) -> None:
        """Write the files of the frame, and what the journal says of it."""
        result = work.result
        assert result is not None
        with _stage(work, "write"):
            # times differ from run to run; files must not
            quiet = replace(result, timings={})
            missing = self._missing(work)
            images = [image.read() for image in work.images] if PICTURE in missing else []
            paths = write_formats(quiet, self.out, work.name, missing, images)
            written = {path.name: [path.stat().st_size, digest_of(path)] for path in paths}
            objects = FrameObjects.of(work.name, quiet)
            work.record = {
                "frame": work.name,
                "files": {**work.kept, **written},
                "inputs": _known(work),
                "images": [list(image) for image in objects.images],
                "objects": objects.rows,
                "nothing_in_view": nothing_in_view(result),
            }
        work.frame = work.result = None

    def do(self, work: Work, before_writing: Callable[[], None] = lambda: None) -> Outcome:
        """All stages of a frame, one after the other."""
        try:
            self.read(work)
            self.segment(work)
            before_writing()
            self.write(work)
        except StageError as error:
            return work.failed(error)
        return work.outcome()

    def earlier(self, record: Mapping[str, Any] | None) -> Earlier:
        """Return what an earlier run left of a frame, by its `record` and the files that are there.

        Raises:
            BatchError: Its input was changed since.
        """
        if record is None or "error" in record:
            return Earlier.OPEN
        for path, state in record["inputs"].items():
            if not self._is_same(Path(path), state):
                raise BatchError(
                    f"{self.out}: {path}, of which frame {record['frame']} was made, was changed since; choose another "
                    "folder"
                )
        files = record["files"]
        names = [file_name(record["frame"], word) for word in self._settings.frame_formats]
        # what a killed run wrote and could not record is written again
        there = [name for name in names if name in files and (self.out / name).is_file()]
        is_foreign = bool(files.keys() - file_names(record["frame"]))
        if is_foreign or any(not _is_written(self.out / name, files[name]) for name in there):
            return Earlier.CHANGED
        return Earlier.DONE if there == names else Earlier.OPEN

    def _read_earlier(self, work: Work) -> None:
        """Find what need not be done again, and the result that an earlier run stored."""
        record = None if self.records is None else self.records.get(work.name)
        if record is None or "error" in record:
            return
        work.earlier = record
        own = file_names(work.name)
        asked = {file_name(work.name, word) for word in self._settings.frame_formats}
        work.kept = {
            name: state
            for name, state in record["files"].items()
            if name in own and (name not in asked or _is_written(self.out / name, state))
        }
        stored = file_name(work.name, RESULT)
        if stored in work.kept and _is_written(self.out / stored, work.kept[stored]):
            work.result = read_result(self.out / stored)

    def _missing(self, work: Work) -> list[str]:
        """The formats that are to be written of a frame."""
        return [word for word in self._settings.frame_formats if file_name(work.name, word) not in work.kept]

    def _of_files(self, work: Work, stored: StoredMasks) -> tuple[InstanceMasks, ...]:
        assert work.frame is not None
        for path in stored.files(work.name, (image.name for image in work.frame.images)):
            work.inputs[str(path.absolute())] = self._state(path, _look(path))
        return stored.read(work.frame)

    def _of_source(self, work: Work) -> tuple[InstanceMasks, ...]:
        """The masks that the source has itself; cameras for which it names none are left out."""
        assert work.frame is not None
        work.frame = replace(work.frame, images=tuple(i for i in work.frame.images if i.name in self._own_masks))
        for image in work.frame.images:
            if image.masks is None:
                raise InputError(f"camera {image.name}: no masks at {self._own_masks[image.name]!r} of the source")
        return tuple(image.masks for image in work.frame.images if image.masks is not None)

    def _state(self, path: Path, look: Look, *, read: bool = True) -> list[int | str | None] | None:
        """Size, time of change and digest of a file that was seen so, for the journal."""
        if look is None:
            return None
        known = read and look[0] <= LARGEST_DIGESTED_BYTES
        return [*look, self._digest(path, look) if known else None]

    def _is_same(self, path: Path, state: list[int | str | None] | None) -> bool:
        look = _look(path)
        if look is None or state is None:
            return look is None and state is None
        return [*look] == state[:2] and (state[2] is None or self._digest(path, look) == state[2])

    def _wanted(self, masks: InstanceMasks) -> InstanceMasks:
        return masks.filter(min_score=self._settings.min_score or 0.0, categories=self._settings.categories)

    def _make(self, work: Work, image: CameraImage) -> InstanceMasks:
        assert self._segmenter is not None
        path = self._settings.segmenter_file(work.name, image.name)
        if path is not None:
            work.inputs[str(path.absolute())] = self._state(path, _look(path))
        return self._wanted(self._segmenter(work.name, image)(image.read()))


def _segmenters(spec: str, min_score: float | None) -> Callable[[str, CameraImage], Segmenter]:
    """Return a function that gives the segmenter of an image: one for all, or one each where files name frames."""
    if "{frame}" in spec or "{camera}" in spec:
        return lambda frame, image: open_segmenter(fill(spec, frame, image.name), min_score=min_score)
    # every worker runs it, each on a core of its own
    options = {"threads": 1} if spec.startswith("onnx:") else {}
    opened = open_segmenter(spec, min_score=min_score, **options)
    return lambda frame, image: opened


Look = tuple[int, int] | None
"""Size and time of change of a file; None where there is none."""


def _look(path: Path) -> Look:
    try:
        found = path.stat()
    except (FileNotFoundError, ValueError):  # a name with a NUL, for one
        return None
    return found.st_size, found.st_mtime_ns


def _digest(path: Path, look: Look) -> str:
    """Digest of a file; `look` tells two states of it apart."""
    return digest_of(path)


def _is_written(path: Path, written: list[int | str]) -> bool:
    return path.is_file() and path.stat().st_size == written[0] and digest_of(path) == written[1]


def _known(work: Work) -> dict[str, list[int | str | None] | None]:
    """The inputs of a frame; those whose digest an earlier run knew and this one did not need keep it."""
    before = {} if work.earlier is None else work.earlier["inputs"]
    unread = [path for path, state in work.inputs.items() if state is not None and state[2] is None]
    return {**before, **work.inputs, **{path: before[path] for path in unread if path in before}}


def _image_of(view: View, frame: Frame) -> CameraImage:
    """The image of a frame that a view is of."""
    return next(image for image in frame.images if image.name == view.name)


@contextmanager
def _stage(work: Work, stage: str) -> Iterator[None]:
    start = time.perf_counter()
    try:
        yield
    except Exception as error:
        if isinstance(error, MemoryError | ImportError):
            # no frame is at fault if memory or an extra is missing
            raise
        if stage == "write" and isinstance(error, OSError):
            # a full disk is no fault of the frame
            hint = f"{error.strerror or error} while writing frame {work.name}; mend it and give the same command again"
            raise OSError(error.errno, hint, error.filename) from error
        raise StageError(stage, error) from error
    finally:
        work.seconds[stage] = work.seconds.get(stage, 0.0) + time.perf_counter() - start

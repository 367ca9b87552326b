"""The work on the frames of a window, the same for every engine: read, get masks, segment, write."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from os import fspath
from pathlib import Path
from typing import Any

from ldls.batch.journal import KeptRecords
from ldls.batch.known_files import KnownFiles, State, is_written, look, written
from ldls.batch.poses import Poses
from ldls.batch.settings import RunSettings
from ldls.batch.window import Outcome, StageError, Window, Work, stage
from ldls.categories import find_categories
from ldls.datasets import CameraImage, Frame, Source
from ldls.datasets.stored_masks import FRAME, StoredMasks, fill, own_category_names, own_masks
from ldls.doubts import nothing_in_view
from ldls.errors import BatchError, InputError, ParameterError
from ldls.io import read_result
from ldls.io.files import folder_hint
from ldls.io.objects import FrameObjects
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation
from ldls.segmenters import Segmenter, open_segmenter
from ldls.segmenters.registry import OF_ONE_IMAGE
from ldls.sequences import LabelDiffusion, Sweep, segment_sweeps
from ldls.view import View
from ldls.viewing.formats import ENDINGS, PICTURE, RESULT, file_name, file_names, write_formats


class Earlier(Enum):
    """What an earlier run left of a frame: nothing or part of it, all of it, or files that were changed since."""

    OPEN = "open"
    DONE = "done"
    CHANGED = "changed"


class FrameWork:
    """Does the stages of windows, which are single frames where no sweeps are joined; several threads at a time may."""

    def __init__(self, source: Source, settings: RunSettings, out: Path, records: KeptRecords | None = None) -> None:
        """Prepare for the frames of `source`: the segmenter is opened here, limited to one thread.

        Args:
            source: The frames.
            settings: How they are treated.
            out: Folder of the results.
            records: What the journal says of frames of which an earlier run did a part.

        Raises:
            LdlsError: The segmenter, the place of the masks, or the file of poses cannot be used.
            ParameterError: Neither masks nor a segmenter are given, and the source has no masks itself; or there is no
                such category, as far as this is known before masks are made or read.
        """
        self._source = source
        self._settings = settings
        self.out = out
        self.records = records
        self._params = replace(settings.params, threads=1)
        self._diffusion = LabelDiffusion(params=self._params)
        self._own_masks = own_masks(source)
        if settings.masks is None and settings.segmenter is None and not self._own_masks:
            raise ParameterError(
                f"masks, segmenter: give one of them, got neither, and {source.path} names no masks of its own"
                + folder_hint(source.path, "masks", option="masks=")
            )
        self._stored = None if settings.masks is None else StoredMasks(fspath(settings.masks))
        if self._stored is not None:
            self._stored.check_names(source)
        self._segmenter: Callable[[str, CameraImage], Segmenter] | None = None
        tables = own_category_names(source)
        if self._stored is not None:
            tables = () if self._stored.data_set is None else (self._stored.data_set.category_names,)
        elif settings.segmenter is not None:
            self._segmenter, tables = _segmenters(settings.segmenter, settings.min_score)
        for names in filter(None, tables):
            find_categories(settings.categories or (), names)
        self._poses = Poses(source, settings)
        self._reads_images = self._segmenter is not None or PICTURE in settings.frame_formats
        self._known_files = KnownFiles()

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process all is opened anew."""
        return FrameWork, (self._source, self._settings, self.out, self.records)

    @property
    def digests(self) -> dict[str, str | None]:
        """Digests of the files that all frames share, for the journal: of all masks, and of poses; None without one."""
        data_set = None if self._stored is None else self._stored.data_set
        return {"masks_sha256": None if data_set is None else data_set.sha256, "poses_sha256": self._poses.sha256}

    def read(self, window: Window) -> None:
        """Read points and stored masks, or the results that an earlier run wrote of them.

        Files are looked at before they are read, so that no change is missed.
        """
        together = [work.name for work in window.works]
        for work in window.works:
            work.earlier = self._done_earlier(work.name)
        if all(work.earlier is not None and work.earlier["window"] == together for work in window.works):
            window.each(self._read_result)
            if any(work.result is None for work in window.works):
                # labels are made of all frames or of none
                for work in window.works:
                    work.result = work.kept = None
        window.each(self._read)

    def segment(self, window: Window) -> None:
        """Make masks, unless they are stored, and label the points, unless they are labelled."""
        works = [work for work in window.sound if work.result is None]
        window.each(self._prepare)
        works = [work for work in works if work.error is None]
        if not works:
            return
        try:
            with stage(works[0], "segment"):
                results = self._label(works)
        except StageError as error:
            # nobody knows which of them it is
            for work in works:
                work.error = error
            return
        together = [work.name for work in works]
        for work, result in zip(works, results, strict=True):
            work.result, work.together = result, together
            work.frame, work.masks, work.views, work.sweep = None, None, (), None

    def write(self, window: Window) -> None:
        """Write the files of the frames, and what the journal says of them."""
        window.each(self._write)

    def judge_earlier(self, record: Mapping[str, Any] | None, together: Sequence[str]) -> Earlier:
        """What an earlier run left of a frame, by its `record` and the files that are there.

        Args:
            record: Its line of the journal.
            together: Names of the frames that it is to be labelled together with, and its own.

        Raises:
            BatchError: Its input was changed since.
        """
        if record is None or "error" in record:
            return Earlier.OPEN
        for path, state in record["inputs"].items():
            if not self._known_files.is_same(Path(path), state):
                raise BatchError(
                    f"{self.out}: {path}, of which frame {record['frame']} was made, was changed since; choose another "
                    "folder"
                )
        if record["window"] != together:
            return Earlier.OPEN
        files = record["files"]
        names = [file_name(record["frame"], word) for word in self._settings.frame_formats]
        # what a killed run wrote and could not record is written again
        there = [name for name in names if name in files and (self.out / name).is_file()]
        is_foreign = bool(files.keys() - file_names(record["frame"]))
        if is_foreign or any(not is_written(self.out / name, files[name]) for name in there):
            return Earlier.CHANGED
        return Earlier.DONE if there == names else Earlier.OPEN

    def has_other_labels(self, outcome: Outcome) -> bool:
        """True if frames that an earlier run labelled were labelled together with others now, or failed."""
        pairs = [(self._done_earlier(record["frame"]), record) for record in outcome.records]
        return any(before is not None and before["window"] != now.get("window") for before, now in pairs)

    def _done_earlier(self, frame: str) -> Mapping[str, Any] | None:
        record = None if self.records is None else self.records.get(frame)
        return None if record is None or "error" in record else record

    def _keep(self, work: Work) -> Mapping[str, list[int | str]]:
        """The files that need not be written again: those of the same labels, which the same frames together have."""
        record, words = work.earlier, self._settings.frame_formats
        kept = {}
        if record is not None and record["window"] == work.together:
            own, asked = file_names(work.name), {file_name(work.name, word) for word in words}
            kept = {
                name: state
                for name, state in record["files"].items()
                if name in own and (name not in asked or is_written(self.out / name, state))
            }
        elif record is not None:
            # nothing of the labels that are no longer true stays
            old = (word for word in ENDINGS if file_name(work.name, word) in record["files"])
            words = tuple(dict.fromkeys([*words, *old]))
        work.kept, work.missing = kept, [word for word in words if file_name(work.name, word) not in kept]
        return kept

    def _read_result(self, work: Work) -> None:
        """Read the result that an earlier run stored, if it is there, and find what is to be written of it."""
        assert work.earlier is not None
        with stage(work, "read"):
            work.together = work.earlier["window"]
            kept, stored = self._keep(work), file_name(work.name, RESULT)
            if stored in kept and is_written(self.out / stored, kept[stored]):
                work.result = read_result(self.out / stored)
                work.stamp, work.pose = work.earlier["stamp"], work.earlier["pose"]

    def _read(self, work: Work) -> None:
        with stage(work, "read"):
            if work.result is not None and PICTURE not in work.missing:
                return
            seen = {path: look(path) for path in self._source.files(work.index)}
            work.frame = self._source[work.index]
            work.stamp, work.pose = self._poses.stamps[work.index], self._poses.of(work.index, work.frame)
            work.frame = self._poses.deskewed(work.frame)
            unread = set() if self._reads_images else {image.path for image in work.frame.images}
            for path, known in seen.items():
                work.inputs[str(path.absolute())] = self._known_files.state(path, known, read=path not in unread)
        if work.result is not None:
            work.images = tuple(_image_of(seen.view, work.frame) for seen in work.result.views)
        elif self._segmenter is None:
            with stage(work, "masks"):
                masks = self._of_source(work) if self._stored is None else self._of_files(work, self._stored)
                work.masks = tuple(map(self._wanted, masks))

    def _prepare(self, work: Work) -> None:
        """Make masks, if there are none, and of them what is labelled."""
        if work.result is not None:
            return
        assert work.frame is not None
        work.images = work.frame.images
        if work.masks is None:
            with stage(work, "masks"):
                work.masks = tuple(self._make(work, image) for image in work.images)
        with stage(work, "segment"):
            pairs = zip(work.masks, work.images, strict=True)
            work.views = tuple(View(masks, image.camera, image.name) for masks, image in pairs)
            if self._settings.sweeps:
                assert work.pose is not None and work.stamp is not None
                work.sweep = Sweep(work.frame.points, work.views, work.pose, work.stamp)

    def _label(self, works: Sequence[Work]) -> Sequence[Segmentation]:
        """The results of frames that are labelled together."""
        share = self._settings.share_of_same
        if self._settings.sweeps:
            sweeps = [work.sweep for work in works if work.sweep is not None]
            return segment_sweeps(sweeps, params=self._params, same_object=share)
        (work,) = works
        assert work.frame is not None
        return [self._diffusion.segment(work.frame.points, work.views, same_object=share)]

    def _write(self, work: Work) -> None:
        result = work.result
        assert result is not None
        with stage(work, "write"):
            kept = self._keep(work) if work.kept is None else work.kept
            # times differ from run to run; files must not
            quiet = replace(result, timings={})
            images = [image.read() for image in work.images] if PICTURE in work.missing else []
            paths = write_formats(quiet, self.out, work.name, work.missing, images)
            objects = FrameObjects.of(work.name, quiet)
            work.record = {
                "frame": work.name,
                "files": {**kept, **{path.name: written(path) for path in paths}},
                "inputs": _inputs(work),
                "window": list(work.together),
                "stamp": work.stamp,
                "pose": None if work.pose is None else [[float(value) for value in row] for row in work.pose],
                "images": [list(image) for image in objects.images],
                "objects": objects.rows,
                "nothing_in_view": nothing_in_view(result),
            }
        work.frame = work.result = None

    def _of_files(self, work: Work, stored: StoredMasks) -> tuple[InstanceMasks, ...]:
        assert work.frame is not None
        for path in stored.files(work.name, (image.name for image in work.frame.images)):
            work.inputs[str(path.absolute())] = self._known_files.state(path, look(path))
        return stored.read(work.frame)

    def _of_source(self, work: Work) -> tuple[InstanceMasks, ...]:
        """The masks that the source has itself; cameras for which it names none are left out."""
        assert work.frame is not None
        work.frame = replace(work.frame, images=tuple(i for i in work.frame.images if i.name in self._own_masks))
        for image in work.frame.images:
            if image.masks is None:
                raise InputError(f"camera {image.name}: no masks at {self._own_masks[image.name]!r} of the source")
        return tuple(image.masks for image in work.frame.images if image.masks is not None)

    def _wanted(self, masks: InstanceMasks) -> InstanceMasks:
        return masks.filter(min_score=self._settings.min_score or 0.0, categories=self._settings.categories)

    def _make(self, work: Work, image: CameraImage) -> InstanceMasks:
        assert self._segmenter is not None
        path = self._settings.segmenter_file(work.name, image.name)
        if path is not None:
            work.inputs[str(path.absolute())] = self._known_files.state(path, look(path))
        return self._wanted(self._segmenter(work.name, image)(image.read()))


def _segmenters(
    spec: str, min_score: float | None
) -> tuple[Callable[[str, CameraImage], Segmenter], tuple[Mapping[int, str], ...]]:
    """Return a function that gives the segmenter of an image, and the names of category ids, as far as they are known.

    There is one segmenter for all images, or one each where files name frames.
    """
    if FRAME in spec or "{camera}" in spec:
        names = OF_ONE_IMAGE.get(spec.partition(":")[0], {})
        return lambda frame, image: _of_one_image(fill(spec, frame, image.name), min_score), (names,)
    # every worker runs it, each on a core of its own
    options = {"threads": 1} if spec.startswith("onnx:") else {}
    opened = open_segmenter(spec, min_score=min_score, **options)
    # segmenters of others may have no such attribute
    return lambda frame, image: opened, (getattr(opened, "names", None) or {},)


def _of_one_image(spec: str, min_score: float | None) -> Segmenter:
    try:
        return open_segmenter(spec, min_score=min_score)
    except FileNotFoundError as error:
        if spec.partition(":")[0] not in OF_ONE_IMAGE:
            raise
        raise InputError(
            f"segmenter: there is no {error.filename}; make it, empty where the image shows no object, or leave the "
            "frame out"
        ) from None


def _inputs(work: Work) -> dict[str, State]:
    """The inputs of a frame; those whose digest an earlier run knew and this one did not need keep it."""
    before = {} if work.earlier is None else work.earlier["inputs"]
    unread = [path for path, state in work.inputs.items() if state is not None and state[2] is None]
    return {**before, **work.inputs, **{path: before[path] for path in unread if path in before}}


def _image_of(view: View, frame: Frame) -> CameraImage:
    """The image of a frame that a view is of."""
    return next(image for image in frame.images if image.name == view.name)

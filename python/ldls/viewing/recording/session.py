"""A recording from its first frame to its last, into a file, into a viewer or into a stream of one's own."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.checks.values import as_seconds
from ldls.datasets import Frame
from ldls.errors import ParameterError
from ldls.io.files import whole_file
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation
from ldls.view import camera_names
from ldls.viewing.recording import viewer
from ldls.viewing.recording.blueprint import Contents, eye_behind, layout
from ldls.viewing.recording.contexts import Names
from ldls.viewing.recording.diffusion import EVERY, TIMELINE, log_diffusion
from ldls.viewing.recording.entities import log_frame, log_result
from ldls.viewing.recording.stream import Contexts, Entity, Stream, rerun

VIEWER = "spawn"
"""The target that is a viewer instead of a file."""
SUFFIX = ".rrd"
FIRST_DATE_S = 1e8
"""Stamps from here on, March 1973, are dates; those before count from the start of a drive."""


@contextmanager
def open_recording(target: str | PathLike[str], *, name: str = "") -> Iterator[Recording]:
    """A recording to add frames to; when the block ends, its file is there whole, and if it fails there is none.

    Until then it is kept in memory, compressed: some 2.5 MB a frame of 120,000 points and one image.

    Args:
        target: A file, which must end in .rrd, or "spawn" for a viewer that is started, or is open already.
        name: Name of the recording in the viewer.

    Raises:
        ParameterError: The target is neither.
        ImportError: The extra `viz` is not installed.
        ConnectionError: There is no display for a viewer and none is open, or it does not answer.
        OSError: The file cannot be written.
    """
    check_target(target)
    stream = rerun().RecordingStream("ldls")
    # when a frame was logged is of no interest, and would offer itself as a timeline
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    try:
        if name:
            stream.send_recording_name(name)
        if target == VIEWER:
            viewer.connect(stream)
            yield Recording(stream, contexts="timed")
            viewer.flush(stream)
        else:
            # Rerun's own writer waits for ever once a disk is full
            encoded = stream.binary_stream()
            try:
                with whole_file(target) as file:
                    recording = Recording(stream, contexts="held")
                    yield recording
                    recording.log_held_contexts()
                    file.write(encoded.read())
            finally:
                # of what is left of a recording that failed, Rerun would warn
                encoded.read()
    finally:
        stream.disconnect()


def check_target(target: str | PathLike[str]) -> None:
    """Refuse a target that cannot be recorded to.

    Raises:
        ParameterError: It is neither a file that ends in .rrd nor "spawn".
        ImportError: The extra `viz` is not installed.
    """
    if target != VIEWER and Path(target).suffix != SUFFIX:
        raise ParameterError(f"rerun: got {str(target)!r}, expected {VIEWER} or a file that ends in {SUFFIX}")
    rerun()


class Recording:
    """Results and frames in a stream of Rerun, and the names that numbers have in it.

    `add` and `add_frame` add frames one after the other below "world", and lay the viewer out. The others log at the
    time that is set, below an entity of choice; parts of an earlier result that a later one lacks, as a truth, stay
    there until `rerun.Clear` takes them away.

    Attributes:
        stream: The `rerun.RecordingStream`, to log more to.
        n_frames: Frames added.
    """

    def __init__(self, stream: Any = None, *, contexts: Contexts = "static") -> None:  # noqa: ANN401
        """A recording in a stream of one's own.

        Args:
            stream: A `rerun.RecordingStream`; the active one by default.
            contexts: When annotation contexts are logged: "static" for all times, as the viewer wants them of a file;
                "timed" for the time that is set, as it wants them of a stream that it receives; "held" back for
                `log_held_contexts`.

        Raises:
            InputError: No recording is active.
            ParameterError: There is no such way to log contexts.
            ImportError: The extra `viz` is not installed.
        """
        self._stream = Stream(stream, contexts)
        self.stream = self._stream.rerun
        self.n_frames = 0
        self._names: defaultdict[str, Names] = defaultdict(Names)
        self._contents: Contents | None = None
        self._entities: set[Entity] = set()
        self._dated: bool | None = None

    def add(
        self,
        result: Segmentation,
        *,
        images: Mapping[str, NDArray[np.uint8]] | None = None,
        truth: Labeling | None = None,
        name: str = "",
        stamp: float | None = None,
        diffusion: int | None = None,
        alone: bool = False,
    ) -> None:
        """Add a segmentation as the next frame.

        Args:
            result: The segmentation.
            images: See `log_result`.
            truth: True labels of the points.
            name: Name of the frame.
            stamp: Its time in seconds, for the timeline "time".
            diffusion: Record the likelihoods after every so many products as well; see `log_diffusion`.
            alone: True for the only frame: "iteration" is then the timeline that shows first, and all is on it.

        Raises:
            ParameterError: The stamp is not in seconds.
            LdlsError: See `log_result` and `log_diffusion`.
        """
        contents = Contents(
            cameras=camera_names(result.views),
            truth=truth is not None,
            diffusion=diffusion is not None,
            timeline=TIMELINE if alone and diffusion is not None else "frame",
            eye=eye_behind([seen.view.camera for seen in result.views]),
        )
        self._begin(contents, images or (), stamp)
        if contents.timeline == TIMELINE:
            self.stream.set_time(TIMELINE, sequence=0)
        self.log_result(result, images=images, truth=truth, name=name)
        self._show(contents)
        if diffusion is not None:
            self.log_diffusion(result, every=diffusion)

    def add_frame(self, frame: Frame) -> None:
        """Add a frame without masks as the next one; its stamp is that of the timeline "time".

        Raises:
            LdlsError: See `log_frame`.
        """
        contents = Contents(
            cameras=tuple(image.name for image in frame.images),
            labelled=False,
            truth=frame.truth is not None,
            eye=eye_behind([image.camera for image in frame.images]),
        )
        self._begin(contents, contents.cameras, frame.stamp)
        self.log_frame(frame)
        self._show(contents)

    def log_result(
        self,
        result: Segmentation,
        *,
        images: Mapping[str, NDArray[np.uint8]] | None = None,
        truth: Labeling | None = None,
        name: str = "",
        entity: str = "world",
    ) -> None:
        """Log a segmentation at the time that is set; the module's docstring says which entities it makes.

        Args:
            result: The segmentation.
            images: (H, W, 3) uint8 RGB images by the names of the views; those without one are "camera 0" and so on.
            truth: True labels of the points.
            name: Title of the table of objects.
            entity: Where all goes.

        Raises:
            InputError: An image has no camera or another size than its masks, or not every point has a true label.
            LimitError: A category id is greater than Rerun's ids.
        """
        root = Entity(entity, self._stream)
        log_result(root, self._names[entity], result, images=images or {}, truth=truth, title=name)

    def log_frame(self, frame: Frame, *, entity: str = "world") -> None:
        """Log a frame without masks, at the time that is set: points by distance, points on images by depth, truth.

        Args:
            frame: The frame; its images are read here.
            entity: Where all goes.

        Raises:
            LdlsError: An image cannot be read, or not every point has a true label.
        """
        log_frame(Entity(entity, self._stream), frame)

    def log_diffusion(self, result: Segmentation, *, every: int = EVERY, entity: str = "diffusion") -> None:
        """Log the likelihoods of the points in view after every so many products, on the timeline "iteration".

        Logged are 0, `every`, 2 `every`, ... products, and the last. A point has the colour of its likeliest label,
        blended into that of background by the share that the others have. The graph is built again and every product
        computed, which takes longer than `ldls.segment` did. A result that was diffused until it converged is shown
        over 200 products. Afterwards no time is set on "iteration".

        Args:
            result: The segmentation.
            every: Products from one picture to the next.
            entity: Where all goes.

        Raises:
            ParameterError: `every` is less than 1.
            LimitError: A category id is greater than Rerun's ids.
            ImportError: The extra `viz` is not installed.
        """
        log_diffusion(Entity(entity, self._stream), self._names[entity], result, every)

    def log_held_contexts(self) -> None:
        """Log the annotation contexts that were held back, the last of each entity, for all times."""
        self._stream.log_held()

    def _begin(self, contents: Contents, pictured: Collection[str], stamp: float | None) -> None:
        """Set the times of the next frame, and clear what it lacks; `pictured` are the cameras that have an image."""
        self._set_times(stamp)
        world = Entity("world", self._stream)
        cameras = {name: world / "camera" / name for name in contents.cameras}
        coming = {*cameras.values(), *(cameras[name] / "image" for name in pictured if name in cameras)}
        if contents.truth:
            coming.add(world / "truth")
        if contents.labelled:
            coming |= {world / "points" / "direct", world / "boxes", world / "objects"}
            coming |= {camera / "image" / "masks" for camera in cameras.values()}
        # only what is gone: a pinhole that is cleared and logged at one time is no camera to the viewer
        for gone in sorted(self._entities - coming, key=lambda entity: entity.path):
            gone.clear()
        self._entities = coming
        self.n_frames += 1

    def _set_times(self, stamp: float | None) -> None:
        if stamp is not None:
            as_seconds("stamp", stamp)
        self.stream.set_time("frame", sequence=self.n_frames)
        if stamp is not None:
            # a timeline is of dates or of durations, whichever its first stamp is
            self._dated = stamp >= FIRST_DATE_S if self._dated is None else self._dated
            self.stream.set_time("time", **{"timestamp" if self._dated else "duration": stamp})
        elif self._dated is not None:
            self.stream.disable_timeline("time")

    def _show(self, contents: Contents) -> None:
        """Send the layout again where there is something new to show."""
        before = self._contents or contents
        merged = replace(
            before,
            cameras=tuple(dict.fromkeys((*before.cameras, *contents.cameras))),
            labelled=before.labelled or contents.labelled,
            truth=before.truth or contents.truth,
            diffusion=before.diffusion or contents.diffusion,
            frames=min(self.n_frames, 2),
        )
        if merged != self._contents:
            self.stream.send_blueprint(layout(merged))
        self._contents = merged

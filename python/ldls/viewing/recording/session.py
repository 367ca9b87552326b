"""A recording from its first frame to its last, into a file or into a viewer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.datasets import Frame
from ldls.errors import ParameterError
from ldls.evaluation import Labeling
from ldls.io.files import whole_file
from ldls.segmentation import Segmentation
from ldls.view import camera_names
from ldls.viewing.recording import viewer
from ldls.viewing.recording.blueprint import Contents, eye_behind, layout
from ldls.viewing.recording.diffusion import TIMELINE, log_diffusion
from ldls.viewing.recording.entities import log
from ldls.viewing.recording.frames import log_frame
from ldls.viewing.recording.keeping import at_their_times, held_to_the_end
from ldls.viewing.recording.stream import Entity, rerun

VIEWER = "spawn"
"""The target that is a viewer instead of a file."""
SUFFIX = ".rrd"
FIRST_DATE_S = 1e8
"""Stamps from here on, March 1973, are dates; those before count from the start of a drive."""
Branch = tuple[str, ...]
"""Path of an entity below "world"."""
OF_RESULTS: tuple[Branch, ...] = (("points", "direct"), ("boxes",), ("objects",))
"""What frames without labels lack, beside the masks of their cameras."""


@contextmanager
def open_recording(target: str | PathLike[str], *, name: str = "") -> Iterator[Recording]:
    """A recording to add frames to; when the block ends, its file is there whole, and if it fails there is none.

    Until then it is kept in memory, compressed: some 2.5 MB a frame of 120,000 points and one image.

    Args:
        target: A file, which must end in .rrd, or "spawn" for a viewer that is started, or is open already.
        name: What the viewer calls it.

    Raises:
        ParameterError: The target is neither.
        ImportError: The extra `viz` is not installed.
        ConnectionError: There is no display for a viewer and none is open, or it does not answer.
        OSError: The file cannot be written.
    """
    check_target(target)
    rr = rerun()
    stream = rr.RecordingStream("ldls")
    # when a frame was logged is of no interest, and would offer itself as a timeline
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    try:
        if name:
            stream.send_recording_name(name)
        if target == VIEWER:
            viewer.connect(stream)
            with at_their_times(stream):
                yield Recording(stream)
            viewer.flush(stream)
        else:
            # Rerun's own writer waits for ever once a disk is full
            encoded = stream.binary_stream()
            with whole_file(target) as file:
                with held_to_the_end(stream):
                    yield Recording(stream)
                file.write(encoded.read())
    finally:
        stream.disconnect()


def check_target(target: str | PathLike[str]) -> None:
    """Refuse what is no place for a recording.

    Raises:
        ParameterError: It is neither a file that ends in .rrd nor "spawn".
    """
    if target != VIEWER and Path(target).suffix != SUFFIX:
        raise ParameterError(f"rerun: got {str(target)!r}, expected {VIEWER} or a file that ends in {SUFFIX}")


class Recording:
    """Frames, one after the other, in a stream of Rerun.

    Attributes:
        stream: The `rerun.RecordingStream`, to log more to.
        n_frames: Frames added.
    """

    def __init__(self, stream: Any) -> None:  # noqa: ANN401
        """A recording in `stream`, a `rerun.RecordingStream`."""
        self.stream = stream
        self.n_frames = 0
        self._shown: Contents | None = None
        self._branches: frozenset[Branch] = frozenset()
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
            images: See `log`.
            truth: True labels of the points.
            name: Name of the frame.
            stamp: Its time in seconds, for the timeline "time".
            diffusion: Record the likelihoods after every so many products as well; see `log_diffusion`.
            alone: Whether it is the only frame: "iteration" is then the timeline that shows first, and all is on it.

        Raises:
            LdlsError: See `log` and `log_diffusion`.
        """
        names = camera_names(result.views)
        pictures = [("camera", camera, "image") for camera in images or ()]
        masks = [("camera", camera, "image", "masks") for camera in names]
        self._begin(stamp, [*OF_RESULTS, *masks, *pictures, *_branches(names, truth)])
        iterates = diffusion is not None
        if iterates and alone:
            self.stream.set_time(TIMELINE, sequence=0)
        log(result, images=images, truth=truth, name=name, recording=self.stream)
        self._show(
            Contents(
                cameras=names,
                truth=truth is not None,
                diffusion=iterates,
                timeline=TIMELINE if iterates and alone else "frame",
                eye=_eye([seen.view.camera for seen in result.views]),
            )
        )
        if diffusion is not None:
            log_diffusion(result, every=diffusion, recording=self.stream)

    def add_frame(self, frame: Frame) -> None:
        """Add a frame without masks as the next one; its stamp is that of the timeline "time".

        Raises:
            LdlsError: See `log_frame`.
        """
        names = tuple(image.name for image in frame.images)
        self._begin(frame.stamp, [*(("camera", name, "image") for name in names), *_branches(names, frame.truth)])
        log_frame(frame, recording=self.stream)
        self._show(
            Contents(
                cameras=names,
                labelled=False,
                truth=frame.truth is not None,
                eye=_eye([image.camera for image in frame.images]),
            )
        )

    def _begin(self, stamp: float | None, branches: Iterable[Branch]) -> None:
        self._set_times(stamp)
        # only what is gone: a pinhole that is cleared and logged at one time is no camera to the viewer
        for gone in sorted(self._branches.difference(branches)):
            entity = Entity("world", self.stream)
            for part in gone:
                entity = entity / part
            entity.clear()
        self._branches = frozenset(branches)
        self.n_frames += 1

    def _set_times(self, stamp: float | None) -> None:
        self.stream.set_time("frame", sequence=self.n_frames)
        if stamp is not None:
            # a timeline is of dates or of durations, whichever its first stamp is
            self._dated = stamp >= FIRST_DATE_S if self._dated is None else self._dated
            self.stream.set_time("time", **{"timestamp" if self._dated else "duration": stamp})
        elif self._dated is not None:
            self.stream.disable_timeline("time")

    def _show(self, found: Contents) -> None:
        """Send the layout again where there is something new to show."""
        before = self._shown or found
        merged = replace(
            before,
            cameras=tuple(dict.fromkeys((*before.cameras, *found.cameras))),
            labelled=before.labelled or found.labelled,
            truth=before.truth or found.truth,
            diffusion=before.diffusion or found.diffusion,
            frames=min(self.n_frames, 2),
        )
        if merged != self._shown:
            self.stream.send_blueprint(layout(merged))
        self._shown = merged


def _branches(cameras: Iterable[str], truth: Labeling | None) -> list[Branch]:
    return [*(("camera", camera) for camera in cameras), *([("truth",)] if truth is not None else [])]


def _eye(cameras: list[Camera]) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    return eye_behind(cameras[0]) if cameras else None

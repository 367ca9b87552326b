"""The frames of a stream: each by itself, or with those before it where the poses are known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from numpy.typing import ArrayLike

from ldls.camera import Camera
from ldls.checks import checked
from ldls.cloud import as_points
from ldls.doubts import warn_of
from ldls.errors import InputError, ParameterError, PoseError
from ldls.label_diffusion import SAME_OBJECT, segment_views
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation import Segmentation
from ldls.sequences.sweeps import SAME_OBJECT as SAME_OBJECT_OF_SWEEPS, Sweep, check_drive, label_sweeps
from ldls.sequences.tracker import Tracker
from ldls.sequences.trajectory import is_gap
from ldls.view import View

BEFORE = 2
"""Sweeps before the newest that are labelled with it: four are hardly better, and take twice the time."""
MOST_BEFORE = 50


class LabelDiffusion:
    """Segments the frames of a stream: what one camera, or a ring of them, and one lidar yield, frame after frame.

    Does what `segment` does, with camera and parameters that are given once. With pose and stamp a frame is the next
    sweep of a drive: it is labelled together with those before it, as by `segment_sweeps`, and its objects have their
    tracks, as by a `Tracker`. After a second without a sweep it is labelled alone.

    Several threads may call at a time, except for sweeps of a drive. Memory is that of some sweeps.

    Attributes:
        camera: The camera that takes the images, or several.
        params: Parameters of the method.
        before: Sweeps of a drive that are labelled again with the next one.

    Examples:
        >>> diffusion = ldls.LabelDiffusion(camera)  # doctest: +SKIP
        >>> for points, masks in stream:  # doctest: +SKIP
        ...     labels = diffusion.segment(points, masks).labels
    """

    @checked
    def __init__(
        self, camera: Camera | Sequence[Camera] = (), params: Params | None = None, *, before: int = BEFORE
    ) -> None:
        """Prepare for the images of a camera or of several; the parameters are the best known by default.

        Without a camera, each frame brings its own: `segment(points, [View(masks, camera), ...])`.

        Raises:
            InputError: `camera` or `params` is of another type.
            ParameterError: `before` is not from 0 to 50.
        """
        if not 0 <= before <= MOST_BEFORE:
            raise ParameterError(f"before: got {before}, expected 0 to {MOST_BEFORE}; {BEFORE} is a good number")
        self.camera = camera
        self.params = params or Params()
        self.before = before
        self._cameras = tuple(camera) if isinstance(camera, Sequence) else (camera,)
        self._recent: tuple[Sweep, ...] = ()
        self._tracker: Tracker | None = None

    @checked
    def segment(
        self,
        points: ArrayLike,
        masks: InstanceMasks | Sequence[InstanceMasks] | Sequence[View],
        *,
        pose: ArrayLike | None = None,
        stamp: float | None = None,
        nonfinite: Literal["drop", "raise"] = "drop",
        keep_origin: bool = False,
        same_object: float | None = None,
    ) -> Segmentation:
        """Segment the next frame: points, and masks for each camera, or views.

        Args:
            points: As of `ldls.segment`.
            masks: Masks of the image of each camera; views where the stream has no camera.
            pose: (4, 4) T_world_lidar of the next sweep of a drive; with `stamp`, or neither.
            stamp: Its time in seconds, later than that of the one before.
            nonfinite: As of `ldls.segment`.
            keep_origin: As of `ldls.segment`.
            same_object: As of `ldls.segment`, or of `ldls.segment_sweeps` in a drive.

        Raises:
            InputError: An argument cannot be used; see its subclasses. A sweep that fails is not remembered.
            PoseError: The pose is farther from that of the sweep before, however long ago, than 100 m/s allow; another
                drive has a stream of its own.
            LimitError: The cloud has more points than the graph can index.
            ImportError: `ldls[eval]` is not installed, which drives need.
        """
        if (pose is None) != (stamp is None):
            given, lacks = ("pose", "stamp") if stamp is None else ("stamp", "pose")
            raise InputError(f"{lacks}: got None beside a {given}; give both for a sweep of a drive, or neither")
        views = self._views(masks)
        if pose is None or stamp is None:
            share = SAME_OBJECT if same_object is None else same_object
            return segment_views(points, views, self.params, nonfinite, keep_origin, share)
        # a copy, for those who give arrays that they use again
        sweep = Sweep(as_points(points).copy(), views, pose, stamp)  # type: ignore[arg-type]
        last = (*self._recent[-1:], sweep)
        goes_on = not is_gap(sweep.stamp - last[0].stamp)
        try:
            check_drive(last)
        except PoseError as error:
            elsewhere = "" if goes_on else "; or begin another LabelDiffusion where another drive begins"
            raise PoseError(f"{error}{elsewhere}") from None
        recent = (*(self._recent if goes_on else ()), sweep)[-1 - self.before :]
        results, report = label_sweeps(
            recent,
            params=self.params,
            nonfinite=nonfinite,
            keep_origin=keep_origin,
            same_object=SAME_OBJECT_OF_SWEEPS if same_object is None else same_object,
        )
        # of those before it was warned when they came; a warning that is raised leaves the stream as it was
        warn_of(results[-1:], report, stacklevel=4)
        self._tracker = self._tracker or Tracker()
        (result,) = self._tracker.track([sweep], results[-1:])
        self._recent = recent
        return result

    def _views(self, masks: InstanceMasks | Sequence[InstanceMasks] | Sequence[View]) -> tuple[View, ...]:
        each = (masks,) if isinstance(masks, InstanceMasks) else tuple(masks)
        if not self._cameras:
            for view in each:
                if not isinstance(view, View):
                    raise InputError(
                        f"masks: got {type(view).__name__}, expected a list of View, for the stream has no camera"
                    )
            return each  # type: ignore[return-value]
        if len(each) != len(self._cameras):
            raise InputError(f"masks: got those of {len(each)} images, expected {len(self._cameras)}, one a camera")
        # a View refuses what is no InstanceMasks
        return tuple(View(own, camera) for own, camera in zip(each, self._cameras, strict=True))  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return f"LabelDiffusion({self.camera!r}, {self.params!r})"

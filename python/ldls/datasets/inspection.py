"""Checks of the frames of a source."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.rigid import doubt_of_distance, is_leaning
from ldls.cloud import doubt_of_scale, is_finite
from ldls.datasets.frame import CameraImage, Frame, Source
from ldls.errors import LdlsError
from ldls.stages import project

LEAST_IN_VIEW = 0.01
"""Share of points below which a camera hardly sees the cloud: most calibrations that are wrong lead there."""
LARGEST_OFFSET_S = 0.1
"""An image farther from its sweep than this is of another turn of the lidar."""
LARGEST_GAP = 2.5
"""Gaps are longer than this many times the median time between frames."""
FAN_DEG = np.arange(-89.9, 89.95, 0.1)
FAN_RANGE_M = 10_000.0


@dataclass(frozen=True)
class Finding:
    """Something about a frame, or a source, that is not as it should be.

    Attributes:
        frame: Name of the frame; empty where it is about the source.
        what: Description of it.
        broken: True where it makes the frame useless; otherwise it is worth a look.
    """

    frame: str
    what: str
    broken: bool


@dataclass(frozen=True, kw_only=True)
class FrameFacts:
    """Contents of one frame.

    Attributes:
        name: Name of the frame.
        n_points: Its points.
        image_sizes: Height and width of each camera's image in pixels, by its name, where they are known.
        in_view: Share of the points that each camera sees, by its name.
        offsets_s: Time of each image after the sweep, in seconds, where both stamps are known.
        truth: Points of each class that truth has; None without truth.
        has_pose: True if the source says where the lidar was.
        findings: Faults of the frame.
    """

    name: str
    n_points: int = 0
    image_sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    in_view: Mapping[str, float] = field(default_factory=dict)
    offsets_s: Mapping[str, float] = field(default_factory=dict)
    truth: Mapping[str, int] | None = None
    has_pose: bool = False
    findings: tuple[Finding, ...] = ()


def sample(count: int, wanted: int) -> list[int]:
    """Up to `wanted` of the numbers below `count`: the first, the last, and some evenly between."""
    return sorted({round(at) for at in np.linspace(0, count - 1, min(count, wanted)).tolist()})


def inspect(source: Source, index: int) -> FrameFacts:
    """Contents and faults of a frame; a frame that cannot be read is a finding, not an error."""
    name = source.names[index]
    try:
        frame = source[index]
    except (LdlsError, OSError) as error:
        return FrameFacts(name=name, findings=(Finding(name, str(error), broken=True),))
    shares = {image.name: in_view(frame, image) for image in frame.images}
    began = frame.stamp
    offsets = {i.name: i.stamp - began for i in frame.images if i.stamp is not None and began is not None}
    return FrameFacts(
        name=name,
        n_points=len(frame.points),
        image_sizes={i.name: i.camera.image_size for i in frame.images if i.camera.image_size is not None},
        in_view=shares,
        offsets_s=offsets,
        truth=None if frame.truth is None else {n: c for n, c in frame.truth.counts().items() if c},
        has_pose=frame.pose is not None,
        findings=(
            *_of_cloud(frame),
            *(finding for image in frame.images for finding in _of_image(frame, image)),
            *_of_places(frame),
            *_of_views(name, shares if len(frame.points) else {}),
            *_of_offsets(name, offsets),
        ),
    )


def in_view(frame: Frame, image: CameraImage) -> float:
    """Share of the frame's points that the camera sees; 0 of none."""
    if not len(frame.points) or image.camera.image_size is None:
        return 0.0
    return len(project(frame.points, image.camera, image_size=image.camera.image_size)[0]) / len(frame.points)


def check_stamps(names: Sequence[str], stamps: Sequence[float | None]) -> list[Finding]:
    """Gaps and steps back between the frames that have stamps."""
    known = [(name, stamp) for name, stamp in zip(names, stamps, strict=True) if stamp is not None]
    steps = np.diff([stamp for _, stamp in known])
    usual = float(np.median(steps)) if len(steps) else 0.0
    findings = []
    for (before, _), (name, _), step in zip(known, known[1:], steps.tolist(), strict=False):
        if step == 0:
            findings.append(Finding(name, f"its stamp is that of {before}", broken=True))
        elif not step > 0:
            findings.append(Finding(name, f"its stamp is {-step:.3f} s before that of {before}", broken=True))
        elif step > LARGEST_GAP * usual:
            findings.append(Finding(name, f"{step:.3f} s after {before}, frames are {usual:.3f} s apart", broken=False))
    return findings


def field_of_view_deg(camera: Camera) -> tuple[float, float]:
    """Angles that the camera sees across and down the middle of its image, in degrees, by its own projection."""
    return _angle_deg(camera, 0), _angle_deg(camera, 1)


def classes_of(facts: Iterable[FrameFacts]) -> dict[str, int]:
    """Points of each class of the truth over all frames, the most frequent first."""
    counts: Counter[str] = Counter()
    for each in facts:
        counts.update(each.truth or {})
    return dict(counts.most_common())


def _angle_deg(camera: Camera, axis: int) -> float:
    """Extent of the rays across (axis 0) or down (1) that the image shows; rays lie in a plane through the axis."""
    angles = np.radians(FAN_DEG)
    rays = np.zeros((len(angles), 4))
    rays[:, axis], rays[:, 2], rays[:, 3] = FAN_RANGE_M * np.sin(angles), FAN_RANGE_M * np.cos(angles), 1
    points = (rays @ np.linalg.inv(camera.T_camera_lidar).T)[:, :3]
    if camera.image_size is None:
        return 0.0
    seen: NDArray[np.float64] = FAN_DEG[project(points, camera, image_size=camera.image_size)[0]]
    return float(np.ptp(seen)) if len(seen) else 0.0


def _of_cloud(frame: Frame) -> list[Finding]:
    if not len(frame.points):
        return [Finding(frame.name, "its cloud is empty", broken=True)]
    finite = is_finite(frame.points)
    if not finite.any():
        return [Finding(frame.name, f"none of its {len(finite):,} points is finite", broken=True)]
    findings = []
    if not finite.all():
        findings.append(Finding(frame.name, f"{1 - finite.mean():.1%} of its points are not finite", broken=False))
    xyz = frame.points[finite, :3].astype(np.float64)
    scale = doubt_of_scale(xyz.min(axis=0), xyz.max(axis=0))
    if scale is not None:
        findings.append(Finding(frame.name, scale, broken=False))
    return findings


def _of_image(frame: Frame, image: CameraImage) -> list[Finding]:
    try:
        shape = image.read().shape
    except (LdlsError, OSError) as error:
        return [Finding(frame.name, f"{image.name}: {error}", broken=True)]
    expected = image.camera.image_size
    if expected is not None and shape[:2] != tuple(expected):
        what = f"{image.name}: image is {shape[0]} x {shape[1]}, its calibration is for {expected[0]} x {expected[1]}"
        return [Finding(frame.name, f"{what} (height x width)", broken=True)]
    return []


def _of_places(frame: Frame) -> list[Finding]:
    findings = []
    for image in frame.images:
        distance = doubt_of_distance(image.camera.T_camera_lidar)
        leaning = "T_camera_lidar: z of the lidar does not point up in the image; is it the inverse?"
        doubts = (distance, leaning if is_leaning(image.camera.T_camera_lidar) else None)
        findings += [
            Finding(frame.name, f"{image.name}: {doubt}", broken=False) for doubt in doubts if doubt is not None
        ]
    return findings


def _of_views(name: str, shares: Mapping[str, float]) -> list[Finding]:
    return [
        Finding(name, f"{camera}: sees {share:.2%} of the points; wrong calibration?", broken=share == 0)
        for camera, share in shares.items()
        if not share >= LEAST_IN_VIEW
    ]


def _of_offsets(name: str, offsets: Mapping[str, float]) -> list[Finding]:
    return [
        Finding(name, f"{camera}: taken {offset:+.3f} s from the sweep", broken=False)
        for camera, offset in offsets.items()
        if not abs(offset) <= LARGEST_OFFSET_S
    ]

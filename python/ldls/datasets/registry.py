"""Every kind of source, and the one that a path is."""

from __future__ import annotations

from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from ldls.checks import choice
from ldls.datasets.folder import FolderSource
from ldls.datasets.frame import Source
from ldls.datasets.kitti_object import KittiObjectSource
from ldls.datasets.kitti_odometry import KittiOdometrySource
from ldls.datasets.kitti_raw import KittiRawSource
from ldls.datasets.nuscenes import NuScenesSource
from ldls.datasets.nuscenes_frame import NuScenesFrameSource
from ldls.datasets.rosbag import RosBag
from ldls.errors import SourceError
from ldls.io.options import check_options


class SourceClass(Protocol):
    """A class of sources.

    Attributes:
        kind: Its name in the registry.
        looks_for: Files and folders by which a path is one, for messages.
    """

    kind: str
    looks_for: str

    def __call__(self, *args: Any, **options: Any) -> Source:  # noqa: ANN401
        """Open a path."""
        ...

    def recognises(self, path: Path) -> bool:
        """True for a path that looks like one; reads nothing but names."""
        ...


SOURCES: dict[str, SourceClass] = {
    "kitti-object": KittiObjectSource,
    "kitti-raw": KittiRawSource,
    "kitti-odometry": KittiOdometrySource,
    "nuscenes": NuScenesSource,
    "nuscenes-frame": NuScenesFrameSource,
    "folder": FolderSource,
    "rosbag": RosBag,
}
"""Classes of sources by kind."""
MOST_LOOKED_AT = 100
"""Files and folders of one that is no source which are asked whether they are."""


def open_source(
    path: str | PathLike[str],
    *,
    kind: str | None = None,
    truth: bool | str = True,
    poses: bool = True,
    **options: Any,  # noqa: ANN401
) -> Source:
    """The source of frames at a path.

    Args:
        path: A folder, or a file such as a bag.
        kind: One of `SOURCES`; by default the only one that recognises the path.
        truth: Give frames their truth, where the source has any; it takes time to read. A text names its kind.
        poses: Give frames their poses, where the source has any.
        options: Those of the kind's class, as `camera` or `scene`.

    Raises:
        SourceError: No kind recognises the path, or several do, or the source is not whole.
        ParameterError: There is no such kind or option.
        FileNotFoundError: There is nothing at the path.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file or folder")
    source = SOURCES[guess_kind(path) if kind is None else choice("kind", kind, SOURCES)]
    known = check_options(source.kind, source, options)
    options |= {name: value for name, value in (("truth", truth), ("poses", poses)) if name in known}
    return source(path, **options)


def guess_kind(path: Path) -> str:
    """The only kind that recognises a path.

    Raises:
        SourceError: None does, or several do; the message lists the kinds and what they look for.
    """
    fitting = [kind for kind, source in SOURCES.items() if source.recognises(path)]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        what = "; ".join(f"{kind} ({SOURCES[kind].looks_for})" for kind in fitting)
        raise SourceError(f"{path}: may be {what}; say which by kind=")
    what = "; ".join(f"{kind} ({source.looks_for})" for kind, source in SOURCES.items())
    raise SourceError(
        f"{path}: is no source of frames{_hint(path)}; `ldls init` describes files of your own; looked for {what}"
    )


def _hint(folder: Path) -> str:
    """Which of the first things in a folder may be meant; empty where none is a source."""
    inside = islice(sorted(folder.iterdir()) if folder.is_dir() else [], MOST_LOOKED_AT)
    likely = next((path for path in inside if any(source.recognises(path) for source in SOURCES.values())), None)
    return "" if likely is None else f"; perhaps {likely}?"

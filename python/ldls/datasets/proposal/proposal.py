"""The proposal: sweeps, the images that go with them, and for each camera calibration, transform and masks."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import doubt_of_distance
from ldls.cloud import Points, doubt_of_scale, finite_rows
from ldls.datasets.file_source import IMAGE_SUFFIXES
from ldls.datasets.folder_description import FILE
from ldls.datasets.proposal.calibrations import camera_in, plausible_transforms, quoted, transforms_in, view_of
from ldls.datasets.proposal.patterns import Pattern, patterns_of
from ldls.datasets.stored_masks import FRAME
from ldls.errors import FileFormatError, LdlsError, ScaleWarning, SourceError
from ldls.io import read_masks, read_points
from ldls.io.cameras.field_file import MAX_BYTES
from ldls.io.images import read_image_size
from ldls.io.labels import read_labeling
from ldls.io.masks.data_set import MaskDataSet
from ldls.io.masks.formats import READERS as MASK_READERS
from ldls.io.points import READERS as POINT_READERS
from ldls.io.points.float_rows import likeliest_columns

CALIBRATIONS = (".yaml", ".yml", ".xml", ".json", ".toml", ".txt")
NO_IMAGE_WORDS = ("mask", "inst", "seg", "label", "panoptic", "birds-eye", "comparison")
"""Parts of the names of pictures that no camera took."""
MOST_OTHERS = 3
"""Other ways to read a transform that are listed."""
MOST_CAMERAS = 32
"""Files of one pattern that may be of as many cameras, each with its own name."""
FEWEST_POINTS = 50
"""Rows of numbers that make a text a cloud."""


@dataclass
class Proposal:
    """An ldls.toml as far as the files tell.

    Attributes:
        lines: Its lines.
        found: What it names, for people.
        missing: What it lacks for `ldls info` and `ldls run`, for people.
    """

    lines: list[str] = field(default_factory=list)
    found: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The file."""
        return "\n".join(self.lines) + "\n"

    def ask(self, question: str) -> None:
        """Add a question as a comment."""
        self.lines.append(f"# ? {''.join(sign if sign.isprintable() else ' ' for sign in question)}")


def propose(folder: Path) -> Proposal:
    """Return the ldls.toml of a folder whose files are named by frames.

    Raises:
        SourceError: The folder has no cloud that can be read.
    """
    patterns = [pattern for pattern in patterns_of(folder) if PurePosixPath(pattern.text).name != FILE]
    read = ((pattern, _cloud(pattern)) for pattern in patterns if pattern.suffix in POINT_READERS)
    clouds = [(pattern, *cloud) for pattern, cloud in read if cloud is not None]
    if not clouds:
        seen = ", ".join(pattern.text for pattern in patterns[:8]) or "nothing"
        raise SourceError(f"{folder}: no file is a lidar sweep ({', '.join(POINT_READERS)}); found {seen}")
    pictures = [pattern for pattern in patterns if _is_picture(pattern)]
    sweeps, points, columns = max(clouds, key=lambda each: (_most_shared(each[0], pictures), each[0].n_bytes))
    made = Proposal()
    made.lines += [
        "# What `ldls init` found; lines with # ? are questions. Paths are relative to this folder; {frame} is",
        "# the name of a frame. docs/datasets.md has all keys.",
        f"points = {quoted(sweeps.text)}",
    ]
    made.found.append(f"{sweeps.text}: {_count(sweeps, 'sweep')}, the first of {len(points):,} points")
    if columns is not None:
        made.lines.append(f"columns = {columns}")
        made.ask(f"the first file makes sense as rows of {columns} floats")
    xyz = points[finite_rows(points), :3].astype(np.float64)
    scale = doubt_of_scale(xyz.min(axis=0), xyz.max(axis=0)) if len(xyz) else None
    if scale is not None:
        warnings.warn(f"{sweeps.text}: {scale}", ScaleWarning, stacklevel=2)
    for other, _, _ in clouds:
        if other is not sweeps:
            made.ask(f"{other.text} ({_count(other, 'cloud')}) is not used")
    _add_truth(made, sweeps, patterns, columns)
    cameras = [picture for picture in pictures if picture.shared(sweeps)]
    if not cameras:
        made.missing.append(_no_images(sweeps, pictures))
        made.lines += ["", "# [cameras.NAME]", f'# images = "images/{FRAME}.png"']
    for picture in cameras:
        _add_camera(made, picture, cameras, sweeps, patterns, points)
    return made


def _cloud(pattern: Pattern) -> tuple[Points, int | None] | None:
    """The first cloud of a pattern and its columns, where the reader has to be told; None where it is no cloud."""
    _, path = pattern.first
    for likeliest in (False, True) if pattern.suffix == ".bin" else (False,):
        with suppress(LdlsError, ImportError, ValueError):
            columns = likeliest_columns(path) if likeliest else None
            points = read_points(path, columns=columns)
            return (points, columns) if len(points) >= FEWEST_POINTS else None
    return None


def _is_picture(pattern: Pattern) -> bool:
    if pattern.suffix not in IMAGE_SUFFIXES or any(word in pattern.text.lower() for word in NO_IMAGE_WORDS):
        return False
    with suppress(FileFormatError):
        read_image_size(pattern.first[1])
        return True
    return False


def _most_shared(cloud: Pattern, pictures: Iterable[Pattern]) -> int:
    return max((len(cloud.shared(picture)) for picture in pictures), default=0)


def _no_images(sweeps: Pattern, pictures: Sequence[Pattern]) -> str:
    if not pictures:
        return f"images: found none; the image of sweep {sweeps.first[0]} is to be named {sweeps.first[0]}.png or .jpg"
    nearest = max(pictures, key=lambda picture: len(picture.files))
    return (
        f"images: no image has the name of a sweep ({nearest.text}: {nearest.first[0]}, "
        f"{sweeps.text}: {sweeps.first[0]}); rename one of them"
    )


def _add_truth(made: Proposal, sweeps: Pattern, patterns: Iterable[Pattern], columns: int | None) -> None:
    for pattern in patterns:
        common = pattern.shared(sweeps)
        if pattern.suffix not in (".label", ".txt") or not common or pattern is sweeps:
            continue
        with suppress(LdlsError, ImportError):
            name = min(common)
            if len(read_labeling(pattern.files[name])) == len(read_points(sweeps.files[name], columns=columns)):
                made.lines.append(f"truth = {quoted(pattern.text)}")
                made.found.append(f"{pattern.text}: true labels")
                return


def _add_camera(
    made: Proposal,
    picture: Pattern,
    cameras: Sequence[Pattern],
    sweeps: Pattern,
    patterns: Sequence[Pattern],
    points: Points,
) -> None:
    name = _name(picture)
    common = picture.shared(sweeps)
    size = read_image_size(picture.files[min(common)])
    made.lines += ["", f"[cameras.{quoted(name)}]", f"images = {quoted(picture.text)}"]
    count = f"{_count(picture, 'image')} of {size[0]} x {size[1]} (height x width), {len(common):,} with a sweep"
    made.found.append(f"{picture.text}: {count}")
    own = [pattern for pattern in patterns if pattern not in (picture, sweeps)]
    _add_masks(made, picture, cameras, own, size)
    _add_calibration(made, picture, cameras, sweeps, own, points, size)


def _add_masks(
    made: Proposal, picture: Pattern, cameras: Sequence[Pattern], others: Sequence[Pattern], size: tuple[int, int]
) -> None:
    fitting = []
    for other in others:
        common = other.shared(picture)
        if other.suffix not in MASK_READERS or not common or (other.suffix in IMAGE_SUFFIXES and _is_picture(other)):
            continue
        if len(cameras) == 1 or _owner(other, cameras) is picture:
            with suppress(LdlsError, ImportError, ValueError):
                read_masks(other.files[min(common)], image_size=size)
                fitting.append((len(common), other.text))
    found = fitting or _data_sets_of(picture, cameras, others, size)
    n_common, place = max(found, key=lambda each: each[0], default=(0, ""))
    if not n_common:
        made.lines.append(f'# masks = "masks/{FRAME}.json"')
        made.ask("no masks were found: any format of docs/masks.md, or `ldls run --segmenter`")
        return
    made.lines.append(f"masks = {quoted(place)}")
    made.found.append(f"{place}: masks of {_number(n_common, 'image')}")


def _data_sets_of(
    picture: Pattern, cameras: Sequence[Pattern], others: Iterable[Pattern], size: tuple[int, int]
) -> list[tuple[int, str]]:
    """The JSON files with the masks of many images, each after the number of the images of the camera that it names."""
    few = [other for other in others if other.suffix == ".json" and len(other.files) <= MOST_CAMERAS]
    found = []
    for text, path in ((other.text.replace(FRAME, name), path) for other in few for name, path in other.files.items()):
        with suppress(LdlsError):
            data_set = MaskDataSet(path)
            images = sorted(picture.files.items())
            named = [frame for frame, image in images if data_set.has(frame) or data_set.has(image)]
            if named:
                paths = {_name(camera): camera.files.get(named[0]) for camera in cameras}
                data_set.masks(data_set.find(named[0], _name(picture), paths), size)
                found.append((len(named), text))
    return found


def _add_calibration(
    made: Proposal,
    picture: Pattern,
    cameras: Sequence[Pattern],
    sweeps: Pattern,
    others: Sequence[Pattern],
    points: Points,
    size: tuple[int, int],
) -> None:
    name = _name(picture)
    frames = picture.shared(sweeps)
    small = [
        each
        for pattern in others
        if pattern.suffix in CALIBRATIONS and pattern.first[1].stat().st_size <= MAX_BYTES
        for each in _by_frame_or_camera(pattern, frames, cameras)
    ]
    # of several cameras each has a file that is named like it, if there is one
    own = [pattern for pattern in small if _owner(pattern, cameras) is picture]
    small.sort(key=lambda pattern: pattern not in own)
    hint = name.rpartition("_")[2]
    read = (camera_in(_file(pattern, sweeps), pattern.text, hint) for pattern in small)
    found = next((each for each in read if each is not None), None)
    if found is None:
        made.missing.append(f"calibration of {name}: found none; docs/formats.md has the files that are read")
        made.lines += ['# calibration = "camera.yaml"', "# or K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"]
        made.ask("no calibration was found")
        return
    made.lines += found.lines
    made.found.append(f"{found.place}: calibration of {name}")
    calibrated = found.camera.image_size or size
    if calibrated != size:
        sizes = "the calibration is of {} x {} pixels, images of {} x {}".format(*calibrated, *size)
        made.ask(f"{sizes} (height x width): was one resized?")
    if len(cameras) > 1 and not own:
        made.ask("is this the calibration of this camera? No file has its name")
    if found.knows_lidar:
        upright, share = view_of(found.camera, points, size)
        _judge(made, name, share, found.camera.T_camera_lidar, upright=upright)
        return
    transforms = [each for pattern in small for each in transforms_in(_file(pattern, sweeps), pattern.text)]
    own_files = [pattern.text for pattern in own]
    plausible = plausible_transforms(transforms, own_files, found.camera, points, size)
    if not plausible:
        turned = f", none of {len(transforms)} tried shows a point" if transforms else ""
        doubt = doubt_of_distance(transforms[0].matrix) if transforms else None
        turned += f" ({doubt})" if doubt is not None else ""
        made.missing.append(f"where the lidar is, for {name}: found no transform{turned}; docs/own-sensors.md says how")
        made.lines.append("# T_camera_lidar = [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]")
        made.ask("no file says where the lidar is")
        return
    chosen, _ = plausible[0]
    made.lines.append(chosen.line)
    made.found.append(f"{chosen.how}: where the lidar is, for {name}")
    if len(cameras) > 1 and chosen.file not in own_files:
        made.ask("is this the transform of this camera? Its file is not named like it")
    if not chosen.is_sure:
        made.ask(f"T_camera_lidar is {chosen.how}, one of {len(transforms)} ways to read it; is it right?")
        for another, also in plausible[1 : 1 + MOST_OTHERS]:
            made.ask(f"it shows {also:.0%} of the points if it is {another.how}:")
            made.lines.append(f"# {another.line}")
    upright, share = view_of(replace(found.camera, T_camera_lidar=chosen.matrix), points, size)
    _judge(made, name, share, chosen.matrix, upright=upright)


def _by_frame_or_camera(pattern: Pattern, frames: Set[str], cameras: Sequence[Pattern]) -> Sequence[Pattern]:
    """The pattern where its files are of frames, though some have none; else its files, as cam0.yaml and cam1.yaml."""
    if len(pattern.files) > MOST_CAMERAS:
        return [pattern] if frames & pattern.files.keys() else []
    files = [Pattern(pattern.text.replace(FRAME, name), {name: path}) for name, path in pattern.files.items()]
    owners = {_owner(file, cameras) for file in files} - {_owner(pattern, cameras), None}
    # a camera named 2 may have the name of a frame
    are_of_cameras = any(not _place(owner).name.isdigit() for owner in owners if owner is not None)
    of_frames = len(frames & pattern.files.keys())
    return [pattern] if not are_of_cameras and (of_frames == len(frames) or of_frames > len(cameras)) else files


def _file(pattern: Pattern, sweeps: Pattern) -> Path:
    common = pattern.shared(sweeps)
    return pattern.files[min(common)] if len(pattern.files) > 1 and common else pattern.first[1]


def _judge(made: Proposal, name: str, share: float, T_camera_lidar: NDArray[np.float64], *, upright: bool) -> None:
    made.ask(f"{share:.0%} of the first sweep's points are in view of {name}; look: ldls info . --picture check.png")
    if not upright:
        made.ask("but z of the lidar does not point up in the image: is the transform turned round?")
    doubt = doubt_of_distance(T_camera_lidar)
    if doubt is not None:
        warnings.warn(f"{name}: {doubt}", ScaleWarning, stacklevel=4)


def _place(picture: Pattern) -> PurePosixPath:
    return PurePosixPath(picture.text).parent


def _name(picture: Pattern) -> str:
    place = _place(picture)
    return "camera" if place == PurePosixPath() else "_".join(place.parts).replace(" ", "_")


def _owner(pattern: Pattern, cameras: Iterable[Pattern]) -> Pattern | None:
    """The camera that a file is named like: front_left.yaml is of front_left, not of front; None where it is no one."""
    text = pattern.text.lower()
    fits = []
    for camera in cameras:
        names = {_name(camera).lower(), _place(camera).name.lower()} - {""}
        # a whole word before a part of one
        fit = max(((_is_word(name, text), len(name)) for name in names if name in text), default=None)
        if fit is not None:
            fits.append((fit, camera))
    best = max((fit for fit, _ in fits), default=None)
    owners = [camera for fit, camera in fits if fit == best]
    return owners[0] if len(owners) == 1 else None


def _is_word(name: str, text: str) -> bool:
    return re.search(rf"(?<![^\W_]){re.escape(name)}(?![^\W_])", text) is not None


def _count(pattern: Pattern, what: str) -> str:
    return _number(len(pattern.files), what)


def _number(count: int, what: str) -> str:
    return f"{count:,} {what}{'s' if count != 1 else ''}"

"""Tables with a row an object, of one frame or of many: CSV, and JSON after COCO's data sets."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import IO, Any

import ldls._ldls as _ldls
from ldls.categories import class_id
from ldls.checks import checked
from ldls.io.files import whole_file
from ldls.io.options import of_ending
from ldls.segmentation import Segmentation
from ldls.segmentation.objects import COLUMNS, Row
from ldls.view import camera_names

DECIMALS = 4
"""Decimals of the numbers in files: a tenth of a millimetre."""


@dataclass(frozen=True)
class FrameObjects:
    """The objects of a frame.

    Attributes:
        frame: Its name.
        images: Name of the camera, height and width in pixels of each of its images.
        rows: Its objects with points, as `Segmentation.to_table` has them.
    """

    frame: str
    images: Sequence[tuple[str, int, int]]
    rows: Sequence[Row]

    @classmethod
    def of(cls, frame: str, result: Segmentation) -> FrameObjects:
        """The objects of a result."""
        sizes = (seen.view.masks.image_size for seen in result.views)
        images = [(name, *size) for name, size in zip(camera_names(result.views), sizes, strict=True)]
        return cls(frame, images, result.to_table())


@checked
def save_objects(results: Segmentation | Mapping[str, Segmentation], path: str | PathLike[str]) -> None:
    """Write one table with a row for each object with points; the ending of the name chooses the format.

    `.csv` has the columns of `Segmentation.to_table` after `frame`; `.json` is a data set after COCO's with an
    annotation for each object, its box in the lidar frame beside the one in the image. An object that no image of its
    frame shows has empty cells for camera and mask in `.csv`, and null for `image_id` and `bbox` in `.json`. A class
    has one category id in the file, by its name. Numbers are rounded to four decimals. docs/formats.md says what is in
    each. The file appears only when it is whole.

    Args:
        results: A result, whose frame has no name in the table, or results by the names of their frames.
        path: The file.

    Raises:
        UnsupportedFormatError: No table has this ending.
        InputError: It is neither a result nor results by name.
    """
    if isinstance(results, Segmentation):
        results = {"": results}
    objects_writer(path)(FrameObjects.of(frame, result) for frame, result in results.items())


def objects_writer(path: str | PathLike[str]) -> Callable[[Iterable[FrameObjects]], None]:
    """Return the function that writes the objects of frames, in their order, to `path`.

    Raises:
        UnsupportedFormatError: No table has this ending.
    """
    writer = of_ending(path, WRITERS, "write", "tables of objects")

    def write(frames: Iterable[FrameObjects]) -> None:
        with whole_file(path) as file:
            writer(file, _with_class_ids(frames))

    return write


def _with_class_ids(frames: Iterable[FrameObjects]) -> Iterator[FrameObjects]:
    """The frames with one category id a class, which masks of each frame may number in their own way."""
    names: dict[int, str] = {}
    for each in frames:
        ids = [class_id(row["category"], row["name"], names) for row in each.rows]
        yield replace(each, rows=[row | {"category": own} for row, own in zip(each.rows, ids, strict=True)])


def _write_csv(file: IO[bytes], frames: Iterable[FrameObjects]) -> None:
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["frame", *COLUMNS])
    for each in frames:
        writer.writerows([each.frame, *(_rounded(row[column]) for column in COLUMNS)] for row in each.rows)
    # the file outlives the wrapper
    text.detach()


def _write_json(file: IO[bytes], frames: Iterable[FrameObjects]) -> None:
    """Write the annotations as they come; images and categories, which are few, after them."""
    images: list[dict[str, Any]] = []
    names: dict[int, str] = {}
    info = {"description": f"objects of ldls {_ldls.__version__}; boxes in the lidar frame, metres and radians"}
    file.write(b'{"info":' + _json(info) + b',\n"annotations":[')
    annotations = _annotations(frames, images, names)
    file.writelines((b"\n" if i == 0 else b",\n") + _json(each) for i, each in enumerate(annotations))
    categories = [{"id": category, "name": names[category]} for category in sorted(names)]
    file.write(b'],\n"images":' + _json(images) + b',\n"categories":' + _json(categories) + b"}\n")


def _annotations(
    frames: Iterable[FrameObjects], images: list[dict[str, Any]], names: dict[int, str]
) -> Iterator[dict[str, Any]]:
    """Yield the annotation of each object; adds the frames' images to `images` and its categories to `names`."""
    number = 0
    for each in frames:
        ids = {}
        for camera, height, width in each.images:
            ids[camera] = len(images) + 1
            parts = (each.frame,) if each.frame and len(each.images) == 1 else (camera, each.frame)
            images.append(
                {
                    "id": ids[camera],
                    "file_name": "/".join(filter(None, parts)),
                    "height": height,
                    "width": width,
                    "frame": each.frame,
                    "camera": camera,
                }
            )
        for row in each.rows:
            number += 1
            names.setdefault(row["category"], row["name"])
            rounded = {name: _rounded(value) for name, value in row.items()}
            yield _annotation(number, each.frame, ids.get(row["camera"]), rounded)


def _annotation(number: int, frame: str, image: int | None, row: Row) -> dict[str, Any]:
    width, height = row["mask_width_px"], row["mask_height_px"]
    return {
        "id": number,
        "image_id": image,
        "category_id": row["category"],
        # readers compare areas with numbers, so that of no image is one too
        "bbox": None if image is None else [row["mask_left_px"], row["mask_top_px"], width, height],
        "area": 0 if image is None else width * height,
        "iscrowd": 0,
        "frame": frame,
        "score": row["score"],
        "label": row["label"],
        "track": row["track"],
        "velocity": [row["velocity_x_m_s"], row["velocity_y_m_s"]],
        "n_points": row["n_points"],
        "distance_m": row["distance_m"],
        "centroid": [row["centroid_x_m"], row["centroid_y_m"], row["centroid_z_m"]],
        "box": {
            "center": [row["box_x_m"], row["box_y_m"], row["box_z_m"]],
            "size": [row["length_m"], row["width_m"], row["height_m"]],
            "yaw": row["yaw_rad"],
        },
    }


def _rounded(value: object) -> object:
    return round(value, DECIMALS) if isinstance(value, float) else value


def _json(content: object) -> bytes:
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()


WRITERS: dict[str, Callable[[IO[bytes], Iterable[FrameObjects]], None]] = {".csv": _write_csv, ".json": _write_json}
"""Writers of tables of objects, by the ending of the name."""

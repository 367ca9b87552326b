"""The tracks of a run: the objects of a drive, numbered over all its frames when these are done.

The folder of the run then has

- `tracks/FRAME.ENDING`: the results of the run again, with their tracks: `.label` after SemanticKITTI, where they are
  the upper 16 bits, and of the formats of the run those that name instances;
- `tracks.csv`: a row for each object with points of each frame;
- `tracks/objects.jsonl`: a line for each frame: `images` and `objects`, as in the journal, of the result with tracks;
- `tracks/tracks.json`: a digest of what they were made of, and size and digest of each of these files.

The map of the drive, where one is asked for, is made in the same pass, each time anew.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

import ldls._ldls as _ldls
from ldls.batch.journal import Record, line_of
from ldls.batch.known_files import is_written, written
from ldls.errors import LimitError, UnsafePathError
from ldls.io import read_result, save
from ldls.io.files import LARGE_BYTES, open_file, refuse_link, remove_unfinished, whole_file
from ldls.io.labels.semantic_kitti import MOST_INSTANCES as MOST_TRACKS
from ldls.io.objects import DECIMALS, FrameObjects
from ldls.io.options import of_ending
from ldls.io.results import MAP_WRITERS
from ldls.segmentation import Segmentation
from ldls.sequences import LabelledMap, Sweep, Tracker
from ldls.viewing.formats import RESULT, TRACKS, file_name

TRACKS_TABLE, TRACKS_STATE = "tracks.csv", "tracks.json"
TRACKED_OBJECTS = f"{TRACKS}/objects.jsonl"
TRACKED_FORMATS = ("npz", "label", "panoptic", "ply", "pcd", "las", "laz", "parquet", "csv")
"""Formats of results that name instances."""
COLUMNS = (
    "frame", "track", "label", "category", "name", "score", "n_points", "world_x_m", "world_y_m", "world_z_m",
    "velocity_x_m_s", "velocity_y_m_s",
)  # fmt: skip
"""Columns of the table: those of tables of objects, and the mean of the points and their velocity in the world."""


class RunTracks:
    """The tracks in the folder of a run.

    Attributes:
        folder: Where the results with tracks are.
    """

    def __init__(
        self, folder: Path, names: Iterable[str], formats: Iterable[str] = (), map_file: Path | None = None
    ) -> None:
        """Tracks in `folder`, of frames of these names, in these formats as far as they name instances, and a map.

        Raises:
            ImportError: `ldls[eval]` is not installed.
            UnsupportedFormatError: Maps are not written to such files.
            UnsafePathError: Files of a frame and of the tracks would be one.
        """
        Tracker()
        if any(name.casefold() == TRACKS for name in names):
            raise UnsafePathError(
                f"frame {TRACKS!r}: its files and {TRACKS_TABLE} may be one; rename it, or do not track"
            )
        if map_file is not None:
            of_ending(map_file, MAP_WRITERS, "write", "maps")
        self._folder, self.folder, self._map = folder, folder / TRACKS, map_file
        self._formats = {"label", *formats}

    def write(self, records: Callable[[], Iterable[Record]], before: Callable[[], None]) -> list[str]:
        """Number the objects of all frames that are done, if that was not done; the frames left out, without a pose.

        One window at a time is in memory.

        Args:
            records: Gives the journal's records of the frames that have a stored result, in the order of the source.
            before: Called before tracks become others than they were.

        Raises:
            LimitError: There are more objects than a file has numbers for, or the map has too many voxels.
            FileFormatError: A stored result is broken.
            UnsafePathError: The folder of the tracks is a link.
            OSError: A file cannot be written, as on a full disk; give the same command again.
        """
        refuse_link(self.folder)
        unplaced = [record["frame"] for record in records() if not _is_placed(record)]
        made_of, noted = digest_of_records(records()), _note(self._folder)
        files: dict[str, list[int | str]] = noted["files"]
        frames = [record["frame"] for record in records() if _is_placed(record)]
        # those of earlier runs stay
        formats = [
            word
            for word in TRACKED_FORMATS
            if word in self._formats or any(_place(frame, word) in files for frame in frames)
        ]
        expected = {TRACKS_TABLE, TRACKED_OBJECTS, *(_place(frame, word) for frame in frames for word in formats)}
        current = noted["made_of"] == made_of and expected == files.keys()
        current = current and all(is_written(self._folder / name, files[name]) for name in files)
        if current and self._map is None:
            return unplaced
        if not current:
            before()
        places = LabelledMap()
        self.folder.mkdir(exist_ok=True)
        remove_unfinished(self.folder)
        now: dict[str, list[int | str]] = {}
        with (
            whole_file(self._folder / TRACKS_TABLE) as file,
            whole_file(self._folder / TRACKED_OBJECTS) as objects_file,
        ):
            text = io.TextIOWrapper(file, encoding="utf-8", newline="")
            table = csv.writer(text, lineterminator="\n")
            table.writerow(COLUMNS)
            for frame, placed, result in self._tracked(filter(_is_placed, records())):
                for word in formats:
                    path = self._folder / _place(frame, word)
                    save(result, path)
                    now[_place(frame, word)] = written(path)
                table.writerows(_rows(frame, placed, result))
                objects = FrameObjects.of(frame, result)
                objects_file.write(line_of({"frame": frame, "images": objects.images, "objects": objects.rows}))
                if self._map is not None:
                    places.add(placed, result)
            # the file outlives the wrapper
            text.detach()
        now |= {name: written(self._folder / name) for name in (TRACKS_TABLE, TRACKED_OBJECTS)}
        for name in files.keys() - now.keys():
            (self._folder / name).unlink(missing_ok=True)
        with whole_file(self.folder / TRACKS_STATE) as file:
            file.write(json.dumps({"files": now, "made_of": made_of}, indent=0).encode())
        if self._map is not None:
            save(places, self._map)
        return unplaced

    def objects(self, records: Iterable[Record]) -> Iterator[Record]:
        """Yield records of the journal, those of frames with tracks with the objects of these instead.

        Args:
            records: Those of frames of the run, in the order of the source.
        """
        with open_file(self._folder / TRACKED_OBJECTS, "tracked objects") as file:
            tracked = map(json.loads, file)
            for record in records:
                has_tracks = "error" not in record and _is_placed(record)
                yield next(each for each in tracked if each["frame"] == record["frame"]) if has_tracks else record

    def _tracked(self, records: Iterable[Record]) -> Iterator[tuple[str, Sweep, Segmentation]]:
        """Name, sweep and tracked result of each frame, window by window."""
        tracker = Tracker()
        # frames that were labelled together share their labels
        for _, window in groupby(records, key=lambda record: record["window"]):
            frames = list(window)
            results = [read_result(self._folder / file_name(each["frame"], RESULT)) for each in frames]
            sweeps = [
                Sweep(result.points, (), np.array(each["pose"], np.float64), float(each["stamp"]))
                for each, result in zip(frames, results, strict=True)
            ]
            for each, placed, result in zip(frames, sweeps, tracker.track(sweeps, results), strict=True):
                if any(instance.track > MOST_TRACKS for instance in result.instances):
                    raise LimitError(
                        f"track: more than {MOST_TRACKS:,} objects up to frame {each['frame']}, which is what a .label "
                        "can number; take parts of the drive by --frames, each to a folder of its own"
                    )
                yield each["frame"], placed, result


def remove_tracks(folder: Path) -> bool:
    """Remove the tracks that an earlier run noted in `folder`; True if there were some."""
    refuse_link(folder / TRACKS)
    files = _note(folder)["files"]
    for name in files:
        (folder / name).unlink(missing_ok=True)
    if files:
        (folder / TRACKS / TRACKS_STATE).unlink()
    with suppress(OSError):  # files of others stay, and so does what holds them
        (folder / TRACKS).rmdir()
    return bool(files)


def _note(folder: Path) -> dict[str, Any]:
    """What an earlier run noted of its tracks in `folder`."""
    try:
        with open_file(folder / TRACKS / TRACKS_STATE, "note of tracks", limit=LARGE_BYTES) as file:
            match json.loads(file.text()):
                case {"files": dict() as files, "made_of": str() as made_of}:
                    return {"files": {name: files[name] for name in files if _is_ours(name)}, "made_of": made_of}
    except (FileNotFoundError, ValueError, RecursionError):
        pass
    return {"files": {}, "made_of": None}


def _is_placed(record: Record) -> bool:
    return record["pose"] is not None and record["stamp"] is not None


def _place(frame: str, word: str) -> str:
    """Where a file of a frame is in the folder of the run."""
    return f"{TRACKS}/{file_name(frame, word)}"


def _is_ours(name: str) -> bool:
    """True for the name of a file that tracks have; nothing else is removed."""
    endings = tuple(file_name("", word) for word in TRACKED_FORMATS)
    return name in (TRACKS_TABLE, TRACKED_OBJECTS) or (
        name.startswith(f"{TRACKS}/") and name.endswith(endings) and len(Path(name).parts) == 2
    )


def digest_of_records(records: Iterable[Record]) -> str:
    """Digest of what is made into tracks, or a labelled bag: results of frames, their windows, stamps and poses."""
    digest = hashlib.sha256(_ldls.__version__.encode())
    for record in records:
        name = file_name(record["frame"], RESULT)
        parts = [record["frame"], record["files"].get(name), record["window"], record["stamp"], record["pose"]]
        digest.update(json.dumps(parts).encode())
    return digest.hexdigest()


def _rows(frame: str, placed: Sweep, result: Segmentation) -> Iterator[Sequence[object]]:
    """A row for each object with points."""
    for instance, each in zip(result.instances, result.objects, strict=True):
        if each.centroid is None:
            continue
        world = placed.pose[:3, :3] @ each.centroid + placed.pose[:3, 3]
        score = round(float(each.score), DECIMALS)
        place = [round(value, DECIMALS) for value in (*world.tolist(), *instance.velocity)]
        yield frame, instance.track, each.label, each.category, each.name, score, each.n_points, *place

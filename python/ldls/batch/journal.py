"""The journal of a run: a line a frame, appended when the files of the frame are safe on the disk.

The first line holds the settings that labels depend on; a run goes on only with the same ones, but may add frames, and
formats of their files. A journal in which no frame was ever done binds nobody: a run of other settings begins it anew.
The formats that were begun, and "tracks" where objects are numbered, are there as `written_formats`, before any file
is: what lies in their places afterwards is the run's own, recorded or not, and a format in whose places others' files
lie is not begun.
Frames are appended in the order in which they are finished, in groups, so that the disk need not be waited for after
each; the last line of a frame counts, and one that a crash cut off is dropped. When all is done the lines are put in
the order of the frames: every run of the same settings, formats and frames ends with the same bytes, whatever was done
first.

The line of a frame has its name, `frame`, and

- `files`: size and digest of each result;
- `inputs`: size, time of change and digest of each file that it was made of, as far as they are known;
- `window`: names of the frames that it was labelled together with, and its own;
- `stamp` and `pose`: time of its sweep in seconds, and T_world_lidar in four rows, or null where they are not known;
- `images`: name of the camera, height and width in pixels of each image;
- `objects`: a row of a table for each object with points (`ldls.Segmentation.to_table`);
- `nothing_in_view`: why nothing is labelled, or null;

or, where it failed, `error` with `stage`, `code` and `message`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from types import UnionType
from typing import IO, Any

import ldls._ldls as _ldls
from ldls.batch.known_files import is_written
from ldls.batch.poses import holds_found_poses
from ldls.errors import BatchError, CorruptFileError
from ldls.io.files import names_file, open_to_append, sync_folder, whole_file
from ldls.segmentation.objects import COLUMNS
from ldls.viewing.formats import ENDINGS, RESULT, TRACKS, file_name

JOURNAL_NAME = "journal.jsonl"
WRITTEN = (*ENDINGS, TRACKS)
"""What a journal notes that files of it were begun, in this order."""
LONGEST_LINE_BYTES = 1 << 24
Record = Mapping[str, Any]


class Journal:
    """The journal of a folder. Only where each line stands is kept in memory, for runs may have very many frames.

    Attributes:
        formats: The formats that runs in the folder have begun, this one included, and `TRACKS` if they have.
    """

    def __init__(self, folder: Path, header: Record, formats: Collection[str] = ()) -> None:
        """Begin a journal, or go on with the one there is, and note the `formats` that a run begins.

        Raises:
            BatchError: The one there is has frames that a run of other settings did.
            CorruptFileError: It is no journal.
            UnsafePathError: It is a link.
        """
        self._folder = folder
        self._path = folder / JOURNAL_NAME
        self._settings = header
        self._places: dict[str, int] = {}
        begun = formats_begun(folder) or ()
        self.formats = tuple(word for word in WRITTEN if word in formats or word in begun)
        self._file = open_to_append(self._path)
        try:
            self._end = self._read()
            # a line that was cut off makes room for whole ones
            self._file.truncate(self._end)
            if self._end == 0:
                self._append([self._header])
                sync_folder(folder)
            elif len(self.formats) > len(begun):
                self.finish(self.frames)
                self._file = open_to_append(self._path)
                self._end = self._path.stat().st_size
        except BaseException:
            self._file.close()
            raise

    @property
    def _header(self) -> Record:
        # the settings come first, so that a line cut off in the formats is known as ours
        return {**self._settings, "written_formats": self.formats}

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that have a record."""
        return tuple(self._places)

    def kept(self, frames: Iterable[str]) -> KeptRecords:
        """The records of those of `frames` that have one, for other processes; good until the journal is finished."""
        return KeptRecords(self._path, {frame: self._places[frame] for frame in frames if frame in self._places})

    def records(self, frames: Sequence[str]) -> Iterator[Record]:
        """Yield the records of `frames`; those without one are passed over."""
        with self._path.open("rb") as file:
            for frame in frames:
                if frame in self._places:
                    yield _record_at(file, self._places[frame])

    def stored(self, frames: Sequence[str], sound: Iterable[str]) -> tuple[list[str], list[str]]:
        """Those of `frames` whose result is stored as it was written, and those where it is missing or another.

        Frames that are not done, or were asked for no results, are neither. Each that nobody has looked at yet is read
        once, for its digest.

        Args:
            frames: Names of frames.
            sound: Those of them whose results, if they are done, this run wrote or found to be as they were written.

        Raises:
            OSError: A result cannot be read.
        """
        done = (record for record in self.records(frames) if "error" not in record)
        states = {record["frame"]: record["files"].get(file_name(record["frame"], RESULT)) for record in done}
        states = {name: state for name, state in states.items() if state is not None}
        seen = {*sound}
        unseen = [name for name in states if name not in seen]
        paths = [self._folder / file_name(name, RESULT) for name in unseen]
        with ThreadPoolExecutor(_ldls.default_threads()) as threads:
            are_whole = list(threads.map(is_written, paths, [states[name] for name in unseen]))
        gone = {name for name, is_whole in zip(unseen, are_whole, strict=True) if not is_whole}
        return [name for name in states if name not in gone], [name for name in unseen if name in gone]

    def add(self, records: Sequence[Record]) -> None:
        """Append what became of frames; their files and these lines are on the disk afterwards."""
        try:
            sync_folder(self._folder)
            places = self._append(records)
        except OSError as error:
            # a full disk takes half a line
            self._file.truncate(self._end)
            frames = " to ".join(dict.fromkeys([records[0]["frame"], records[-1]["frame"]]))
            hint = f"{error.strerror or error} while recording frame {frames}; mend it and give the same command again"
            raise OSError(error.errno, hint, str(self._path)) from error
        self._places.update(zip((record["frame"] for record in records), places, strict=True))

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def finish(self, order: Sequence[str]) -> None:
        """Put the lines in the `order` of the frames of the source, and let go of the file."""
        self.close()
        places: dict[str, int] = {}
        # those that the source has no more come last
        frames = [*order, *sorted(self._places.keys() - set(order))]
        with self._path.open("rb") as before, whole_file(self._path) as file:
            file.write(line_of(self._header))
            for frame in frames:
                if frame in self._places:
                    places[frame] = file.tell()
                    file.write(_line_at(before, self._places[frame]))
        self._places = places
        sync_folder(self._folder)

    def _append(self, records: Iterable[Record]) -> list[int]:
        """Return the offset of the line of each record."""
        lines = [line_of(record) for record in records]
        places = list(accumulate((len(line) for line in lines), initial=self._end))
        rest = memoryview(b"".join(lines))
        with names_file(self._path):
            while rest:
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        self._end = places.pop()
        return places

    def _read(self) -> int:
        """Find the lines there are; the number of bytes up to the end of the last whole one."""
        whole = 0
        with self._path.open("rb") as file:
            for number, line in enumerate(iter(lambda: file.readline(LONGEST_LINE_BYTES), b""), start=1):
                if not line.endswith(b"\n") and self._may_be_cut(line, number):
                    break
                record = _parsed(self._path, line, number)
                if number == 1:
                    if self._is_replaced(record, file):
                        break
                else:
                    self._places[record["frame"]] = whole
                whole += len(line)
        return whole

    def _may_be_cut(self, line: bytes, number: int) -> bool:
        """Return True for a line without an end that a run may have left; only our own are dropped."""
        return len(line) < LONGEST_LINE_BYTES and (number > 1 or line_of(self._header).startswith(line))

    def _is_replaced(self, header: Record, rest: Iterable[bytes]) -> bool:
        """Return True for the journal of a run of other settings that did no frame, as the `rest` of its lines tells.

        Raises:
            BatchError: The run of other settings did some.
        """
        differences = list(_differences({**header, "written_formats": self.formats}, self._header))
        # poses that the sweeps told are true of their source alone
        binds = holds_found_poses(self._folder) and header.get("source") != self._header["source"]
        if differences and (binds or not all(map(_is_failure, rest))):
            raise _of_other_settings(self._folder, differences)
        return bool(differences)


@dataclass(frozen=True)
class KeptRecords:
    """Records of a journal that are read when they are asked for.

    Attributes:
        path: The journal.
        places: Where the line of each frame begins.
    """

    path: Path
    places: Mapping[str, int]

    def get(self, frame: str) -> Record | None:
        """Return the record of a frame; None if it has none here."""
        place = self.places.get(frame)
        if place is None:
            return None
        with self.path.open("rb") as file:
            return _record_at(file, place)


def formats_begun(folder: Path) -> tuple[str, ...] | None:
    """The formats that runs in `folder` have begun, none without a journal; None where its first line does not say."""
    path = folder / JOURNAL_NAME
    if not path.is_file():
        return ()
    with path.open("rb") as file, suppress(ValueError, RecursionError):
        match json.loads(file.readline(LONGEST_LINE_BYTES)):
            case {"written_formats": [*words]}:
                return tuple(word for word in WRITTEN if word in words)
    return None


def check_goes_on(folder: Path, known: Record) -> None:
    """Refuse a folder with frames that a run of other settings did, before all settings of this one are known.

    Args:
        folder: The folder, with a journal or without.
        known: What its first line is to have, as far as it is known: keys of "settings" and of "source".

    Raises:
        BatchError: There are such frames.
        CorruptFileError: The journal is none.
    """
    path = folder / JOURNAL_NAME
    if not path.is_file():
        return
    with path.open("rb") as file:
        first = file.readline(LONGEST_LINE_BYTES)
        # one that was cut off, which no frames follow, is judged when the journal is opened
        header = _parsed(path, first, 1) if first.endswith(b"\n") else {}
        now = {
            key: {**before, **known[key]} if isinstance(before := header.get(key), dict) else known[key]
            for key in known
        }
        differences = [*_differences({key: header.get(key) for key in known}, now)]
        if differences and not all(map(_is_failure, file)):
            raise _of_other_settings(folder, differences)


def _of_other_settings(folder: Path, differences: Iterable[str]) -> BatchError:
    return BatchError(
        f"{folder}: holds a run of other settings: {'; '.join(differences)}; give the same command to go on with it "
        "(frames and formats may be added), or choose another folder"
    )


def _parsed(path: Path, line: bytes, number: int) -> Record:
    """Line `number` of the journal `path`, from 1."""
    try:
        record: Record = json.loads(line)
    except (ValueError, RecursionError) as error:
        found = str(error)
    else:
        if isinstance(record, dict) if number == 1 else _is_of_frame(record):
            return record
        found = f"expected a record of {'settings' if number == 1 else 'a frame'}, got {line[:60]!r}"
    raise CorruptFileError(
        f"{path}: line {number}: not a journal of ldls ({found}); choose another folder, or empty this one to do all "
        "frames again"
    )


def _is_failure(line: bytes) -> bool:
    """Return True for the whole line of a frame that failed; one that was cut off may be of frames that were done."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return False
    return line.endswith(b"\n") and _is_of_frame(record) and "error" in record


def _is_of_frame(record: object) -> bool:
    match record:
        case {"frame": str(), "error": {"stage": str(), "code": str(), "message": str(), **rest}}:
            return not rest
        case {
            "frame": str(),
            "files": dict() as files,
            "inputs": dict() as inputs,
            "window": list() as window,
            "stamp": int() | float() | None,
            "pose": None | [[*_], [*_], [*_], [*_]] as pose,
            "images": list() as images,
            "objects": list() as objects,
            "nothing_in_view": str() | None,
        }:
            return (
                all(_is_list_of(state, int, str) for state in files.values())
                and all(state is None or _is_list_of(state, int, int, str | None) for state in inputs.values())
                and all(isinstance(name, str) for name in window)
                and all(_is_list_of(row, *[int | float] * 4) for row in pose or ())
                and all(_is_list_of(image, str, int, int) for image in images)
                and all(isinstance(row, dict) and row.keys() == {*COLUMNS} for row in objects)
            )
    return False


def _is_list_of(value: object, *kinds: type | UnionType) -> bool:
    return isinstance(value, list) and len(value) == len(kinds) and all(map(isinstance, value, kinds))


def _record_at(file: IO[bytes], place: int) -> Record:
    record: Record = json.loads(_line_at(file, place))
    return record


def _line_at(file: IO[bytes], place: int) -> bytes:
    file.seek(place)
    return file.readline()


def line_of(record: Record) -> bytes:
    """The line of a record: the same bytes whatever order it was made in."""
    return json.dumps(record, sort_keys=True, separators=(",", ":")).encode() + b"\n"


def _differences(before: Any, now: Any, place: str = "") -> Iterable[str]:  # noqa: ANN401
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            yield from _differences(before.get(key), now.get(key), f"{place}.{key}" if place else key)
    elif before != now:
        yield f"{place} was {before!r}, is {now!r}"

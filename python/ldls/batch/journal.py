"""The journal of a run: a line a frame, appended when the files of the frame are safe on the disk.

The first line holds the settings; a run goes on only with the same ones. Frames are appended in the order in which
they are finished, in groups, so that the disk need not be waited for after each; a line that a crash cut off is
dropped. When all is done the lines are put in the order of the frames: every run of the same settings ends with the
same bytes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import IO, Any

from ldls.errors import BatchError, CorruptFileError
from ldls.io.files import names_file, sync_folder, whole_file

JOURNAL_NAME = "journal.jsonl"
Record = Mapping[str, Any]


class Journal:
    """The journal of a folder. Only where each line stands is kept in memory, for runs may have very many frames."""

    def __init__(self, folder: Path, header: Record) -> None:
        """Begin a journal, or go on with the one there is.

        Raises:
            BatchError: The one there is belongs to a run of other settings.
            CorruptFileError: It is no journal.
        """
        self._folder = folder
        self._path = folder / JOURNAL_NAME
        self._header = header
        self._places: dict[str, int] = {}
        self._file = self._path.open("ab+", buffering=0)
        try:
            self._end = self._read()
            # a line that was cut off makes room for whole ones
            self._file.truncate(self._end)
            if self._end == 0:
                self._append([header])
                sync_folder(folder)
        except BaseException:
            self._file.close()
            raise

    def get(self, frame: str) -> Record | None:
        """Return the record of a frame; None if it has none."""
        place = self._places.get(frame)
        if place is None:
            return None
        with self._path.open("rb") as file:
            return _record_at(file, place)

    def records(self, frames: Sequence[str]) -> Iterator[Record]:
        """Yield the records of `frames`; those without one are passed over."""
        with self._path.open("rb") as file:
            for frame in frames:
                if frame in self._places:
                    yield _record_at(file, self._places[frame])

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

    def finish(self, frames: Sequence[str]) -> None:
        """Put the lines in the order of `frames`; nothing is appended any more."""
        self.close()
        places: dict[str, int] = {}
        with whole_file(self._path) as file:
            file.write(_line(self._header))
            for record in self.records(frames):
                places[record["frame"]] = file.tell()
                file.write(_line(record))
        self._places = places
        sync_folder(self._folder)

    def _append(self, records: Iterable[Record]) -> list[int]:
        """Return the offset of the line of each record."""
        lines = [_line(record) for record in records]
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
            for line in file:
                if not line.endswith(b"\n"):
                    break
                try:
                    record = json.loads(line)
                    if whole > 0:
                        self._places[record["frame"]] = whole
                except (ValueError, KeyError, TypeError) as error:
                    message = f"{self._path}: not a journal of ldls ({error}); choose another folder"
                    raise CorruptFileError(message) from None
                if whole == 0:
                    self._check(record)
                whole += len(line)
        return whole

    def _check(self, header: Record) -> None:
        differences = list(_differences(header, self._header))
        if differences:
            raise BatchError(
                f"{self._folder}: holds a run of other settings: {'; '.join(differences)}; give the same command to go "
                "on with it, or choose another folder"
            )


def _record_at(file: IO[bytes], place: int) -> Record:
    file.seek(place)
    record: Record = json.loads(file.readline())
    return record


def _line(record: Record) -> bytes:
    return json.dumps(record, sort_keys=True, separators=(",", ":")).encode() + b"\n"


def _differences(before: Any, now: Any, place: str = "") -> Iterable[str]:  # noqa: ANN401
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            yield from _differences(before.get(key), now.get(key), f"{place}.{key}" if place else key)
    elif before != now:
        yield f"{place} was {before!r}, is {now!r}"

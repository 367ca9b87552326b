"""What a run has done: a line a frame, appended when the files of the frame are safe on the disk.

The first line holds the settings; a run goes on only with the same ones. Frames are appended in the order in which
they are finished, in groups, so that the disk need not be waited for after each; a line that a crash cut off is
dropped. When all is done the lines are put in the order of the frames: every run of the same settings ends with the
same bytes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from ldls.errors import BatchError, CorruptFileError
from ldls.io.whole_file import sync_folder, whole_file

JOURNAL_NAME = "journal.jsonl"
Record = Mapping[str, Any]


class Journal:
    """The journal of a folder.

    Attributes:
        records: What is known of each frame, by its name.
    """

    def __init__(self, folder: Path, header: Record) -> None:
        """Begin a journal, or go on with the one there is.

        Raises:
            BatchError: The one there is belongs to a run of other settings.
            CorruptFileError: It is no journal.
        """
        self._folder = folder
        self._path = folder / JOURNAL_NAME
        self._header = header
        self.records: dict[str, Record] = {}
        whole = 0
        if self._path.exists():
            whole = self._read()
        self._file: IO[bytes] = self._path.open("ab")
        # a line that was cut off makes room for whole ones
        self._file.truncate(whole)
        if whole == 0:
            self._append([header])
            sync_folder(folder)

    def add(self, records: Sequence[Record]) -> None:
        """Append what became of frames; their files and these lines are on the disk afterwards."""
        sync_folder(self._folder)
        self._append(records)
        self.records.update((record["frame"], record) for record in records)

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def finish(self, names: Sequence[str]) -> None:
        """Put the lines in the order of the frames `names`; nothing is appended any more."""
        self.close()
        ordered = [self._header, *(self.records[name] for name in names if name in self.records)]
        with whole_file(self._path) as file:
            file.writelines(_line(record) for record in ordered)
        sync_folder(self._folder)

    def _append(self, records: Iterable[Record]) -> None:
        self._file.write(b"".join(_line(record) for record in records))
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self) -> int:
        """Read what there is; the number of bytes up to the end of the last whole line."""
        content = self._path.read_bytes()
        whole = content.rfind(b"\n") + 1
        lines = content[:whole].splitlines()
        if not lines:
            return 0
        try:
            header, *records = [json.loads(line) for line in lines]
            self.records = {record["frame"]: record for record in records}
        except (ValueError, KeyError, TypeError) as error:
            raise CorruptFileError(f"{self._path}: not a journal of ldls ({error}); choose another folder") from None
        differences = list(_differences(header, self._header))
        if differences:
            raise BatchError(
                f"{self._folder}: holds a run of other settings: {'; '.join(differences)}; give the same command to go "
                "on with it, or choose another folder"
            )
        return whole


def _line(record: Record) -> bytes:
    return json.dumps(record, sort_keys=True, separators=(",", ":")).encode() + b"\n"


def _differences(before: Any, now: Any, place: str = "") -> Iterable[str]:  # noqa: ANN401
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            yield from _differences(before.get(key), now.get(key), f"{place}.{key}" if place else key)
    elif before != now:
        yield f"{place} was {before!r}, is {now!r}"

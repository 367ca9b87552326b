"""The stored results of a run that tracks, maps and labelled bags are made of: those that are as its journal says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import ldls._ldls as _ldls
from ldls.batch.journal import Journal, Record
from ldls.batch.known_files import is_written
from ldls.errors import some
from ldls.viewing.formats import RESULT, file_name


class StoredResults:
    """The results of the frames that are done; each that nobody has looked at yet is read once, for its digest.

    Attributes:
        left_out: Frames whose result is missing, or is not the one that the run wrote, in the order of the source.
    """

    def __init__(self, journal: Journal, folder: Path, names: Sequence[str], sound: Iterable[str]) -> None:
        """Find the results in `folder` of the frames of these names, as far as they are done.

        Args:
            journal: Says which are done, and how results were written.
            folder: Folder of the run.
            names: Names of all frames of the source, in its order.
            sound: Those of them whose results, if they are done, this run wrote or found to be as they were written.

        Raises:
            OSError: A result cannot be read.
        """
        done = (record for record in journal.records(names) if "error" not in record)
        states = {record["frame"]: record["files"].get(file_name(record["frame"], RESULT)) for record in done}
        # a run that was asked for no results of some frames has none of them
        states = {name: state for name, state in states.items() if state is not None}
        seen = {*sound}
        unseen = [name for name in states if name not in seen]
        with ThreadPoolExecutor(_ldls.default_threads()) as threads:
            are_whole = threads.map(lambda name: is_written(folder / file_name(name, RESULT), states[name]), unseen)
            self.left_out = [name for name, is_whole in zip(unseen, are_whole, strict=True) if not is_whole]
        self._journal, self._folder = journal, folder
        gone = {*self.left_out}
        self._names = [name for name in states if name not in gone]

    def records(self) -> Iterator[Record]:
        """The journal's records of the frames whose result is as it was written, in the order of the source."""
        return self._journal.records(self._names)

    def doubt(self) -> str:
        """What is to be said of the frames that are left out, if there are any."""
        return (
            f"{self._folder}: results (.{RESULT}) of {len(self.left_out):,} frames outside --frames "
            f"({some(self.left_out)}) are missing, or were changed since they were written; they are left out of "
            "tracks, map and bag; run them again, by the same command without --frames or with these in it"
        )

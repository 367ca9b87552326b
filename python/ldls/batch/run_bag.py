"""The labelled bag of a run: one for all frames of a ROS bag, made of their stored results when they are done."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from ldls.batch.journal import Record
from ldls.batch.run_tracks import digest_of_records
from ldls.datasets import Source
from ldls.datasets.rosbag import RosBag
from ldls.errors import BatchError, FileFormatError, ParameterError
from ldls.io import read_result
from ldls.io.files import open_file, whole_file
from ldls.io.labelled_bag import TOPIC, LabelledBag
from ldls.io.ros.bags import open_bag
from ldls.io.ros.writer import UNFINISHED_BAG
from ldls.viewing.formats import RESULT, file_name

NAME, NOTE = "labelled", ".ldls-bag"
"""The bag, and the file that says what it was made of."""
MARGIN_NS = 1_000_000_000
"""Images and transforms from so long before the first sweep to so long after the last are copied."""


class RunBag:
    """The labelled bag in the folder of a run; under its name it is whole.

    Its labelled clouds have the stamps and frames of their sweeps, and are received when these were. Beside them are
    the images, calibrations and transforms that the frames are made of, over the same time.

    Attributes:
        path: A folder, or a file for ROS 1.
    """

    def __init__(self, source: Source, folder: Path, tracks: Path | None = None) -> None:
        """The bag of the frames of `source` in `folder`, of their results with tracks where there are some in `tracks`.

        Raises:
            ParameterError: The source is no ROS bag.
        """
        if not isinstance(source, RosBag):
            raise ParameterError(
                f"formats: bag is a ROS bag with labels, made of one without; {source.path} is of kind {source.kind}; "
                "leave it out, and write npz, pcd or ply"
            )
        self._source, self._folders = source, [folder] if tracks is None else [tracks, folder]
        self._folder = folder
        self.path = folder / (NAME if source.storage != "rosbag1" else f"{NAME}.bag")

    def check_place(self) -> None:
        """Refuse to write where there is something else than an earlier bag of the run; sweep what was left of one.

        Raises:
            BatchError: There is.
        """
        for left in self._folder.glob(f".{self.path.name}.*{UNFINISHED_BAG}"):
            shutil.rmtree(left, ignore_errors=True)
        if self.path.exists() and self._n_clouds() is None:
            raise BatchError(
                f"{self.path}: is there and is no bag of labelled clouds; remove it, or choose another folder"
            )

    def write(self, records: Callable[[], Iterable[Record]]) -> None:
        """Write the bag of the frames that are done, in the order of the source; one that was made of the same stays.

        Args:
            records: Gives the journal's records of the frames that have a stored result.

        Raises:
            CorruptFileError: The source is damaged.
            LimitError: A category id is beyond 255.
            OSError: It cannot be written, as on a full disk; nothing of it stays.
        """
        done = {record["frame"] for record in records()}
        tracked = [folder.name for folder in self._folders[:-1]]
        made_of = " ".join([digest_of_records(records()), *tracked]).encode()
        if self._note() == made_of and self._n_clouds() == len(done):
            return
        self.remove()
        if not done:
            return
        chosen = [index for index, name in enumerate(self._source.names) if name in done]
        received = [self._source.received_ns(index) for index in chosen]
        with LabelledBag(self.path, self._source.storage) as bag:
            bag.copy(
                self._source.path,
                topics=self._source.companions(),
                recover=self._source.recover,
                span_ns=(min(received) - MARGIN_NS, max(received) + MARGIN_NS),
            )
            for index, received_ns in zip(chosen, received, strict=True):
                name = file_name(self._source.names[index], RESULT)
                # frames without a pose have no tracks
                path = next(folder / name for folder in self._folders if (folder / name).is_file())
                bag.write(read_result(path), self._source.header(index), received_ns=received_ns)
        with whole_file(self._folder / NOTE) as file:
            file.write(made_of)

    def remove(self) -> bool:
        """Remove the bag, and nothing else that may be there; True if there was one."""
        was_there = self._n_clouds() is not None
        if was_there:
            # at once: of a run that is killed meanwhile no part stays under its name
            gone = self._folder / f".{self.path.name}.gone{UNFINISHED_BAG}"
            _delete(gone)
            self.path.rename(gone)
            _delete(gone)
        (self._folder / NOTE).unlink(missing_ok=True)
        return was_there

    def has_tracks(self) -> bool:
        """True if the bag that is there was made of results with tracks."""
        return b" " in (self._note() or b"")

    def _note(self) -> bytes | None:
        """What the bag that is there was made of; None where nothing says it."""
        try:
            with open_file(self._folder / NOTE, "note of the bag") as file:
                return file.read()
        except FileNotFoundError:
            return None

    def _n_clouds(self) -> int | None:
        """Number of labelled clouds in the bag that is there; None without any."""
        try:
            bag = open_bag(self.path)
        except (FileFormatError, FileNotFoundError):
            return None
        try:
            return bag.topics[TOPIC].count if TOPIC in bag.topics else None
        finally:
            bag.close()


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)

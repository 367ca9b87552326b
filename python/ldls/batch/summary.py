"""The summary of a run."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ldls.categories import folded
from ldls.io.files import whole_file
from ldls.io.objects import FrameObjects


@dataclass(frozen=True)
class Failure:
    """A frame that yielded nothing.

    Attributes:
        frame: Its name.
        stage: Where it failed: "read", "masks", "segment" or "write"; "worker" if those that did it died.
        code: Stable code of the error, as "corrupt_file".
        message: What was wrong.
    """

    frame: str
    stage: str
    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Counts of a run, earlier parts of it included.

    Attributes:
        n_frames: Frames wanted.
        n_done: Frames whose files are written.
        n_earlier: Of these, those of earlier runs that were interrupted.
        n_nothing_in_view: Of those done, frames whose returns are not finite, out of view, or on no mask.
        failures: Frames that failed, in their order.
        objects: Objects with points of the frames wanted, each counted in every frame, by category name; where objects
            are numbered over the drive, those of the results with tracks.
        tracks: The same, each counted once, by the name that it has last in these frames; none without tracks.
        seconds: Time of each stage, added up over the frames of this run.
        elapsed: Time of this run in seconds.
    """

    n_frames: int
    n_done: int
    n_earlier: int
    n_nothing_in_view: int
    failures: tuple[Failure, ...]
    objects: Mapping[str, int]
    tracks: Mapping[str, int] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    elapsed: float = 0.0

    @property
    def frames_per_second(self) -> float:
        """Frames of this run a second."""
        return (self.n_done - self.n_earlier) / self.elapsed if self.elapsed > 0 else 0.0


FAILURES_NAME = "failures.jsonl"


def failures_of(records: Iterable[Mapping[str, Any]]) -> tuple[Failure, ...]:
    """The frames that failed."""
    return tuple(Failure(record["frame"], **record["error"]) for record in records if "error" in record)


def doubts_of(records: Iterable[Mapping[str, Any]]) -> dict[str, list[str]]:
    """The frames of which nothing is labelled, by the likely cause."""
    doubts: defaultdict[str, list[str]] = defaultdict(list)
    for record in records:
        if record.get("nothing_in_view") is not None:
            doubts[record["nothing_in_view"]].append(record["frame"])
    return dict(doubts)


def write_failures(folder: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write a line of JSON for each frame that failed to `folder`; no file where none did."""
    path, failures = folder / FAILURES_NAME, failures_of(records)
    if not failures:
        path.unlink(missing_ok=True)
        return
    with whole_file(path) as file:
        file.writelines(json.dumps(asdict(failure)).encode() + b"\n" for failure in failures)


def objects_of(records: Iterable[Mapping[str, Any]]) -> Iterator[FrameObjects]:
    """Yield the objects of the frames that are done."""
    for record in records:
        if "error" not in record:
            yield FrameObjects(record["frame"], record["images"], record["objects"])


def count_objects(records: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Objects with points of all frames, by category name as it is spelled first, the most frequent first."""
    spelled: dict[str, str] = {}
    total: Counter[str] = Counter()
    for record in records:
        total.update(spelled.setdefault(folded(row["name"]), row["name"]) for row in record.get("objects", ()))
    return dict(total.most_common())


def count_tracks(records: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Tracks that these frames show, by the name that each has last in them, the most frequent first."""
    rows = (row for record in records for row in record.get("objects", ()) if row["track"])
    names = {row["track"]: row["name"] for row in rows}
    return dict(Counter(names.values()).most_common())

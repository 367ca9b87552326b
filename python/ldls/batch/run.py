"""A run over the frames of a source, from the first frame to the summary."""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

import ldls._ldls as _ldls
from ldls.batch.engines import Engine, open_engine
from ldls.batch.frame_work import Earlier, FrameWork
from ldls.batch.journal import Journal, Record, formats_begun
from ldls.batch.lock import only_run
from ldls.batch.odometry import with_odometry
from ldls.batch.plan import check_apart, check_names, check_places, chosen_of, open_for_run, windows_of
from ldls.batch.poses import Poses
from ldls.batch.run_bag import NOTE, RunBag
from ldls.batch.run_tracks import TRACKS_TABLE, RunTracks, remove_tracks
from ldls.batch.settings import RunSettings
from ldls.batch.summary import (
    FAILURES_NAME,
    Summary,
    count_objects,
    count_tracks,
    doubts_of,
    failures_of,
    objects_of,
    write_failures,
)
from ldls.batch.window import Frames, Outcome
from ldls.checks import checked
from ldls.datasets import Source
from ldls.datasets.stored_masks import fill
from ldls.errors import (
    ChangedFileWarning,
    LdlsWarning,
    LeftOutWarning,
    NothingInView,
    NoUsablePoints,
    ParameterError,
    some,
)
from ldls.io.files import check_outputs, make_folder, remove_unfinished
from ldls.io.objects import objects_writer
from ldls.sequences.trajectory import LONGEST_GAP_S
from ldls.viewing.formats import BAG, ENDINGS, RESULT, TRACKS

GROUP_S = 0.5
"""Frames finished within this time share a wait for the disk."""

Progress = Callable[[int, int, int], None]
"""Called with the frames done, those of them that failed, and all frames."""


@checked
def run(
    source: Source | str | PathLike[str],
    out: str | PathLike[str],
    settings: RunSettings,
    *,
    frames: slice = slice(None),
    options: Mapping[str, Any] | None = None,
    objects: str | PathLike[str] | None = None,
    map_file: str | PathLike[str] | None = None,
    workers: int | None = None,
    engine: str | Engine = "local",
    ray_address: str | None = None,
    gpus: float = 0.0,
    on_progress: Progress | None = None,
) -> Summary:
    """Label the frames of a source, and write the files of each to the folder `out`.

    Files appear under their name only when they are whole. A journal in `out` knows what is done: a run that was
    interrupted, however it was, goes on where it stopped when it is called again in the same way, and one that is
    finished does what is missing when frames or formats are added. A frame that fails is recorded and passed over, and
    tried again by the next call. With `settings.sweeps`, frames in a row are labelled together; such a window is done
    again as a whole where one of its frames is.

    Args:
        source: A source of `ldls.datasets`, or a path that one is guessed from.
        out: Folder for the results; made if need be.
        settings: How frames are treated.
        frames: Which frames of the source, in its order.
        options: Options of the source's kind, for `ldls.datasets.open_source`. Of a source that is open already, those
            that it was opened with: a run goes on only with the same ones.
        objects: A `.csv` or `.json` file for one table of the objects of all frames, in the order of the frames, as
            `ldls.save_objects` writes it; it is written at the end, of what earlier runs did, too.
        map_file: A `.ply`, `.pcd`, `.las` or `.laz` file for what stands still in the drive (`ldls.LabelledMap`), as
            all frames tell that are done; needs `settings.track`.
        workers: Frames, or windows of them, segmented at a time; as many as the process, or the cluster, may use cores
            by default.
        engine: Where they are segmented: "local", "ray", or an engine of your own.
        ray_address: Address of the Ray cluster to join; by default one is started on this machine.
        gpus: GPUs that a worker of the Ray cluster needs for its segmenter.
        on_progress: Called when it is known how many frames earlier runs did, and after each frame.

    Returns:
        What came of it; frames that failed are in its `failures`.

    Raises:
        BatchError: Another run is at work in `out`, or `out` holds frames done by one of other settings, source or
            version, or files that no run wrote in the places of results, as inputs.
        CorruptFileError: The journal in `out` is none.
        ParameterError: The source has none of the `frames`, or they go backwards, masks of one image are given for
            several, a map is asked for, and no tracks, `objects` or `map_file` is the name of a file of the run, or a
            segmenter or a file of all masks has no such category.
        InputError: An argument is of another type, or `objects` or `map_file` is an input.
        UnsupportedFormatError: `objects` ends in neither `.csv` nor `.json`, or `map_file` in no format of maps.
        UnsafePathError: A frame's name is no file name, a link lies in the place of the lock or the journal, or `out`
            is one that leads nowhere.
        PoseError: Sweeps are to be joined or objects tracked, and frames have no stamps or poses.
        LimitError: There are more tracks than 16 bits number.
        ImportError: The engine, or the tracks, need an extra that is not installed.
        OSError: The results cannot be written, as on a full disk; what is written stays, and the run can go on.
        KeyboardInterrupt: It was interrupted; failures.jsonl has the frames that failed until then.
    """
    options = dict(options or {})
    opened = open_for_run(source, settings, **options) if isinstance(source, str | PathLike) else source
    runner = open_engine(engine, workers=workers, ray_address=ray_address, gpus=gpus)
    chosen = chosen_of(opened, frames)
    names = [name for _, name in chosen]
    check_names(names, settings.frame_formats)
    settings.check_images(len(chosen), len(opened.camera_names))
    write_objects = None if objects is None else objects_writer(objects)
    folder = Path(out)
    _check_files(opened, settings, folder, {"objects": objects, "map_file": map_file})
    tracks = _tracks(settings, folder, names, map_file)
    with_tracks = None if tracks is None else tracks.folder
    bag = RunBag(opened, folder, with_tracks) if BAG in settings.formats else None
    of_source = {
        "kind": opened.kind,
        "path": str(Path(opened.path).resolve()),
        "options": {name: str(value) for name, value in sorted(options.items())},
    }
    settings = with_odometry(opened, settings, folder, of_source)
    poses = Poses(opened, settings)
    poses.check(chosen)
    windows = _windows(opened, chosen, poses.stamps, settings.sweeps)
    make_folder(folder)
    with only_run(folder):
        remove_unfinished(folder)
        if bag is not None:
            bag.check_place()
        work = FrameWork(opened, settings, folder)
        header = {"settings": settings.record() | work.digests, "source": of_source}
        journal = Journal(folder, header, (*settings.frame_formats, *([TRACKS] if settings.track else [])))
        try:
            check_names(sorted({*names, *journal.frames}), [word for word in journal.formats if word in ENDINGS])
            # what an earlier run did must still be there, and of the same input
            pending = _pending(windows, work, journal)
            to_do = [name for window in pending for _, name in window]
            work.records = journal.kept(to_do)
            n_earlier = len(chosen) - len(to_do)
            report = on_progress or (lambda *_: None)
            report(n_earlier, 0, len(names))
            start = time.perf_counter()
            seconds: Counter[str] = Counter()
            n_finished, n_failed = n_earlier, 0
            outdate = partial(_outdate, opened, settings, folder)
            recorded = _recorded(runner(work, pending), journal, work, outdate)
            with warnings.catch_warnings(), closing(recorded) as outcomes:
                # said of all frames at once, below
                warnings.simplefilter("ignore", NothingInView)
                warnings.simplefilter("ignore", NoUsablePoints)
                for outcome in outcomes:
                    seconds.update(outcome.seconds)
                    n_finished += len(outcome.records)
                    n_failed += sum("error" in record for record in outcome.records)
                    report(n_finished, n_failed, len(names))
        except KeyboardInterrupt:
            write_failures(folder, journal.records(opened.names))
            raise
        finally:
            journal.close()
        elapsed = time.perf_counter() - start
        journal.finish(opened.names)
        failures = failures_of(journal.records(names))
        write_failures(folder, journal.records(opened.names))
        # workers of a killed run may have outlived it for a moment
        remove_unfinished(folder)
        # results of the frames of this run were looked at before, or written
        outdate_bag = partial(_outdate_bag, opened, settings, folder, of_tracks=True)
        left_out = _write_of_all(tracks, bag, journal, folder, opened.names, names, outdate_bag)
        if write_objects is not None:
            write_objects(objects_of(_found(journal, names, tracks)))
        n_objects = count_objects(_found(journal, names, tracks))
        n_tracks = count_tracks(_found(journal, names, tracks))
    for message in left_out:
        warnings.warn(message, LeftOutWarning, stacklevel=3)
    doubts = doubts_of(journal.records(names))
    for doubt, frames_in_doubt in doubts.items():
        message = f"{len(frames_in_doubt):,} of {len(names):,} frames ({some(frames_in_doubt)}): {doubt}"
        warnings.warn(message, NothingInView, stacklevel=3)
    return Summary(
        n_frames=len(names),
        n_done=sum("error" not in record for record in journal.records(names)),
        n_earlier=n_earlier,
        n_nothing_in_view=sum(map(len, doubts.values())),
        failures=failures,
        objects=n_objects,
        tracks=n_tracks,
        seconds=dict(seconds),
        elapsed=elapsed,
    )


def _check_files(
    source: Source, settings: RunSettings, folder: Path, of_all: Mapping[str, str | PathLike[str] | None]
) -> None:
    """Refuse to write over files that no run wrote in `folder`, over inputs, or two files in one place.

    Args:
        source: The frames.
        settings: How they are treated.
        folder: Folder of the results.
        of_all: The files of all frames, by the arguments that name them; None for one that is not asked for.

    Raises:
        BatchError: Something that no run wrote is in the place of a result.
        InputError: A file of all frames is an input.
        ParameterError: It has the name of a file of the run.
        FileNotFoundError: Its folder is not there.
    """
    begun = formats_begun(folder)
    # a journal that was cut off, or is none, is judged when it is opened
    if begun is not None:
        tables = [FAILURES_NAME] if not begun else []
        tables += [TRACKS, TRACKS_TABLE] if settings.track and TRACKS not in begun else []
        check_places(folder, source.names, settings.frame_formats, begun, tables)
    asked = {name: Path(path) for name, path in of_all.items() if path is not None}
    check_outputs({name: [path] for name, path in asked.items()}, _inputs(source, settings), made=folder)
    check_apart(asked, folder, source.names)


def _windows(source: Source, chosen: Frames, stamps: Sequence[float | None], sweeps: int) -> list[Frames]:
    """The windows of `windows_of`; warns if each of several sweeps that were to be joined is alone in its own."""
    windows = windows_of(chosen, stamps, sweeps)
    known = [stamp for index, _ in chosen if (stamp := stamps[index]) is not None]
    if sweeps and len(windows) == len(chosen) and len(known) > 1:
        gap_s = np.median(np.diff(known))
        message = (
            f"{source.path}: no sweep comes later than the one before by {LONGEST_GAP_S:g} s or less (median gap "
            f"{gap_s:g} s), so that each is labelled alone; are stamps in seconds, and frames of --frames close enough?"
        )
        warnings.warn(message, LdlsWarning, stacklevel=4)
    return windows


def _inputs(source: Source, settings: RunSettings) -> Iterator[str | PathLike[str] | None]:
    """Files that a run reads, and the folders of its masks."""
    yield settings.poses
    for index in range(len(source)):
        yield from source.files(index)
    images = [(frame, camera) for frame in source.names for camera in source.camera_names]
    yield from dict.fromkeys(settings.segmenter_file(*image) for image in images)
    if settings.masks is not None:
        place = fspath(settings.masks)
        yield from dict.fromkeys(fill(place, *image) for image in images)
        # a folder has one for each of several cameras
        yield from (Path(place) / camera for camera in source.camera_names)


def _tracks(
    settings: RunSettings, folder: Path, names: Sequence[str], map_file: str | PathLike[str] | None
) -> RunTracks | None:
    """The tracks of a run, and its map, where they are asked for."""
    if settings.track:
        formats = (*settings.formats, RESULT) if BAG in settings.formats else settings.formats
        return RunTracks(folder, names, formats, None if map_file is None else Path(map_file))
    if map_file is not None:
        raise ParameterError(f"map_file: {map_file} is without what moves, which tracks tell; add --track")
    return None


def _write_of_all(
    tracks: RunTracks | None,
    bag: RunBag | None,
    journal: Journal,
    folder: Path,
    frames: Sequence[str],
    sound: Sequence[str],
    before: Callable[[], None],
) -> list[str]:
    """Write the tracks, and the bag, which has them, of all frames that are stored; a line for those left out."""
    if tracks is None and bag is None:
        return []
    there, gone = journal.stored(frames, sound)
    records = partial(journal.records, there)
    # a bag of other tracks must not outlive a run that is killed
    unplaced = [] if tracks is None else tracks.write(records, before)
    if bag is not None:
        bag.write(records)
    no_pose = f"{len(unplaced):,} frames ({some(unplaced)}) have no pose, and are left out of the tracks"
    no_result = (
        f"{folder}: results (.{RESULT}) of {len(gone):,} frames outside --frames ({some(gone)}) are missing, or were "
        "changed since they were written; they are left out of tracks, map and bag; run them again, by the same "
        "command without --frames or with these in it"
    )
    return [*([no_pose] if unplaced else []), *([no_result] if gone else [])]


def _found(journal: Journal, names: Sequence[str], tracks: RunTracks | None) -> Iterator[Record]:
    """The records of frames, with their objects as they are tracked, if they are."""
    records = journal.records(names)
    return records if tracks is None else tracks.objects(records)


def _pending(windows: Sequence[Frames], work: FrameWork, journal: Journal) -> list[Frames]:
    """The windows that an earlier run left to do; warns of frames whose files were changed since."""
    together = {name: [each for _, each in window] for window in windows for _, name in window}
    records = journal.kept(together)
    with ThreadPoolExecutor(_ldls.default_threads()) as threads:
        judged = threads.map(lambda name: work.judge_earlier(records.get(name), together[name]), together)
        left = dict(zip(together, judged, strict=True))
    changed = [name for name, earlier in left.items() if earlier is Earlier.CHANGED]
    if changed:
        message = (
            f"{work.out}: files of {len(changed):,} frames were changed since they were written ({some(changed)}); "
            "these frames are done again"
        )
        warnings.warn(message, ChangedFileWarning, stacklevel=4)
    return [window for window in windows if any(left[name] is not Earlier.DONE for _, name in window)]


def _recorded(
    outcomes: Generator[Outcome], journal: Journal, work: FrameWork, outdate: Callable[[], None]
) -> Generator[Outcome]:
    """The outcomes, their records in the journal within `GROUP_S` or by the end, however it comes.

    `outdate` is called before those of frames that have other labels than they had.
    """
    waiting: list[Record] = []
    since = time.monotonic()
    # whoever keeps an error of the journal would keep the engine at work
    with closing(outcomes):
        try:
            for outcome in outcomes:
                if work.has_other_labels(outcome):
                    outdate()
                waiting.extend(outcome.records)
                if time.monotonic() - since > GROUP_S:
                    _flush(journal, waiting)
                    since = time.monotonic()
                yield outcome
        finally:
            _flush(journal, waiting)


def _outdate(source: Source, settings: RunSettings, folder: Path) -> None:
    """Remove the tracks of earlier labels, where this run writes none anew, with a warning, and the bag."""
    if not settings.track and remove_tracks(folder):
        message = (
            f"{folder}: frames are labelled together with others than before; removed {TRACKS}/ and {TRACKS_TABLE} "
            "(--track makes them again)"
        )
        warnings.warn(message, LdlsWarning, stacklevel=5)
    _outdate_bag(source, settings, folder)


def _outdate_bag(source: Source, settings: RunSettings, folder: Path, *, of_tracks: bool = False) -> None:
    """Remove the bag of earlier labels, or if it has earlier tracks, with a warning where this run writes none anew."""
    if not (folder / NOTE).is_file():
        return
    bag = RunBag(source, folder)
    if of_tracks and not bag.has_tracks():
        return
    if bag.remove() and BAG not in settings.formats:
        message = f"{bag.path}: labels or tracks are others than before; removed (--formats bag makes it again)"
        warnings.warn(message, LdlsWarning, stacklevel=6)


def _flush(journal: Journal, waiting: list[Record]) -> None:
    records: Sequence[Record] = tuple(waiting)
    waiting.clear()
    if records:
        journal.add(records)

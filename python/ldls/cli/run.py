"""`ldls run`: all frames of a source."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ldls.cli.mask_options import (
    CategoriesOption,
    FrameSegmenterOption,
    MinScoreOption,
    chosen_categories,
    say_own_masks,
)
from ldls.cli.messages import console, in_options, speaks_plainly
from ldls.cli.method_options import takes_params
from ldls.cli.options import (
    FRAMES_FAILED,
    STOPPED,
    CoresOption,
    FormatsOption,
    ObjectsOption,
    OutOption,
    words,
)
from ldls.cli.progress import frame_progress
from ldls.cli.source_options import DatasetOption, SourceArgument, SourceOption, StoredMasksOption, parse_options
from ldls.params import Params

if TYPE_CHECKING:
    from ldls.batch import Summary

MOST_LISTED = 10


@speaks_plainly
@takes_params
def run(
    *,
    source: SourceArgument,
    out: OutOption,
    masks: StoredMasksOption = None,
    segmenter: FrameSegmenterOption = None,
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
    formats: FormatsOption = "npz,label",
    objects: ObjectsOption = None,
    frames: Annotated[
        str | None,
        typer.Option(metavar="START:STOP:STEP", help="Which frames, from 0: 100:500:5.", show_default="all"),
    ] = None,
    dataset: DatasetOption = None,
    option: SourceOption = None,
    cores: CoresOption = None,
    sweeps: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            help="Label 2 N + 1 sweeps in a row together; 2 is a good number. The drive needs stamps and poses.",
            show_default="0, each frame alone",
        ),
    ] = 0,
    track: Annotated[
        bool,
        typer.Option(
            "--track", help="Number objects over the drive: results in OUT/tracks, and OUT/tracks.csv. Extra eval."
        ),
    ] = False,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="FILE",
            help="Map of what stands still in the drive, in voxels of 0.1 m: .ply, .pcd, .las or .laz. Needs --track.",
            show_default=False,
            dir_okay=False,
        ),
    ] = None,
    poses: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|kiss-icp",
            help="Poses instead of the source's: of the lidar (TUM), or of camera 0 (KITTI: 12 numbers a line, a "
            "line a frame; a lidar's own are given as TUM); kiss-icp finds them from the sweeps (extra odometry).",
            show_default="those of the source",
        ),
    ] = None,
    engine: Annotated[
        str, typer.Option(metavar="NAME", help="local, or ray for a Ray cluster; docs/scale.md.")
    ] = "local",
    ray_address: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Cluster to join, as auto or ray://HOST:10001.", show_default="one on this machine"
        ),
    ] = None,
    gpus: Annotated[
        float, typer.Option(metavar="X", help="GPUs of each worker of a Ray cluster, for its segmenter.")
    ] = 0.0,
    params: Params,
) -> None:
    """Label all frames of a source; a run that was interrupted goes on where it stopped.

    Files appear in --out only when they are whole, and a journal there knows which frames are done: give the same
    command again to go on. A frame that fails is listed in failures.jsonl and passed over; the exit status is then 2.

    With --sweeps, frames of a drive in a row are labelled together; with --track, an object keeps its number over the
    drive.

    Examples:
    ldls run kitti/training --masks kitti/training/masks --out labels

    ldls run 2011_09_26/2011_09_26_drive_0064_sync --segmenter onnx:yolo11n-seg.onnx --out labels --formats npz,ply

    ldls run 2011_09_26/2011_09_26_drive_0064_sync --segmenter onnx:yolo11n-seg.onnx --out labels --sweeps 2 --track
    """
    import ldls.batch as batch
    from ldls.batch.plan import open_for_run, parse_frames

    settings = batch.RunSettings(
        masks=masks,
        segmenter=segmenter,
        min_score=min_score,
        categories=chosen_categories(categories),
        params=params,
        formats=words(formats),
        sweeps=sweeps,
        poses=poses,
        track=track,
    )
    options = parse_options(option or [])
    opened = open_for_run(source, settings, kind=dataset, **options)
    chosen = parse_frames(frames)
    say_own_masks(opened, masks, segmenter)
    counted: tuple[int, ...] | None = None
    with frame_progress("labelling", resumes=True) as show_progress:

        def on_progress(*counts: int) -> None:
            nonlocal counted
            counted = counts
            show_progress(*counts)

        try:
            summary = batch.run(
                opened,
                out,
                settings,
                frames=chosen,
                options=options,
                objects=objects,
                map_file=map_file,
                workers=cores,
                engine=engine,
                ray_address=ray_address,
                gpus=gpus,
                on_progress=on_progress,
            )
        except KeyboardInterrupt:
            of_all = {"tracks": track, "map": map_file, "bag": "bag" in settings.formats, "table of objects": objects}
            done = _done(counted, [word for word, value in of_all.items() if value])
            typer.echo(f"stopped: {done}; give the same command again to go on", err=True)
            raise typer.Exit(STOPPED) from None
    show(summary, out)
    if objects is not None:
        console().print(f"objects in {objects}", soft_wrap=True)
    if track:
        console().print(f"tracks in {out / 'tracks'} and {out / 'tracks.csv'}", soft_wrap=True)
    if map_file is not None:
        console().print(f"map in {map_file}", soft_wrap=True)
    if summary.failures:
        raise typer.Exit(FRAMES_FAILED)


def show(summary: Summary, out: Path) -> None:
    """Print what came of a run."""
    screen = console()
    if summary.objects:
        screen.print(object_counts(summary))
    if summary.seconds:
        screen.print(stage_times(summary))
    failed = [
        f"{each.frame} failed ({each.stage}): {in_options(each.message)}" for each in summary.failures[:MOST_LISTED]
    ]
    more = len(summary.failures) - MOST_LISTED
    if more > 0:
        failed.append(f"and {more} more; {out / 'failures.jsonl'} has all")
    for line in failed:
        typer.secho(line, err=True, fg="red")
    counts = [f"{summary.n_done:,} of {summary.n_frames:,} frames done"]
    if summary.n_earlier:
        counts.append(f"{summary.n_earlier:,} of them by earlier runs")
    if summary.failures:
        counts.append(f"{len(summary.failures):,} failed")
    if summary.n_nothing_in_view:
        counts.append(f"{summary.n_nothing_in_view:,} with nothing in view")
    if summary.seconds:
        counts.append(f"{summary.frames_per_second:.1f} frames a second")
    screen.print(f"{', '.join(counts)}; results in {out}", soft_wrap=True)


def object_counts(summary: Summary) -> Table:
    """Objects with points of each category: in each frame, added up, and over the drive where they are numbered."""
    counts = {"objects": summary.objects} | ({"tracks": summary.tracks} if summary.tracks else {})
    table = Table(title="objects found")
    table.add_column("category")
    for heading in counts:
        table.add_column(heading, justify="right")
    for name in {**summary.objects, **summary.tracks}:
        table.add_row(name, *(f"{count.get(name, 0):,}" for count in counts.values()))
    return table


def stage_times(summary: Summary) -> Table:
    """Milliseconds a frame that each stage took in a worker."""
    n_frames = max(summary.n_frames - summary.n_earlier, 1)
    table = Table(title="time a frame")
    table.add_column("stage")
    table.add_column("ms", justify="right")
    for stage, seconds in summary.seconds.items():
        table.add_row(stage, f"{seconds / n_frames * 1e3:.1f}")
    return table


def _done(counted: tuple[int, ...] | None, of_all: Sequence[str]) -> str:
    """How far an interrupted run came: frames finished, failed and wanted, and what is made of all of them."""
    if counted is None:
        return "before it was known which frames are done"
    finished, failed, total = counted
    failures = f", {failed:,} failed (failures.jsonl)" if failed else ""
    lacks = f", but not all that is made of them together ({', '.join(of_all)})" if finished == total and of_all else ""
    return f"{finished - failed:,} of {total:,} frames are done{failures}{lacks}"

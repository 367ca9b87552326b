"""`ldls evaluate`: predictions against truth, from files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console, speaks_plainly
from ldls.cli.options import refuse, words
from ldls.cli.progress import progress
from ldls.errors import ParameterError

if TYPE_CHECKING:
    from ldls.cli.label_pairs import FrameFolders
    from ldls.evaluation import Evaluation
    from ldls.evaluation.pair import Pair
    from ldls.io.labels.label_formats import LabelFiles

BOXES = "kitti-boxes"
NUSCENES = "nuscenes"
"""What stands in the place of categories for all of nuScenes' lidarseg challenge."""
TABLES = ("semantic", "instances", "panoptic", "reliability", "coverage", "tracking", "frames")
"""Names of the tables that are written, as far as there is something to tell."""
FOLDER = {"exists": True, "file_okay": False, "readable": True, "metavar": "FOLDER"}


class Missing(StrEnum):
    """Treatment of frames without their pair."""

    ERROR = "error"
    SKIP = "skip"


@speaks_plainly
def evaluate(
    predictions: Annotated[
        str,
        typer.Argument(
            metavar="PREDICTIONS",
            help="Labels of a method: a file or folder, or FORMAT:PATH where the files do not tell their format: npz, "
            "label, lidarseg, panoptic, squeezeseg, annotations or kitti-boxes.",
        ),
    ],
    truth: Annotated[str, typer.Argument(metavar="TRUTH", help="True labels, in the same way.")],
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=PATH",
            help="Labels of another method for the same tables, of any format; may be repeated.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Name of the method of PREDICTIONS.", show_default="that of its folder"),
    ] = None,
    categories: Annotated[
        str,
        typer.Option(
            metavar="WORDS",
            help="Categories to score: Car,Pedestrian; or nuscenes, for the 16 of its lidarseg challenge.",
        ),
    ] = "Car,Pedestrian",
    missing: Annotated[
        Missing, typer.Option(metavar="|".join(Missing), help="What becomes of a frame without its pair.")
    ] = Missing.ERROR,
    merge_sitting: Annotated[
        bool, typer.Option("--merge-sitting/--keep-sitting", help="Is Person_sitting a Pedestrian, or left out?")
    ] = True,
    leave_out: Annotated[
        str | None,
        typer.Option(
            metavar="WORDS",
            help='True categories that do not count; "" for none.',
            show_default="Van, Cyclist, Misc, DontCare",
        ),
    ] = None,
    background: Annotated[
        str, typer.Option(metavar="WORDS", help="Names of your own that truth holds and that are background.")
    ] = "",
    max_range: Annotated[
        float | None, typer.Option(metavar="METRES", help="Only points this near count.", show_default="all")
    ] = None,
    min_points: Annotated[
        int, typer.Option(metavar="N", min=0, help="True instances of fewer points do not count.")
    ] = 0,
    track: Annotated[
        bool,
        typer.Option(
            "--track",
            help="The frames are the sweeps of one drive in the order of their names, and an instance's number means "
            "the same object throughout: score that too.",
        ),
    ] = False,
    points: Annotated[
        Path | None,
        typer.Option(help="Folder of the sweeps, for --calib, --max-range and kitti-boxes.", **FOLDER),
    ] = None,
    calib: Annotated[
        Path | None,
        typer.Option(help="Folder of KITTI calibrations: only points that the camera sees count.", **FOLDER),
    ] = None,
    image: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the images, whose size says what the camera sees; without it 375 x 1242 is assumed.",
            **FOLDER,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for the tables as Markdown, CSV and JSON.", file_okay=False),
    ] = None,
) -> None:
    """Score the labels of a method, and of others beside it, against true labels.

    Prints precision, recall and IoU over points, instances found at IoU 0.50 and 0.70, and panoptic quality; of .npz
    results of ldls also how far their confidence can be relied on, and what their masks allow at best; with --track
    LSTQ, association scores, id switches and MOTSA. Files belong together by name: 000123.npz and 000123.txt. Points
    that a method's .npz, the truth or --calib has out of view count for no method.

    Examples:
    ldls evaluate results label_2 --points velodyne --calib calib --out tables

    ldls evaluate theirs labels --beside mine=results --beside boxes=kitti-boxes:detections --points velodyne
    --calib calib

    ldls evaluate predictions labels --track
    """
    from ldls.cli.label_pairs import Counting, FrameFolders, have_masks, parse_place, read_bounds, read_pairs
    from ldls.evaluation import ClassSet, evaluate as score_pairs
    from ldls.evaluation.methods import BOUND
    from ldls.io.labels.label_formats import pair_files

    if calib is None:
        refuse({"image": image}, "its images say what a camera of --calib sees, and there is none")
    if _are_nuscenes(words(categories)):
        refuse({"leave-out": leave_out, "background": background or None}, "the 16 classes of nuScenes have their own")
        scored = ClassSet.nuscenes()
    else:
        scored = ClassSet.kitti(
            words(categories),
            merge_sitting=merge_sitting,
            leave_out=None if leave_out is None else words(leave_out),
            background=words(background),
        )
    places = _places(predictions, name, beside or [])
    if track:
        _check_tracked(path for path, _ in places.values())
    true_path, true_format = parse_place(truth)
    files, notes = {}, []
    for method, (path, format) in places.items():
        files[method], lacking = pair_files(
            path, true_path, prediction_format=format, truth_format=true_format, missing=missing.value
        )
        if lacking:
            notes.append(f"{method}: left out for want of their pair: {_frames(len(lacking))}")
    if track and any(frame.truth.format == BOXES for own in files.values() for frame in own):
        raise ParameterError(
            f"--track: TRUTH is {BOXES}, which numbers the objects of each frame anew; expected a format whose numbers "
            "mean the same object in every sweep, such as label"
        )
    folders = FrameFolders(points=points, calib=calib, image=image)
    if out is not None:
        _check_out(out, (frame for own in files.values() for frame in own), folders)
    of_methods = {method: {each.name: each.prediction for each in own} for method, own in files.items()}
    counting = Counting(of_methods, folders)
    score = partial(score_pairs, classes=scored, max_range_m=max_range, minimum_points=min_points)
    seen: set[str] = set()
    by_method = {
        method: score(progress(_noted(read_pairs(own, counting), seen), len(own), "scoring"), track=track)
        for method, own in files.items()
    }
    # names of one's own are known by the labels alone
    scored.check_occur(seen)
    joined: set[str] = set()
    # labels alone have no masks
    whole = next((own for own in files.values() if have_masks(own)), None)
    if whole is not None and BOUND not in by_method:
        bounds = read_bounds(whole, counting, classes=scored, joined=joined)
        by_method[BOUND] = score(progress(bounds, len(whole), "bound"))
    if joined:
        notes.append(
            f"{BOUND}: of the masks of each sweep alone; labels of {_frames(len(joined))} come from those of other "
            "sweeps, too, and may go beyond it"
        )
    _show(by_method, counting.by, notes, out)


def _are_nuscenes(categories: Sequence[str]) -> bool:
    """True where the word for all of nuScenes' challenge stands in the place of categories.

    Raises:
        ParameterError: Others stand beside it.
    """
    from ldls.categories import folded

    found = NUSCENES in map(folded, categories)
    if found and len(categories) > 1:
        raise ParameterError(f"--categories: {NUSCENES} stands for all 16 classes of its challenge; give it alone")
    return found


def _places(predictions: str, name: str | None, beside: list[str]) -> dict[str, tuple[Path, str | None]]:
    """Where the labels of each method are, and their format where that is said, by its name."""
    from ldls.cli.label_pairs import parse_place

    path, format = parse_place(predictions)
    places = {name or (path.resolve().name if path.is_dir() else path.stem): (path, format)}
    for text in beside:
        method, equals, place = text.partition("=")
        if not (method and equals and place):
            raise ParameterError(f"--beside: got {text!r}, expected NAME=PATH, or NAME=FORMAT:PATH")
        if method in places:
            raise ParameterError(f"--beside: {method!r} is the name of another method; give each its own (--name)")
        places[method] = parse_place(place)
    return places


def _check_tracked(paths: Iterable[Path]) -> None:
    """Refuse the labels of single frames where the same run has tracks.

    Raises:
        ParameterError: A path is the folder of such a run.
    """
    from ldls.batch.run_tracks import TRACKS_STATE
    from ldls.viewing.formats import TRACKS

    for path in paths:
        if (path / TRACKS / TRACKS_STATE).is_file():
            raise ParameterError(
                f"--track: files in {path} number the objects of each frame anew; expected files whose numbers mean "
                f"the same object throughout, which are in {path / TRACKS}"
            )


def _noted(pairs: Iterable[Pair], seen: set[str]) -> Iterator[Pair]:
    """The pairs; the names that they have are added to `seen`."""
    for pair in pairs:
        seen.update(pair.truth.names, pair.prediction.names)
        yield pair


def _check_out(out: Path, files: Iterable[LabelFiles], folders: FrameFolders) -> None:
    """Refuse, before any work, tables and figures that would be written over labels or files of their frames.

    Raises:
        InputError: One would be.
    """
    from ldls.evaluation.figures import RELIABILITY_FIGURES
    from ldls.evaluation.tables import table_files
    from ldls.io.files import check_outputs

    written = table_files(out, *TABLES) + [out / name for name in RELIABILITY_FIGURES]
    read = (path for each in files for path in (each.prediction.path, each.truth.path, *folders.files(each.name)))
    check_outputs({"--out": written}, read, made=out)


def _show(by_method: dict[str, Evaluation], left_out_by: set[str], notes: Sequence[str], out: Path | None) -> None:
    from ldls.evaluation import tables
    from ldls.evaluation.figures import draw_reliability

    shown = {
        "semantic": tables.semantic_table(by_method),
        "instances": tables.instance_table(by_method),
        "panoptic": tables.panoptic_table(by_method),
    }
    if any(scores.reliability for scores in by_method.values()):
        shown |= {"reliability": tables.reliability_table(by_method), "coverage": tables.coverage_table(by_method)}
    tracked = {method: scores.tracking for method, scores in by_method.items() if scores.tracking}
    if tracked:
        shown["tracking"] = tables.tracking_table(tracked)
    figures: list[Path] = []
    if out:
        for stem, table in shown.items():
            table.write(out, stem)
        tables.frame_table(next(iter(by_method.values()))).write(out, "frames")
        figures = draw_reliability(by_method, out)
    screen = console()
    for table in shown.values():
        screen.print(table.rich())
    _say_what_counted(by_method, left_out_by)
    for note in notes:
        screen.print(note, soft_wrap=True)
    if out:
        written = [f"{', '.join(shown)} and frames as .md, .csv and .json", *(path.name for path in figures)]
        screen.print(f"wrote {', '.join(written)} to {out}", soft_wrap=True)


def _say_what_counted(by_method: dict[str, Evaluation], left_out_by: set[str]) -> None:
    said = {}
    for method, scores in by_method.items():
        counted, all_points = (sum(getattr(f, field) for f in scores.frames) for field in ("n_counted", "n_points"))
        said[method] = f"{_frames(len(scores.frames))}, {counted:,} of {all_points:,} points counted"
    why = "no file tells which points a camera sees (--points and --calib do)"
    if left_out_by:
        why = f"no method is scored on those out of view by {', '.join(sorted(left_out_by))}"
    screen = console()
    if len({*said.values()}) == 1:
        screen.print(f"{next(iter(said.values()))}; {why}", soft_wrap=True)
        return
    for method, counts in said.items():
        screen.print(f"{method}: {counts}")
    screen.print(why, soft_wrap=True)
    screen.print("the methods label different points: their scores do not compare")


def _frames(number: int) -> str:
    return "1 frame" if number == 1 else f"{number} frames"

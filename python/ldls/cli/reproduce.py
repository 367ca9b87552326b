"""`ldls reproduce`: the paper's experiments on labelled frames."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console, speaks_plainly
from ldls.cli.progress import progress

if TYPE_CHECKING:
    from ldls.evaluation.paper import Experiment
    from ldls.evaluation.tables import Table


class Truth(StrEnum):
    """What the frames are scored by."""

    ANNOTATIONS = "annotations"
    BOXES = "boxes"


@speaks_plainly
def reproduce(
    folder: Annotated[
        Path,
        typer.Argument(help="Folder with velodyne, calib, masks and the truth.", exists=True, file_okay=False),
    ],
    out: Annotated[Path, typer.Option(help="Folder for tables and figures; made if need be.", file_okay=False)],
    truth: Annotated[
        Truth, typer.Option(help="Point annotations, or the 3D boxes of label_2, which are noisy.")
    ] = Truth.ANNOTATIONS,
    classes: Annotated[str, typer.Option(help="Classes to score, separated by commas.")] = "Car,Pedestrian",
    threads: Annotated[int | None, typer.Option(help="Frames at a time. [default: all cores]")] = None,
) -> None:
    """Run the paper's experiments: direct projection, project + DBSCAN, diffusion without and with outlier removal.

    Labels every frame with each of them and prints the comparison by class, the instances found, the ablation, and
    the scores by maximum range and by number of iterations. Only points in view of the camera count. Writes the
    tables as Markdown, CSV and JSON, and the figures as PNG.

    Example: ldls reproduce kitti/training --truth boxes --out tables
    """
    from ldls.evaluation import ClassSet
    from ldls.evaluation.kitti_frames import KittiFrames
    from ldls.evaluation.paper import label, score
    from ldls.params import Params

    frames = KittiFrames(folder, boxes=truth is Truth.BOXES)
    names = tuple(word.strip() for word in classes.split(",") if word.strip())
    labelled = progress(label(frames, params=Params(threads=threads)), len(frames), "labelling")
    found = score(list(labelled), classes=ClassSet.kitti(names))
    screen = console()
    tables = _tables(found)
    for stem, table in tables.items():
        table.write(out, stem)
        screen.print(table.rich())
    figures = _draw(found, out)
    screen.print(f"{len(frames)} frames; wrote {', '.join(tables)} as .md, .csv and .json", highlight=False)
    screen.print(f"and {', '.join(path.name for path in figures)} to {out}", highlight=False, soft_wrap=True)


def _tables(found: Experiment) -> dict[str, Table]:
    from ldls.evaluation import curves, tables

    return {
        "comparison": tables.semantic_table(found.methods),
        "instances": tables.instance_table(found.methods),
        "panoptic": tables.panoptic_table(found.methods),
        "ablation": tables.ablation_table(found.methods),
        "range": curves.range_table(found.by_range),
        "iterations": curves.iteration_table(found.by_iterations),
    }


def _draw(found: Experiment, out: Path) -> list[Path]:
    """The figures drawn: those for which there is something to draw."""
    from ldls.evaluation import figures
    from ldls.evaluation.methods import FULL

    names = found.methods[FULL].names
    by_range = {name: {limit: one.semantic[name] for limit, one in found.by_range.items()} for name in names}
    objects = {name: [(score.range_m, score.iou) for score in found.objects if score.name == name] for name in names}
    after = {name: {count: one.semantic[name].iou for count, one in found.by_iterations.items()} for name in names}
    paths = [out / "range.png", out / "iterations.png"]
    figures.scores_against_range(by_range, paths[0])
    figures.iou_against_iterations(after, paths[1])
    if any(objects.values()):
        paths.append(out / "objects.png")
        figures.iou_against_range(objects, paths[-1])
    return paths

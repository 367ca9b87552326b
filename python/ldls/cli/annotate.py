"""`ldls annotate`: point annotations of KITTI frames, started from their boxes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ldls.cli.messages import console, say_kept, speaks_plainly
from ldls.cli.progress import progress
from ldls.errors import InputError


@speaks_plainly
def annotate(
    training: Annotated[
        Path,
        typer.Argument(
            metavar="TRAINING",
            help="Folder of KITTI object data: label_2, velodyne, calib and image_2, for the size of the images; "
            "without it 375 x 1242 is assumed.",
            exists=True,
            file_okay=False,
        ),
    ],
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder for the annotations; made if need be.", file_okay=False)
    ],
    clean: Annotated[bool, typer.Option("--clean/--no-clean", help="Does the ground under an object leave it?")] = True,
) -> None:
    """Start point annotations from KITTI's 3D boxes.

    Writes a text file a frame, with a line `instance class` for each point of the sweep: the class of the box that
    holds the point, DontCare for points of DontCare regions and points out of view, or background. Files that are there
    already are kept: somebody may have edited them.

    Example: ldls annotate kitti/training annotations
    """
    from ldls.cli.label_pairs import FrameFolders
    from ldls.evaluation.annotation import annotate as annotate_cloud
    from ldls.io.files import check_outputs
    from ldls.io.labels import read_kitti_objects, write_annotations

    labels = label_paths(training)
    check_outputs({"OUT": [out / path.name for path in labels]}, labels, made=out)
    folders = FrameFolders(points=training / "velodyne", calib=training / "calib", image=training / "image_2")
    missing = [path for path in labels if not (out / path.name).exists()]
    out.mkdir(parents=True, exist_ok=True)
    n_objects: Counter[str] = Counter()
    n_points: Counter[str] = Counter()
    n_ground = 0
    for path in progress(missing, len(missing), "annotating"):
        points, camera = folders.read_points(path.stem), folders.read_camera(path.stem)
        made = annotate_cloud(read_kitti_objects(path), points, camera, clean=clean)
        write_annotations(out / path.name, made.labeling)
        n_objects.update(made.objects())
        n_points.update(made.labeling.counts())
        n_ground += made.n_ground
    screen = console()
    if missing:
        screen.print(summary(n_objects, n_points))
        if clean:
            screen.print(f"{n_ground:,} points of ground under objects left them")
    screen.print(f"wrote {len(missing)} files to {out}", soft_wrap=True)
    say_kept(len(labels) - len(missing))


def label_paths(training: Path) -> list[Path]:
    """The label_2 files of a KITTI folder, in the order of their frames.

    Raises:
        InputError: It has none.
    """
    paths = sorted((training / "label_2").glob("*.txt"))
    if not paths:
        raise InputError(f"{training}: has no label_2/*.txt; expected a folder such as kitti/training")
    return paths


def summary(n_objects: Counter[str], n_points: Counter[str]) -> Table:
    """Objects with points, and their points, of each class that was found."""
    table = Table(title="annotated")
    table.add_column("class")
    table.add_column("objects", justify="right")
    table.add_column("points", justify="right")
    for name, count in n_points.items():
        if count:
            table.add_row(name, f"{n_objects[name]:,}" if n_objects[name] else "-", f"{count:,}")
    return table

"""`ldls reproduce`: the paper's experiments on labelled frames."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console, speaks_plainly
from ldls.cli.options import CoresOption, OutOption, SuitePart, words
from ldls.cli.progress import progress
from ldls.errors import ParameterError

if TYPE_CHECKING:
    from ldls.evaluation.paper import Experiment
    from ldls.evaluation.tables import Table


TABLES = ("comparison", "instances", "panoptic", "ablation", "reliability", "coverage", "range", "iterations")
FIGURES = ("range.png", "iterations.png", "objects.png")


class Truth(StrEnum):
    """Kinds of truth to score by."""

    ANNOTATIONS = "annotations"
    KITTI_BOXES = "kitti-boxes"


@speaks_plainly
def reproduce(
    out: OutOption,
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="FOLDER",
            help="Folder with velodyne, calib, masks and the truth, or its parent.",
            exists=True,
            file_okay=False,
        ),
    ] = None,
    suite: Annotated[
        SuitePart | None,
        typer.Option(
            metavar="|".join(SuitePart), help="Instead of FOLDER: the simulated frames, made if they are not there yet."
        ),
    ] = None,
    truth: Annotated[
        Truth,
        typer.Option(metavar="|".join(Truth), help="Point annotations, or the 3D boxes of label_2, which are noisy."),
    ] = Truth.ANNOTATIONS,
    categories: Annotated[
        str, typer.Option(metavar="WORDS", help="Categories to score: Car,Pedestrian.")
    ] = "Car,Pedestrian",
    cores: CoresOption = None,
) -> None:
    """Run the paper's experiments: from direct projection over clusters and the paper's method to ldls.

    Labels every frame with each of them, and as well as its masks allow, and prints the comparison by class, the
    instances found, the ablation, how far confidence can be relied on, and the scores of ldls by maximum range and by
    number of iterations. Only points in view of the camera count. Writes the tables as Markdown, CSV and JSON, and
    the figures as PNG.

    Examples:
    ldls reproduce --suite validation --out tables

    ldls reproduce kitti/training --truth kitti-boxes --out tables
    """
    from ldls.datasets import KittiObjectSource
    from ldls.evaluation import ClassSet
    from ldls.evaluation.figures import RELIABILITY_FIGURES, draw_reliability
    from ldls.evaluation.paper import label, score
    from ldls.evaluation.tables import table_files
    from ldls.io.files import check_outputs
    from ldls.params import Params

    frames = KittiObjectSource(_folder(folder, suite), masks="masks", truth=truth.value)
    scored = ClassSet.kitti(words(categories))
    written = table_files(out, *TABLES) + [out / name for name in (*FIGURES, *RELIABILITY_FIGURES)]
    check_outputs({"--out": written}, (path for k in range(len(frames)) for path in frames.files(k)), made=out)
    labelled = progress(label(frames, classes=scored, params=Params(threads=cores)), len(frames), "labelling")
    pairs = list(labelled)
    every = (side for one in pairs for pair in one.methods.values() for side in (pair.truth, pair.prediction))
    scored.check_occur(name for side in every for name in side.names)
    experiment = score(pairs, classes=scored)
    tables = _tables(experiment)
    for stem, table in tables.items():
        table.write(out, stem)
    figures = _draw(experiment, out) + draw_reliability(experiment.methods, out)
    screen = console()
    for table in tables.values():
        screen.print(table.rich())
    screen.print(f"{len(frames)} frames; wrote {', '.join(tables)} as .md, .csv and .json")
    screen.print(f"and {', '.join(path.name for path in figures)} to {out}", soft_wrap=True)


def _folder(folder: Path | None, suite: SuitePart | None) -> Path:
    if suite is None and folder is not None:
        return folder / "training" if (folder / "training").is_dir() else folder
    if suite is None or folder is not None:
        raise ParameterError("expected a folder of frames or --suite, one of the two")
    from ldls.simulation import make_suite, suite_folder, suite_orders

    for _ in progress(make_suite(suite.value), len(suite_orders(suite.value)), "simulating"):
        pass
    return suite_folder(suite.value) / "training"


def _tables(experiment: Experiment) -> dict[str, Table]:
    from ldls.evaluation import tables

    return {
        "comparison": tables.semantic_table(experiment.methods),
        "instances": tables.instance_table(experiment.methods),
        "panoptic": tables.panoptic_table(experiment.methods),
        "ablation": tables.ablation_table(experiment.methods),
        "reliability": tables.reliability_table(experiment.methods),
        "coverage": tables.coverage_table(experiment.methods),
        "range": tables.range_table(experiment.by_range),
        "iterations": tables.iteration_table(experiment.by_iterations),
    }


def _draw(experiment: Experiment, out: Path) -> list[Path]:
    """The figures drawn: those for which there is something to draw."""
    from ldls.evaluation import figures
    from ldls.evaluation.methods import FULL

    names = experiment.methods[FULL].names
    by_range = {name: {limit: one.semantic[name] for limit, one in experiment.by_range.items()} for name in names}
    objects = {name: [(one.range_m, one.iou) for one in experiment.objects if one.name == name] for name in names}
    by_count = experiment.by_iterations.items()
    after = {name: {float(count): one.semantic[name].iou for count, one in by_count} for name in names}
    paths = [out / "range.png", out / "iterations.png"]
    figures.scores_against_range(by_range, paths[0])
    figures.iou_against(after, paths[1], label="diffusion steps", logarithmic=True)
    if any(objects.values()):
        paths.append(out / "objects.png")
        figures.iou_against_range(objects, paths[-1])
    return paths

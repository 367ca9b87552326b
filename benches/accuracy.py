"""`python -m benches.accuracy`: what each part of the method is worth, on simulated frames of four lidars.

Choosing is done on the part `tuning`; `--part validation` is for the end, and has frames that nothing was chosen on. So
has `further`: more frames of the four lidars, for categories of which forty frames show one or two objects.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

import ldls
from benches.frames import simulated_frames
from ldls.datasets import Frame
from ldls.evaluation import ClassSet, Evaluation, Table, bound_labels, evaluate, iou_against
from ldls.evaluation.methods import BOUND, DIRECT_PROJECTION, ENSEMBLE, FULL, IN_MASKS, PAPER, compare
from ldls.evaluation.pair import Pair
from ldls.labeling import Labeling
from ldls.simulation import FrameOrder, SegmenterErrors, SensorErrors, suite_orders
from ldls.simulation.production import SUITE_SEEDS, seeded_orders
from ldls.simulation.scene_object import CAR, CLASS_NAMES, CYCLIST

FIRST_SEEDS = {
    "tuning": {"hdl-64e": 3300, "hdl-32e": 3200, "vlp-16": 3000, "os1-128": 3100},
    "validation": {"hdl-64e": 4300, "hdl-32e": 4200, "vlp-16": 4000, "os1-128": 4100},
    "further": {"hdl-64e": 6000, "hdl-32e": 6200, "vlp-16": 6400, "os1-128": 6600},
}
FRAMES = {"tuning": 20, "validation": 40, "further": 100}
CURVE_SEEDS = range(3400, 3420)
TEN = tuple(name for category, name in CLASS_NAMES.items() if category != CYCLIST)

OFF = {name: value for name, value in vars(ldls.Params.paper()).items() if name not in ("threads", "calibrated")}
INGREDIENTS: dict[str, tuple[str, ...]] = {
    "reach and steps": ("sigma", "iterations"),
    "ground edges": ("ground_edges",),
    "depth groups": ("depth_gap",),
    "gaps bridged": ("bridged_gap",),
    "margin of masks": ("edge_margin",),
    "parts": ("part_gap",),
    "clearance": ("ground_clearance",),
    "local ground": ("local_ground",),
}
"""Parameters of each part of the method."""
SETTINGS: dict[str, tuple[object, ...]] = {
    "neighbors": (7, 14, 20),
    "sigma": (0.03, 0.3, 1.0),
    "pixel_weight": (0.0001, 0.01, 0.1),
    "window": (1, 3, 9),
    "iterations": (5, 20, 50, 200),
    "ground_edges": (0.0, 0.1, 1.0),
    "ground_clearance": (0.0, 0.01, 0.04, 0.08),
    "depth_gap": (0.4, 0.8, 1.2),
    "bridged_gap": (0.0, 1.0, 3.0),
    "edge_margin": (0.0, 0.1, 0.25),
    "part_gap": (0.0, 0.5, 1.0, 3.0),
}

ON_OBJECTS = "masks on their objects"
Labeller = Callable[[Frame], NDArray[np.int32]]


def main() -> None:
    """Make the frames, label them and write the tables."""
    parser = argparse.ArgumentParser(prog="python -m benches.accuracy", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("accuracy"), help="folder for frames, tables and figures")
    parser.add_argument("--part", choices=FRAMES, default="tuning")
    parser.add_argument("sections", nargs="*", choices=[[], *SECTIONS], help="what to measure (default: all)")
    options = parser.parse_args()
    for name in options.sections or SECTIONS:
        for stem, table in SECTIONS[name](options.out, options.part):
            table.write(options.out, stem)
            Console(width=160).print(table.rich())


def sets_of(folder: Path, part: str) -> dict[str, list[Frame]]:
    """The frames of each set of a part, made where they are not there yet."""
    orders = {"suite": suite_orders(part)} if part in SUITE_SEEDS else {}
    for lidar, first in FIRST_SEEDS[part].items():
        orders[lidar] = seeded_orders(range(first, first + FRAMES[part]), lidar=lidar)
    return {name: list(simulated_frames(folder / "frames" / part / name, own)) for name, own in orders.items()}


def scores_of(frames: Sequence[Frame], labeller: Labeller, classes: ClassSet) -> Evaluation:
    """Scores of the labels of points in view."""
    with ThreadPoolExecutor() as pool:
        pairs = pool.map(lambda frame: pair_of(frame, labeller(frame)), frames)
        return evaluate(pairs, classes=classes)


def pair_of(frame: Frame, labels: NDArray[np.int32]) -> Pair:
    """Labels of the points in view beside the truth."""
    assert frame.truth is not None and frame.images[0].masks is not None
    seen = np.flatnonzero(labels >= 0)
    truth = frame.truth
    true = Labeling(truth.classes[seen], truth.instances[seen], truth.ignored[seen], truth.names)
    names = [mask.name for mask in frame.images[0].masks]
    return Pair(frame.name, Labeling.from_instance_labels(labels[seen], names), true)


def with_params(params: ldls.Params) -> Labeller:
    """Labels of `ldls.segment`."""

    def label(frame: Frame) -> NDArray[np.int32]:
        image = frame.images[0]
        return ldls.segment(frame.points, image.masks, image.camera, params=replace(params, threads=1)).labels

    return label


def by_method(frames: Sequence[Frame], classes: ClassSet) -> Mapping[str, Evaluation]:
    """Scores of every method."""

    def label(frame: Frame) -> Mapping[str, Pair]:
        image, one = frame.images[0], ldls.Params(threads=1)
        full, paper = (
            ldls.segment(frame.points, image.masks, image.camera, params=params)
            for params in (one, ldls.Params.paper(threads=1))
        )
        found = compare(full, paper, frame.truth, classes)
        return {name: pair_of(frame, labels) for name, labels in found.items()}

    with ThreadPoolExecutor() as pool:
        labelled = list(pool.map(label, frames))
    return {name: evaluate([pairs[name] for pairs in labelled], classes=classes) for name in labelled[0]}


def on_their_objects(frame: Frame) -> NDArray[np.int32]:
    """(N,) labels by which every mask has the object that it shows, wholly and alone, whatever the mask calls it."""
    image, truth = frame.images[0], frame.truth
    assert truth is not None and image.masks is not None
    pixels = image.masks.to_array()
    masks = ldls.InstanceMasks.from_array(pixels, categories=[CAR] * len(pixels), image_size=image.masks.image_size)
    _, objects = np.unique(np.stack([truth.classes, truth.instances]), axis=1, return_inverse=True)
    objects = np.where(truth.instances > 0, objects.ravel() + 1, 0)
    one_class = Labeling((objects > 0).astype(np.int32), objects, truth.ignored, ("background", "Car"))
    result = ldls.segment(frame.points, masks, image.camera, params=ldls.Params(threads=1))
    return bound_labels(result, one_class, ClassSet.kitti(("Car",)))


def methods(folder: Path, part: str) -> Iterator[tuple[str, Table]]:
    """Every method on every set: cars and pedestrians, all ten categories, panoptic quality, and each category."""
    sets, pair = sets_of(folder, part), ClassSet.kitti()
    found = {name: by_method(frames, pair) for name, frames in sets.items()}
    every = list(next(iter(found.values())))
    rows = [(method, *(shown(found[name][method]) for name in sets)) for method in every]
    yield f"methods-{part}", table("IoU of Car and Pedestrian (recall of instances at 0.70), %", sets, rows)
    rows = [(method, *(percent(found[name][method].panoptic.mean_pq) for name in sets)) for method in every]
    yield f"panoptic-{part}", table("panoptic quality of Car and Pedestrian, %", sets, rows)
    ten = ClassSet.kitti(TEN)
    of_all = {name: by_method(frames, ten) for name, frames in sets.items()}
    rows = [(method, *(percent(of_all[name][method].semantic.mean_iou) for name in sets)) for method in every]
    yield f"ten-{part}", table("mean IoU of ten categories, %", sets, rows)
    named = {name: scores_of(frames, on_their_objects, ten) for name, frames in sets.items()}
    rows = [(name, *(categories({**of_all[at], ON_OBJECTS: named[at]}, name) for at in sets)) for name in TEN]
    title = "IoU of the paper's method, ours, masks on their objects, the bound (true points), %"
    yield f"categories-{part}", table(title, sets, rows)


def ablation(folder: Path, part: str) -> Iterator[tuple[str, Table]]:
    """The paper's method, each part added to it alone, all of them, and all but one."""
    best = ldls.Params()
    settings: dict[str, ldls.Params] = {"paper": ldls.Params.paper()}
    for name, fields in INGREDIENTS.items():
        own = {field: getattr(best, field) for field in fields}
        # what refines depth groups or the ground is nothing without them
        own |= {"depth_gap": best.depth_gap} if name in ("gaps bridged", "margin of masks", "parts") else {}
        own |= {"ground_clearance": best.ground_clearance} if name == "local ground" else {}
        settings[f"paper + {name}"] = replace(ldls.Params.paper(), **own)
    settings["all"] = best
    for name, fields in INGREDIENTS.items():
        settings[f"all but {name}"] = replace(best, **{field: OFF[field] for field in fields})
    yield f"ablation-{part}", of_settings(folder, part, settings)


def parameters(folder: Path, part: str) -> Iterator[tuple[str, Table]]:
    """Each parameter at other values, the others at their defaults."""
    settings = {"the defaults": ldls.Params()}
    for name, values in SETTINGS.items():
        settings |= {f"{name}={value}": replace(ldls.Params(), **{name: value}) for value in values}
    yield f"parameters-{part}", of_settings(folder, part, settings)


def curves(folder: Path, _part: str) -> Iterator[tuple[str, Table]]:
    """IoU against one error after the other, and against range and beams."""
    exact = replace(SensorErrors(), rotation_deg=0.0, translation_m=0.0, delay_s=0.0)
    none = replace(SegmenterErrors(), bleed_px=0.0, bleed_cells=0.0)
    errors: dict[str, dict[float, list[FrameOrder]]] = {
        "calibration error (degrees)": {
            x: seeded_orders(CURVE_SEEDS, sensors=replace(exact, rotation_deg=x))
            for x in (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)
        },
        "mask error (mean bleed, pixels)": {
            x: seeded_orders(CURVE_SEEDS, segmenter=replace(none, bleed_px=x)) for x in (0.0, 2.0, 4.0, 8.0, 12.0)
        },
        "time offset (s)": {
            x: seeded_orders(CURVE_SEEDS, sensors=replace(exact, delay_s=x)) for x in (0.0, 0.05, 0.1, 0.2, 0.3)
        },
        "beams": {
            beams: seeded_orders(CURVE_SEEDS, lidar=lidar)
            for beams, lidar in ((16.0, "vlp-16"), (32.0, "hdl-32e"), (64.0, "hdl-64e"), (128.0, "os1-128"))
        },
    }
    for name, by_value in errors.items():
        stem = name.split(" (")[0].replace(" ", "-")
        scored = {
            x: by_method(
                list(simulated_frames(folder / "frames" / "curves" / f"{stem}-{x:g}", orders)), ClassSet.kitti()
            )
            for x, orders in by_value.items()
        }
        yield f"curve-{stem}", curve(folder, stem, name, scored)


def curve(folder: Path, stem: str, name: str, scored: Mapping[float, Mapping[str, Evaluation]]) -> Table:
    """The table of a curve, and its figure beside it."""
    drawn = (DIRECT_PROJECTION, IN_MASKS, ENSEMBLE, PAPER, FULL, BOUND)
    lines = {method: {x: scored[x][method].semantic.mean_iou for x in scored} for method in drawn}
    iou_against(lines, folder / f"curve-{stem}.png", label=name)
    rows = [(method, *(percent(lines[method][x]) for x in scored)) for method in drawn]
    return Table(
        f"mean IoU of Car and Pedestrian against {name}, %", ("method", *(f"{x:g}" for x in scored)), tuple(rows)
    )


def of_settings(folder: Path, part: str, settings: Mapping[str, ldls.Params]) -> Table:
    """IoU and recall of every setting on every set."""
    sets, classes = sets_of(folder, part), ClassSet.kitti()
    rows = [
        (name, *(shown(scores_of(frames, with_params(params), classes)) for frames in sets.values()))
        for name, params in track(settings.items(), description="labelling")
    ]
    return table("IoU of Car and Pedestrian (recall of instances at 0.70), %", sets, rows)


def table(title: str, sets: Mapping[str, object], rows: Sequence[tuple[object, ...]]) -> Table:
    """A table with a column for each set."""
    return Table(title, ("", *sets), tuple(rows))


def shown(scores: Evaluation) -> str:
    """Mean IoU, and recall at IoU 0.70 of instances with 20 points or more."""
    counts = [scores.well_seen[name, 0.7] for name in scores.names]
    found, true = sum(each.tp for each in counts), sum(each.tp + each.fn for each in counts)
    return f"{100 * (scores.semantic.mean_iou or 0):.1f} ({100 * found / max(true, 1):.0f})"


def categories(found: Mapping[str, Evaluation], name: str) -> str:
    """IoU of a category by the paper's method, ours, masks on their objects and the bound, and its true points."""
    counts = [found[method].semantic[name] for method in (PAPER, FULL, ON_OBJECTS, BOUND)]
    return f"{' '.join(percent(each.iou) for each in counts)} ({counts[0].tp + counts[0].fn})"


def percent(share: float | None) -> str:
    """A share in percent."""
    return "-" if share is None else f"{100 * share:.1f}"


SECTIONS = {"methods": methods, "ablation": ablation, "parameters": parameters, "curves": curves}

if __name__ == "__main__":
    main()

"""Plots of scores, as PNG files.

Drawn by matplotlib's own objects on its Agg canvas, so that no window opens and no global state changes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ldls._optional import require
from ldls.checks import checked
from ldls.errors import ParameterError
from ldls.evaluation.counts import Counts
from ldls.evaluation.evaluation import Evaluation
from ldls.evaluation.reliability import Reliability
from ldls.io.files import whole_file

DPI = 150
FONT_SIZE = 11
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's, which colour-blind readers can tell apart."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
IOU_LABEL = "IoU (%)"
LEAST_SHARE = 0.001
"""Share of the points from which on a bin is drawn."""
RELIABILITY_FIGURES = ("reliability.png", "coverage.png")
"""The files of `draw_reliability`."""


@checked
def scores_against_range(curves: Mapping[str, Mapping[float, Counts]], path: str | PathLike[str]) -> None:
    """Draw precision and recall, side by side, against the maximum range.

    Args:
        curves: For each name in the legend, such as a class, the counts by maximum range in metres.
        path: PNG file to write.

    Raises:
        ParameterError: There is nothing to draw.
    """
    figure = _figure(curves, width=9.0)
    for axes, score in zip(figure.subplots(1, 2, sharey=True), ("precision", "recall"), strict=True):
        for k, (name, counts) in enumerate(curves.items()):
            scores = {range_m: getattr(counts[range_m], score) for range_m in sorted(counts)}
            _line(axes, k, name, scores)
        _dress(axes, "maximum range (m)", f"{score} (%)")
    _save(figure, path)


@checked
def iou_against_range(scatter: Mapping[str, Sequence[tuple[float, float]]], path: str | PathLike[str]) -> None:
    """Draw the IoU of each object against its range.

    Args:
        scatter: For each name in the legend, (range in metres, IoU from 0 to 1) of each object, as in `ObjectScore`.
        path: PNG file to write.

    Raises:
        ParameterError: There is nothing to draw.
    """
    figure = _figure(scatter, width=7.0)
    axes = figure.subplots()
    for k, (name, objects) in enumerate(scatter.items()):
        ranges, ious = [x for x, _ in objects], [100 * iou for _, iou in objects]
        style = {"color": COLORS[k % len(COLORS)], "marker": MARKERS[k % len(MARKERS)], "linewidths": 0}
        axes.scatter(ranges, ious, s=24, alpha=0.6, label=name, **style)
    _dress(axes, "range of the object (m)", IOU_LABEL)
    _save(figure, path)


@checked
def iou_against(
    curves: Mapping[str, Mapping[float, float | None]],
    path: str | PathLike[str],
    *,
    label: str,
    logarithmic: bool = False,
) -> None:
    """Draw IoU against whatever was varied.

    Args:
        curves: For each name in the legend, IoU from 0 to 1 by value; None is left out.
        path: PNG file to write.
        label: What the values are, with their unit.
        logarithmic: True if values double rather than add up.

    Raises:
        ParameterError: There is nothing to draw.
    """
    figure = _figure(curves, width=7.0)
    axes = figure.subplots()
    for k, (name, scores) in enumerate(curves.items()):
        _line(axes, k, name, {value: scores[value] for value in sorted(scores)})
    _dress(axes, label, IOU_LABEL)
    values = sorted({value for scores in curves.values() for value in scores})
    axes.set_xticks(values, [f"{value:g}" for value in values], minor=False)
    if logarithmic:
        axes.set_xscale("symlog")
        axes.set_xticks(values, [f"{value:g}" for value in values], minor=False)
        axes.set_xticks([], minor=True)
        axes.set_xlim(0.85 * values[0], 1.15 * values[-1])
    _save(figure, path)


@checked
def right_against_confidence(reliabilities: Mapping[str, Reliability], path: str | PathLike[str]) -> None:
    """Draw the share of right labels against confidence, by bins; those of hardly a point are left out.

    Args:
        reliabilities: By method; each has a line for all points in view and one for those of objects.
        path: PNG file to write.

    Raises:
        ParameterError: There is nothing to draw.
    """
    kinds = {"in view": "points", "of objects": "objects"}
    named = {f"{m}, {kind}": getattr(each, at) for m, each in reliabilities.items() for kind, at in kinds.items()}
    curves = {name: bins for name, bins in named.items() if bins.points.any()}
    figure = _figure(curves, width=7.0)
    axes = figure.subplots()
    axes.plot([0, 100], [0, 100], color="0.6", linestyle="--", linewidth=1)
    for k, (name, bins) in enumerate(curves.items()):
        there = np.flatnonzero(bins.points >= LEAST_SHARE * bins.points.sum())
        mean, right = (each[there] / bins.points[there] for each in (bins.confidence, bins.right))
        _line(axes, k, name, dict(zip(100 * mean, right, strict=True)))
    _dress(axes, "confidence (%)", "right (%)")
    _save(figure, path, columns=2)


@checked
def precision_against_coverage(reliabilities: Mapping[str, Reliability], path: str | PathLike[str]) -> None:
    """Draw the precision of the points of objects against how many of them a threshold on confidence keeps.

    Args:
        reliabilities: By method.
        path: PNG file to write.

    Raises:
        ParameterError: There is nothing to draw.
    """
    found = {method: each.by_threshold.from_thresholds() for method, each in reliabilities.items()}
    curves = {method: curve for method, curve in found.items() if curve}
    figure = _figure(curves, width=7.0)
    axes = figure.subplots()
    for k, (name, curve) in enumerate(curves.items()):
        shares = [(100 * coverage, 100 * precision) for _, coverage, precision in curve]
        # thresholds are 0.01 apart
        axes.plot(*zip(*shares, strict=True), label=name, markevery=10, **_style(k))
    _dress(axes, "points of objects kept (%), marks at confidences of 0, 10, 20 ... %", "precision (%)")
    least = min(precision for curve in curves.values() for *_, precision in curve)
    # there is nothing below
    low = min(5 * math.floor(20 * least), 95)
    axes.set_ylim(low - 0.03 * (100 - low), 100 + 0.03 * (100 - low))
    _save(figure, path)


@checked
def draw_reliability(evaluations: Mapping[str, Evaluation], out: str | PathLike[str]) -> list[Path]:
    """Draw how far confidence can be relied on; the files written: both if a method tells it and finds an object.

    Args:
        evaluations: Scores by method.
        out: Folder of the figures.
    """
    told = {method: one.reliability for method, one in evaluations.items() if one.reliability}
    if not any(each.objects.points.any() for each in told.values()):
        return []
    paths = [Path(out) / name for name in RELIABILITY_FIGURES]
    right_against_confidence(told, paths[0])
    precision_against_coverage(told, paths[1])
    return paths


def _figure(named: Mapping[str, Any], *, width: float) -> Any:  # noqa: ANN401
    if not any(named.values()):
        raise ParameterError("nothing to draw; expected one or more names with values")
    figure = require("matplotlib.figure", "eval").Figure(figsize=(width, 4.5), layout="constrained")
    require("matplotlib.backends.backend_agg", "eval").FigureCanvasAgg(figure)
    return figure


def _line(axes: Any, k: int, name: str, scores: Mapping[float, float | None]) -> None:  # noqa: ANN401
    there = {x: 100 * score for x, score in scores.items() if score is not None}
    axes.plot(list(there), list(there.values()), label=name, **_style(k))


def _style(k: int) -> dict[str, Any]:
    return {"color": COLORS[k % len(COLORS)], "marker": MARKERS[k % len(MARKERS)], "markersize": 5}


def _dress(axes: Any, x_label: str, y_label: str) -> None:  # noqa: ANN401
    axes.set_xlabel(x_label, fontsize=FONT_SIZE)
    axes.set_ylabel(y_label, fontsize=FONT_SIZE)
    axes.tick_params(labelsize=FONT_SIZE - 1, labelleft=True)
    axes.set_ylim(-3, 103)
    axes.grid(True, color="0.88", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _save(figure: Any, path: str | PathLike[str], *, columns: int = 4) -> None:  # noqa: ANN401
    handles, names = figure.axes[0].get_legend_handles_labels()
    # below the axes, where it can cover no curve
    figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), columns), fontsize=FONT_SIZE)
    with whole_file(path) as file:
        figure.savefig(file, format="png", dpi=DPI)

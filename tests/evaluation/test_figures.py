import sys
from functools import partial

import numpy as np
import pytest
from PIL import Image

from ldls.errors import ParameterError
from ldls.evaluation import Counts
from ldls.evaluation.figures import (
    COLORS,
    iou_against,
    iou_against_range,
    precision_against_coverage,
    right_against_confidence,
    scores_against_range,
)
from ldls.evaluation.reliability import Reliability

RANGES = {"Car": {10.0: Counts(9, 1, 1), 30.0: Counts(8, 2, 4)}, "Pedestrian": {10.0: Counts(), 30.0: Counts(1, 3, 1)}}
OBJECTS = {"Car": [(5.0, 0.9), (20.0, 0.4)], "Pedestrian": [(8.0, 0.0)]}
STEPS = {"Car": {200: 0.8, 0: 0.6, 50: None}, "Pedestrian": {0: 0.5, 200: 0.7}}


def reliability(seed):
    """Of points whose labels are right as often as they say."""
    generator, found = np.random.default_rng(seed), Reliability()
    for bins in (found.points, found.objects, found.by_threshold):
        sure = generator.random(500)
        bins.add(sure, generator.random(500) < sure)
    return found


TOLD = {"Car": reliability(1), "Pedestrian": reliability(2)}
FIGURES = [
    pytest.param(scores_against_range, RANGES, id="scores against range"),
    pytest.param(iou_against_range, OBJECTS, id="IoU against range"),
    pytest.param(partial(iou_against, label="steps", logarithmic=True), STEPS, id="IoU against iterations"),
    pytest.param(precision_against_coverage, TOLD, id="precision against coverage"),
]


def n_pixels(picture, color):
    """Pixels of a colour, or of the shade that a transparent marker of it has on white."""
    wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)])
    away = [np.abs(picture - shade).max(axis=2) for shade in (wanted, 0.6 * wanted + 0.4 * 255)]
    return int((np.minimum(*away) < 20).sum())


@pytest.mark.parametrize(("draw", "values"), FIGURES)
def test_every_name_is_drawn_in_its_colour(draw, values, tmp_path):
    draw(values, tmp_path / "a.png")
    draw({"Car": values["Car"]}, tmp_path / "b.png")
    with Image.open(tmp_path / "a.png") as image, Image.open(tmp_path / "b.png") as one:
        assert image.format == "PNG"
        assert image.width > 1000
        both, alone = np.asarray(image.convert("RGB")), np.asarray(one.convert("RGB"))
    assert n_pixels(both, COLORS[0]) > 100
    assert n_pixels(both, COLORS[1]) > 50
    assert n_pixels(alone, COLORS[1]) == 0


def test_right_against_confidence_has_a_line_for_all_points_and_one_for_objects(tmp_path):
    right_against_confidence(TOLD, tmp_path / "a.png")
    no_objects = reliability(1)
    no_objects.objects.points[:] = 0
    right_against_confidence({"ldls": no_objects}, tmp_path / "b.png")
    with Image.open(tmp_path / "a.png") as image, Image.open(tmp_path / "b.png") as one:
        both, alone = np.asarray(image.convert("RGB")), np.asarray(one.convert("RGB"))
    assert [n_pixels(both, color) > 100 for color in COLORS[:5]] == [True] * 4 + [False]
    assert [n_pixels(alone, color) > 100 for color in COLORS[:2]] == [True, False]


def test_precision_that_is_always_1_can_be_drawn(tmp_path):
    certain = Reliability()
    certain.by_threshold.add(np.array([0.3, 0.9]), np.array([True, True]))
    precision_against_coverage({"ldls": certain, "no objects": Reliability()}, tmp_path / "a.png")
    assert (tmp_path / "a.png").exists()


@pytest.mark.parametrize(("draw", "values"), [*FIGURES, pytest.param(right_against_confidence, TOLD, id="right")])
def test_nothing_to_draw_is_an_error_and_leaves_no_file(draw, values, tmp_path):
    for nothing in ({}, {name: type(found)() for name, found in values.items()}):
        with pytest.raises(ParameterError, match="nothing to draw"):
            draw(nothing, tmp_path / "a.png")
    assert not any(tmp_path.iterdir())


def test_no_window_system_is_touched(tmp_path):
    iou_against_range(OBJECTS, tmp_path / "a.png")
    assert "matplotlib.pyplot" not in sys.modules


def test_a_missing_matplotlib_is_asked_for(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install 'ldls\[eval\]'"):
        iou_against_range(OBJECTS, tmp_path / "a.png")

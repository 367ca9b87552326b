import csv
import io
import json

import numpy as np
import pytest
from rich.console import Console

from evaluation.samples import disturbed, labeling, random_labeling
from ldls.errors import ParameterError
from ldls.evaluation import (
    ClassSet,
    Pair,
    Table,
    TrackingScores,
    ablation_table,
    evaluate,
    frame_table,
    instance_table,
    panoptic_table,
    semantic_table,
    tracking_table,
)
from ldls.evaluation.tables import coverage_table, reliability_table

TABLES = [semantic_table, instance_table, panoptic_table, ablation_table, reliability_table, coverage_table]
SMALL = Table("Cars | more", ("method", "IoU", "n"), (("a|b", 61.25, 3), ("c", None, 0)), "a note")


def evaluation(prediction, truth, names=("Car", "Pedestrian")):
    return evaluate([("a", prediction, truth)], classes=ClassSet(names=names))


@pytest.fixture
def methods():
    truth = labeling([1, 1, 0, 0], [1, 1, 0, 0])
    good, poor = labeling([1, 1, 0, 0], [1, 1, 0, 0]), labeling([1, 0, 0, 0], [1, 0, 0, 0])
    return {"direct projection": evaluation(poor, truth), "full method": evaluation(good, truth)}


def test_markdown():
    assert SMALL.markdown() == (
        "**Cars | more**\n\n| method | IoU | n |\n| :--- | ---: | ---: |\n| a/b | 61.2 | 3 |\n| c | - | 0 |\n\na note\n"
    )


def test_csv_and_json_keep_numbers_whole():
    assert list(csv.reader(io.StringIO(SMALL.csv()))) == [["method", "IoU", "n"], ["a|b", "61.25", "3"], ["c", "", "0"]]
    content = json.loads(SMALL.json())
    assert content["rows"][1] == {"method": "c", "IoU": None, "n": 0}
    assert (content["title"], content["note"]) == ("Cars | more", "a note")


def test_a_row_without_a_score_of_the_column_is_empty_there():
    table = Table("t", ("class", "IoU", "n"), (("Car", 61.25, 3), ("Van", None, 0), ("mean", 61.25, "")))
    assert "| Van | - | 0 |\n| mean | 61.2 |  |\n" in table.markdown()
    assert ":--- | ---: | ---:" in table.markdown()
    assert table.csv().endswith("mean,61.25,\n")
    assert json.loads(table.json())["rows"][2] == {"class": "mean", "IoU": 61.25, "n": None}


def test_files_are_written_under_one_stem(tmp_path):
    paths = SMALL.write(tmp_path / "new/folder", "scores")
    assert [path.name for path in paths] == ["scores.md", "scores.csv", "scores.json"]
    assert [path.read_text() for path in paths] == [SMALL.markdown(), SMALL.csv(), SMALL.json()]


def test_a_table_holds_no_nan_and_no_gap():
    for wrong in (float("nan"), float("inf"), np.float64("nan")):
        with pytest.raises(ParameterError, match="expected finite numbers"):
            Table("t", ("a",), ((wrong,),))
    with pytest.raises(ParameterError, match="expected 2 cells"):
        Table("t", ("a", "b"), ((1,),))


def test_methods_stand_side_by_side(methods):
    table = semantic_table(methods)
    assert table.columns == ("method", "class", "true points", "precision", "recall", "IoU")
    assert table.rows == (
        ("direct projection", "Car", 2, 100.0, 50.0, 50.0),
        ("direct projection", "Pedestrian", 0, None, None, None),
        ("direct projection", "mean", "", "", "", 50.0),
        ("full method", "Car", 2, 100.0, 100.0, 100.0),
        ("full method", "Pedestrian", 0, None, None, None),
        ("full method", "mean", "", "", "", 100.0),
    )


def test_instances_have_a_row_a_class_and_threshold(methods):
    rows = instance_table(methods).rows
    assert rows[0] == ("direct projection", "Car", "0.50", 1, 0, 0, 100.0, 100.0, None)
    assert rows[1] == ("direct projection", "Car", "0.70", 0, 1, 1, 0.0, 0.0, 0.0)
    assert rows[2] == ("direct projection", "Pedestrian", "0.50", 0, 0, 0, None, None, None)
    assert len(rows) == 8


def test_panoptic_quality_has_its_parts(methods):
    rows = panoptic_table(methods).rows
    assert rows[3] == ("full method", "Car", 100.0, 100.0, 100.0, 1, 0, 0)
    # the class that is not there is not in the mean
    assert rows[5] == ("full method", "mean", 100.0, "", "", "", "", "")
    assert [row[2] for row in rows if row[1] == "mean"] == [100 * each.panoptic.mean_pq for each in methods.values()]


def test_frames_have_a_row_each(methods):
    table = frame_table(methods["direct projection"])
    assert table.columns == ("frame", "points", "counted", "Car IoU", "Pedestrian IoU")
    assert table.rows == (("a", 4, 4, 50.0, None),)


def test_ablation_tells_the_gain(methods):
    table = ablation_table(methods)
    assert table.columns == ("variant", "Car IoU", "Pedestrian IoU", "mean IoU", "gain", "mean PQ")
    assert [row[-2:] for row in table.rows] == [(0.0, 0.0), (50.0, 100.0)]


def test_tracking_has_a_row_a_class_and_one_of_all():
    truth = labeling([1, 1, 2, 0], [1, 1, 1, 0])
    scores = TrackingScores(truth.names[1:])
    for car, person in ((1, 2), (3, 2)):
        scores.add(labeling([1, 1, 2, 0], [car, car, person, 0]), truth)
    table = tracking_table({"m": scores})
    assert table.columns == (
        *("method", "class", "LSTQ", "S_cls", "S_assoc", "objects", "object frames", "id switches"),
        *("a hundred frames", "MOTSA"),
    )
    assert table.rows == (
        ("m", "Car", "", 100.0, 50.0, 1, 2, 1, 50.0, 50.0),
        ("m", "Pedestrian", "", 100.0, 100.0, 1, 2, 0, 0.0, 100.0),
        ("m", "all", pytest.approx(100 * 0.75**0.5), 100.0, 75.0, 2, 4, 1, 25.0, 75.0),
    )
    one = TrackingScores(("Car",))
    assert tracking_table({"m": one}).rows == (("m", "Car", None, None, None, 0, 0, 0, None, None),)


@pytest.mark.parametrize("make", [semantic_table, instance_table, panoptic_table, ablation_table])
def test_a_narrow_terminal_cuts_neither_numbers_nor_names(make, methods):
    table = make(methods)
    console = Console(file=io.StringIO(), width=62)
    console.print(table.rich(), crop=False)
    text = console.file.getvalue()
    assert "…" not in text
    assert text.count("100.0") == sum(cell == 100 for row in table.rows for cell in row) > 0
    # names of several words are folded between them
    for row in table.rows:
        assert all(f" {word} " in text for word in row[0].split())
        assert make is ablation_table or f" {row[1]} " in text


def test_names_stay_whole_where_heads_can_fold():
    columns = ("method", "class", "object frames", "a hundred frames", "MOTSA")
    table = Table("t", columns, (("prediction", "Pedestrian", 1234, 12.5, 88.1),))
    console = Console(file=io.StringIO(), width=54)
    console.print(table.rich())
    lines = console.file.getvalue().splitlines()
    assert "│ prediction │ Pedestrian │   1234 │    12.5 │  88.1 │" in lines
    assert "┃            ┃            ┃ object ┃ hundred ┃       ┃" in lines


def test_recall_is_told_of_well_seen_instances_too():
    # of a car of 20 points half are found, of one of 19 all
    truth = labeling([1] * 39, [1] * 20 + [2] * 19)
    prediction = labeling([1] * 11 + [0] * 9 + [1] * 19, [1] * 11 + [0] * 9 + [2] * 19)
    rows = instance_table({"m": evaluation(prediction, truth)}).rows
    assert [row[-2:] for row in rows[:2]] == [(100.0, 100.0), (50.0, 0.0)]


@pytest.fixture
def told(methods):
    """Two methods, of which the second tells a confidence."""
    truth, prediction = labeling([1, 1, 1, 1, 0]), labeling([1, 1, 1, 1, 1])
    pair = Pair("a", prediction, truth, confidence=np.array([0.96, 0.96, 0.94, 0.5, 0.05]))
    return methods | {"sure": evaluate([pair], classes=ClassSet(names=("Car", "Pedestrian")))}


def test_reliability_has_a_row_for_all_points_and_one_for_objects(told):
    table = reliability_table(told)
    assert table.columns == ("method", "points", "number", "confidence", "right", "calibration error")
    # bins of 0.933 to 1, of 0.467 to 0.533, and of 0 to 0.067
    error = 100 * (3 * (1 - 2.86 / 3) + 0.5 + 0.05) / 5
    assert [row[:3] for row in table.rows] == [("sure", "in view", 5), ("sure", "of objects", 5)]
    for row in table.rows:
        assert row[3:] == pytest.approx((100 * 3.41 / 5, 80.0, error))


def test_coverage_falls_and_precision_is_of_what_is_kept(told):
    rows = coverage_table(told).rows
    assert rows[0] == ("sure", "0.00", 100.0, 80.0)
    assert rows[1] == ("sure", "0.20", 80.0, 100.0)
    assert rows[-1] == ("sure", "0.95", 40.0, 100.0)  # no point has 0.99


@pytest.mark.parametrize("make", [semantic_table, ablation_table])
def test_methods_must_be_scored_on_the_same_classes(make, methods):
    bus = labeling([1], names=("background", "Bus"))
    with pytest.raises(ParameterError, match="of the same classes"):
        make(methods | {"other": evaluation(bus, bus, ("Bus",))})


@pytest.mark.parametrize("make", TABLES)
def test_no_cell_is_ever_nan(make):
    generator = np.random.default_rng(6)
    for _ in range(50):
        truth = random_labeling(generator, int(generator.integers(0, 12)))
        sure = generator.random(len(truth))
        pair = Pair("a", disturbed(generator, truth, generator.random()), truth, confidence=sure)
        table = make({"m": evaluate([pair], classes=ClassSet(names=("class 1", "class 2", "class 3")))})
        for text in (table.markdown(), table.csv(), table.json()):
            assert "nan" not in text.lower()
        assert all(0 <= cell <= 100 for row in table.rows for cell in row if isinstance(cell, float))

"""Tables of objects in files."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.errors import InputError, UnsupportedFormatError
from ring_samples import as_views, random_ring


def read_rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_csv_has_the_rows_of_each_frame_in_the_order_given(result, tmp_path):
    ldls.save_objects({"b": result, "a": result}, tmp_path / "objects.csv")
    rows = read_rows(tmp_path / "objects.csv")
    assert [(row.pop("frame"), row["name"]) for row in rows] == [
        ("b", "person"), ("b", "car"), ("a", "person"), ("a", "car"),
    ]  # fmt: skip
    for row, expected in zip(rows, result.to_table() * 2, strict=True):
        assert list(row) == list(expected)
        for name, value in expected.items():
            assert row[name] == str(round(value, 4) if isinstance(value, float) else value)


def test_a_result_alone_has_rows_of_no_frame(result, tmp_path):
    ldls.save_objects(result, tmp_path / "objects.csv")
    assert [row["frame"] for row in read_rows(tmp_path / "objects.csv")] == ["", ""]
    ldls.save_objects(result, tmp_path / "objects.json")
    (image,) = json.loads((tmp_path / "objects.json").read_text())["images"]
    assert (image["frame"], image["file_name"]) == ("", "camera 0")


def test_tables_without_objects_have_their_heads(small_scene, tmp_path):
    points, masks, camera = small_scene
    empty = ldls.segment(points[:0], masks, camera)
    ldls.save_objects({"a": empty}, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("frame,label,track,category,name,")
    assert read_rows(tmp_path / "a.csv") == []
    ldls.save_objects({"a": empty}, tmp_path / "a.json")
    content = json.loads((tmp_path / "a.json").read_text())
    assert (content["annotations"], content["categories"], len(content["images"])) == ([], [], 1)


def test_tracked_objects_have_their_track_and_velocity(result, tmp_path):
    instances = tuple(replace(i, track=40 + i.label, velocity=(1.25, -i.label)) for i in result.instances)
    ldls.save_objects(replace(result, instances=instances), tmp_path / "a.csv")
    names = ("label", "track", "velocity_x_m_s", "velocity_y_m_s")
    rows = [tuple(float(row[name]) for name in names) for row in read_rows(tmp_path / "a.csv")]
    assert rows == [(1, 41, 1.25, -1), (2, 42, 1.25, -2)]
    ldls.save_objects(replace(result, instances=instances), tmp_path / "a.json")
    found = json.loads((tmp_path / "a.json").read_text())["annotations"]
    assert [(each["track"], each["velocity"]) for each in found] == [(41, [1.25, -1]), (42, [1.25, -2])]


def test_names_with_commas_and_quotes_survive(small_scene, tmp_path):
    points, masks, camera = small_scene
    named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[200, 200], names={200: 'a "b", ü'})
    ldls.save_objects({"one, two": ldls.segment(points, named, camera)}, tmp_path / "a.csv")
    assert {(row["frame"], row["name"]) for row in read_rows(tmp_path / "a.csv")} == {("one, two", 'a "b", ü')}


def test_json_is_a_data_set_after_cocos(result, tmp_path):
    ldls.save_objects({"000001": result, "000002": result}, tmp_path / "objects.json")
    content = json.loads((tmp_path / "objects.json").read_text())
    assert set(content) == {"info", "images", "categories", "annotations"}
    assert content["images"][1] == {
        "id": 2, "file_name": "000002", "height": 60, "width": 80, "frame": "000002", "camera": "camera 0",
    }  # fmt: skip
    assert content["categories"] == [{"id": 1, "name": "person"}, {"id": 3, "name": "car"}]
    assert [each["id"] for each in content["annotations"]] == [1, 2, 3, 4]
    assert [each["image_id"] for each in content["annotations"]] == [1, 1, 2, 2]
    found, car = result.objects[1], content["annotations"][3]
    assert {name: car[name] for name in ("category_id", "bbox", "area", "iscrowd", "score", "label", "n_points")} == {
        "category_id": 3, "bbox": [51, 23, 12, 15], "area": 180, "iscrowd": 0, "score": 0.8, "label": 2,
        "n_points": found.n_points,
    }  # fmt: skip
    assert car["distance_m"] == pytest.approx(found.distance_m, abs=1e-4)
    np.testing.assert_allclose(car["centroid"], found.centroid, atol=1e-4)
    np.testing.assert_allclose(car["box"]["center"], found.box.center, atol=1e-4)
    np.testing.assert_allclose(car["box"]["size"], found.box.size, atol=1e-4)
    assert car["box"]["yaw"] == pytest.approx(found.box.yaw, abs=1e-4)


def test_a_class_has_one_id_in_tables_whatever_each_frame_calls_it(result, tmp_path):
    def named(*classes):
        pairs = zip(result.instances, classes, strict=True)
        return replace(result, instances=tuple(replace(i, category=c, name=name) for i, (c, name) in pairs))

    frames = {
        "a": named((100, "cone"), (3, "car")),
        "b": named((100, "barrel"), (101, "Cone")),
        "c": named((101, "barrel"), (102, "sign")),
    }
    ldls.save_objects(frames, tmp_path / "a.json")
    content = json.loads((tmp_path / "a.json").read_text())
    names = {each["id"]: each["name"] for each in content["categories"]}
    assert [names[each["category_id"]] for each in content["annotations"]] == [
        "cone", "car", "barrel", "cone", "barrel", "sign",
    ]  # fmt: skip
    assert names == {3: "car", 100: "cone", 101: "barrel", 102: "sign"}
    ldls.save_objects(frames, tmp_path / "a.csv")
    rows = [(int(row["category"]), row["name"]) for row in read_rows(tmp_path / "a.csv")]
    assert [category for category, _ in rows] == [each["category_id"] for each in content["annotations"]]
    assert [name for _, name in rows] == ["cone", "car", "barrel", "Cone", "barrel", "sign"]


def test_json_of_several_cameras_has_an_image_of_each(tmp_path):
    points, views = random_ring(3)
    result = ldls.segment(points, as_views(views))
    ldls.save_objects({"7": result}, tmp_path / "objects.json")
    content = json.loads((tmp_path / "objects.json").read_text())
    assert [image["file_name"] for image in content["images"]] == ["camera 0/7", "camera 1/7", "camera 2/7"]
    cameras = {image["id"]: image["camera"] for image in content["images"]}
    rows = result.to_table()
    assert [cameras[each["image_id"]] for each in content["annotations"]] == [row["camera"] for row in rows]
    assert len({row["camera"] for row in rows}) == 3


def test_an_object_that_no_image_shows_is_of_its_frame_and_of_no_image(result, tmp_path):
    unseen = tuple(replace(i, sources=()) if i.label == 2 else i for i in result.instances)
    ldls.save_objects({"7": replace(result, instances=unseen)}, tmp_path / "a.csv")
    assert [(row["camera"], row["mask_left_px"]) for row in read_rows(tmp_path / "a.csv")][1] == ("", "")
    ldls.save_objects({"7": replace(result, instances=unseen)}, tmp_path / "a.json")
    shown, hidden = json.loads((tmp_path / "a.json").read_text())["annotations"]
    assert (shown["image_id"], shown["frame"], shown["label"]) == (1, "7", 1)
    assert (hidden["image_id"], hidden["bbox"], hidden["area"]) == (None, None, 0)
    assert (hidden["frame"], hidden["label"], hidden["n_points"]) == ("7", 2, result.objects[1].n_points)


@pytest.mark.parametrize("name", ["objects.txt", "objects", "objects.json.gz"])
def test_other_endings_are_refused(result, tmp_path, name):
    with pytest.raises(UnsupportedFormatError, match=r"cannot write .*tables of objects.*, expected .*\.csv, \.json"):
        ldls.save_objects(result, tmp_path / name)


@pytest.mark.parametrize("results", [[], None, {"a": 1}, {1: None}])
def test_anything_but_results_is_refused(results, tmp_path):
    with pytest.raises(InputError, match="results: expected Segmentation or a dict of Segmentation by text"):
        ldls.save_objects(results, tmp_path / "a.csv")


def test_nothing_is_left_where_writing_fails(result, tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("before")
    monkeypatch.setattr(ldls.Segmentation, "to_table", lambda self: [{}])
    with pytest.raises(KeyError):
        ldls.save_objects(result, tmp_path / "a.csv")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.csv", "before")]

import json

import numpy as np
import pytest

import ldls
from ldls.io.results import FORMATS


@pytest.fixture
def result(small_scene):
    points, masks, camera = small_scene
    points = np.vstack([points, [[0, 0, -5]]]).astype(np.float32)  # the last is out of view
    return ldls.segment(points, masks, camera)


def test_npz_holds_all_fields(result, tmp_path):
    ldls.save(result, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as stored:
        for name in ("labels", "diffused_labels", "categories", "confidence", "in_view", "pixels"):
            np.testing.assert_array_equal(stored[name], getattr(result, name))
        assert stored["object_name"].tolist() == ["person", "car"]
        assert stored["object_n_points"].tolist() == [o.n_points for o in result.objects]
        np.testing.assert_array_equal(stored["object_centroid"][0], result.objects[0].centroid)
        assert stored["object_box"].shape == (2, 7)
        assert json.loads(str(stored["params"]))["neighbors"] == 10
        assert json.loads(str(stored["report"]))["n_in_view"] == len(result.in_view)


def test_label_files_are_semantic_kittis(result, tmp_path):
    ldls.save(result, tmp_path / "a.label")
    values = np.fromfile(tmp_path / "a.label", "<u4")
    np.testing.assert_array_equal(values >> 16, np.maximum(result.labels, 0))
    expected = {0: 0, 1: 30, 3: 10}
    assert {int(c): int(v) for c, v in zip(result.categories, values & 0xFFFF, strict=True)} == expected
    assert values[-1] == 0


def test_ply_files_hold_points_labels_and_colours(result, tmp_path):
    ldls.save(result, tmp_path / "a.ply")
    header, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    types = {"float": "<f4", "int": "<i4", "uchar": "u1"}
    properties = [line.split()[1:] for line in lines if line.startswith("property")]
    vertices = np.frombuffer(body, [(name, types[kind]) for kind, name in properties])
    assert f"element vertex {len(result.labels)}" in lines
    np.testing.assert_array_equal(vertices["z"], result.points[:, 2])
    np.testing.assert_array_equal(vertices["label"], result.categories)
    np.testing.assert_array_equal(vertices["instance"], np.maximum(result.labels, 0))
    np.testing.assert_array_equal(vertices["confidence"], result.confidence)
    colours = np.stack([vertices[c] for c in ("red", "green", "blue")], axis=1)
    assert len({tuple(c) for c in colours[result.labels == 1]}) == 1
    assert tuple(colours[-1]) == (128, 128, 128)


@pytest.mark.parametrize("name", [".npz", ".PLY", ".laz"])
def test_a_name_that_is_an_ending_is_refused(result, tmp_path, name):
    with pytest.raises(
        ldls.UnsupportedFormatError, match=f"{name}: cannot write results without a name, expected .npz"
    ):
        ldls.save(result, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_unknown_suffixes_are_refused(result, tmp_path):
    with pytest.raises(ldls.UnsupportedFormatError, match="cannot write '.xyz' results, expected .npz, .label, .ply"):
        ldls.save(result, tmp_path / "a.xyz")
    with pytest.raises(ldls.UnsupportedFormatError, match="cannot write '.bin' results"):
        ldls.save(result, tmp_path / "a.bin")


def test_nothing_is_left_behind_where_writing_fails(result, tmp_path, monkeypatch):
    monkeypatch.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left")))
    for ending, _ in FORMATS.values():
        with pytest.raises(OSError, match="No space left"):
            ldls.save(result, tmp_path / f"a{ending}")
    assert list(tmp_path.iterdir()) == []

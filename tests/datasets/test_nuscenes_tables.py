"""Tables of nuScenes with values of the wrong type: an error that names the table, the row and the value."""

import json

import pytest

import ldls
from datasets import layouts
from ldls.datasets import open_source
from ldls.errors import LeftOutWarning

WRONG = {
    "null": None,
    "a list": [[]],
    "an object": {},
    "text": "x",
    "a number of 400 digits": int("9" * 400),
    "not a number": float("nan"),
    "text in a list": ["x"] * 4,
    "numbers of 400 digits": [int("9" * 400)] * 3,
    "five numbers": [0.5] * 5,
}
VALUES = [
    *((table, "token") for table in ("scene", "sample", "sample_data", "calibrated_sensor", "ego_pose", "sensor")),
    *(("sample_data", key) for key in ("sample_token", "calibrated_sensor_token", "ego_pose_token", "filename")),
    *(("sample_data", key) for key in ("timestamp", "height", "width", "is_key_frame")),
    *(("calibrated_sensor", key) for key in ("sensor_token", "translation", "rotation", "camera_intrinsic")),
    *(("ego_pose", key) for key in ("translation", "rotation")),
    *(("lidarseg", key) for key in ("sample_data_token", "filename")),
    *(("sample", key) for key in ("scene_token", "timestamp")), ("scene", "name"), ("sensor", "channel"),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return layouts.nuscenes(tmp_path_factory.mktemp("nuscenes"))


@pytest.mark.parametrize(("table", "key"), VALUES)
def test_values_of_the_wrong_type_are_named(folder, table, key):
    path = folder / f"v1.0-mini/{table}.json"
    intact = path.read_text()
    refused = 0
    try:
        for value in WRONG.values():
            rows = json.loads(intact)
            rows[0][key] = value
            path.write_text(json.dumps(rows))
            try:
                open_source(folder, kind="nuscenes")[0]
            except (ldls.LdlsError, LeftOutWarning):
                refused += 1
            except FileNotFoundError as error:
                assert (key, value) == ("filename", "x"), error
                refused += 1
    finally:
        path.write_text(intact)
    assert refused >= 3


def test_the_row_and_its_value_are_named(tmp_path):
    folder = layouts.nuscenes(tmp_path)
    path = folder / "v1.0-mini/sample.json"
    rows = json.loads(path.read_text())
    rows[1]["timestamp"] = "noon"
    path.write_text(json.dumps(rows))
    with pytest.raises(ldls.CorruptFileError, match=r"sample\.json, row 2: timestamp is 'noon', expected int | float"):
        open_source(folder, kind="nuscenes")


@pytest.mark.parametrize(
    ("table", "change", "message"),
    [
        pytest.param(
            "sensor", lambda rows: [row for row in rows if row["channel"] != "CAM_BACK"],
            r"calibrated_sensor\.json, calibrated CAM_BACK: sensor_token is 'sensor CAM_BACK', which sensor\.json",
            id="no sensor",
        ),
        pytest.param(
            "calibrated_sensor", lambda rows: [row for row in rows if "CAM_BACK'" not in str(row)],
            r"sample_data\.json, scene-0001 0 CAM_BACK: calibrated_sensor_token is 'calibrated CAM_BACK', which calib",
            id="no calibrated sensor",
        ),
        pytest.param(
            "calibrated_sensor", lambda rows: [row | {"camera_intrinsic": []} for row in rows],
            r"calibrated_sensor\.json, calibrated CAM_FRONT: camera_intrinsic of CAM_FRONT has the shape \(0,\)",
            id="a camera without intrinsics",
        ),
        pytest.param(
            "ego_pose", lambda rows: [*rows, rows[0] | {"translation": [50, 0, 0]}],
            r"ego_pose\.json, pose scene-0001 0 LIDAR_TOP: two rows with this token have two poses",
            id="two poses of one token",
        ),
        pytest.param(
            "scene", lambda rows: [row | {"name": "scene-0001"} for row in rows],
            r"scene\.json: two scenes are named 'scene-0001'", id="two scenes of one name",
        ),
    ],
)  # fmt: skip
def test_tables_that_contradict_one_another_are_named(tmp_path, table, change, message):
    folder = layouts.nuscenes(tmp_path, scenes=("scene-0001", "scene-0002"))
    path = folder / f"v1.0-mini/{table}.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises((ldls.CorruptFileError, ldls.CalibrationError), match=message):
        open_source(folder, kind="nuscenes")


def test_a_pose_may_stand_there_twice(tmp_path):
    folder = layouts.nuscenes(tmp_path)
    path = folder / "v1.0-mini/ego_pose.json"
    path.write_text(json.dumps(json.loads(path.read_text()) * 2))
    assert len(open_source(folder)) == 2


def test_a_part_of_the_scenes_may_be_there(tmp_path):
    folder = layouts.nuscenes(tmp_path, scenes=("scene-0001", "scene-0002"))
    path = folder / "v1.0-mini/scene.json"
    path.write_text(json.dumps(json.loads(path.read_text())[:1]))
    with pytest.warns(LeftOutWarning, match="frames are left out, of scenes that scene.json lacks: token scene-0002"):
        source = open_source(folder, kind="nuscenes")
    assert {name[:-4] for name in source.names} == {"scene-0001"}
    # nobody asked for the others here, and a warning would be an error
    assert open_source(folder, kind="nuscenes", scene="scene-0001").names == source.names


def test_sensors_that_no_frame_has_may_be_of_any_kind(tmp_path):
    folder = layouts.nuscenes(tmp_path)
    for table, row in (
        ("sensor", {"token": "gps", "channel": "GPS", "modality": "gps"}),
        (
            "calibrated_sensor",
            {"token": "own gps", "sensor_token": "gps", "translation": [], "rotation": [], "camera_intrinsic": []},
        ),
    ):
        path = folder / f"v1.0-mini/{table}.json"
        path.write_text(json.dumps([*json.loads(path.read_text()), row]))
    assert len(open_source(folder, kind="nuscenes")) > 0

import json

import numpy as np
import pytest

import ldls
from datasets import layouts
from ldls.io.cameras.extrinsic_file import EXAMPLE, as_extrinsic

T = np.array(layouts.T, float)
ROWS = "\n".join(" ".join(map(str, row)) for row in T.tolist())
# the pose of the camera in the lidar frame by its parts
BACK = np.linalg.inv(T)
PARTS = {"pose_of": "camera", "translation": BACK[:3, 3].tolist(), "rotation": BACK[:3, :3].tolist()}
QUATERNION = {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5}
ROS = {"pose_of": "camera", "translation": dict(zip("xyz", PARTS["translation"], strict=True)), "rotation": QUATERNION}
NAMED = {key: value for key, value in ROS.items() if key != "rotation"}
FILES = [
    pytest.param("a.txt", f"# lidar to camera\n{ROWS}\n", id="sixteen numbers"),
    pytest.param("a.txt", ROWS.rsplit("\n", 1)[0].replace(" ", ", "), id="twelve numbers with commas"),
    pytest.param("a.txt", f"{T}\n", id="as NumPy prints it"),
    pytest.param("a.json", json.dumps(T.tolist()), id="JSON of the matrix"),
    pytest.param("a.json", json.dumps(PARTS), id="JSON"),
    pytest.param("a.json", json.dumps({"T_lidar_camera": BACK.tolist()}), id="the matrix back"),
    pytest.param(
        "a.json",
        json.dumps({"K": [], "comment": "", "T_lidar_camera": BACK.tolist(), "T_camera_lidar": T.tolist()}),
        id="both matrices, a camera and a comment",
    ),
    pytest.param(
        "a.yaml", "".join(f"{key}: {json.dumps(value)}\n" for key, value in ROS.items()), id="YAML, as ROS names them"
    ),
    pytest.param(
        "a.toml",
        f'pose_of = "camera"\ntranslation = {PARTS["translation"]}\nquaternion_xyzw = {list(QUATERNION.values())}\n',
        id="TOML",
    ),
    pytest.param(
        "a.yaml",
        f"pose_of: camera\ntranslation: {PARTS['translation']}\nquaternion_xyzw: [-.5, .5, -5e-1, 5e-1]\n",
        id="YAML, numbers that it takes for text",
    ),
    pytest.param("a.json", json.dumps(NAMED | {"quaternion_xyzw": QUATERNION}), id="quaternion by its axes"),
    pytest.param("a.json", json.dumps(NAMED | {"quaternion_wxyz": QUATERNION}), id="quaternion by its axes, w first"),
]


@pytest.mark.parametrize(("name", "text"), FILES)
def test_a_transform_is_read_from_a_file(tmp_path, name, text):
    if name == "a.yaml":
        pytest.importorskip("yaml", reason="the extra yaml is not installed")
    (tmp_path / name).write_text(text)
    np.testing.assert_allclose(as_extrinsic(tmp_path / name), T, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        pytest.param("a.txt", "1 2 3 0 0 0 1", "expected the 12 or 16 .* got 7; name the parts", id="seven numbers"),
        pytest.param("a.toml", "1_0 " * 12, "not a whole transform", id="underscores"),
        pytest.param("a.json", json.dumps(PARTS | {"pose_of": None}), "pose_of is missing; write 'camera'", id="whose"),
        pytest.param(
            "a.json", json.dumps(PARTS | {"quat": 1}), "unknown key 'quat', expected T_camera_lidar", id="key"
        ),
        pytest.param("a.json", json.dumps({"T_lidar_camera": BACK.tolist(), "optical": False}),
                     "found optical beside a matrix; leave one of them out", id="matrix and part"),
        pytest.param("a.json", json.dumps({"T_lidar_camera": T.tolist(), "T_camera_lidar": T.tolist()}),
                     "T_camera_lidar and T_lidar_camera contradict each other", id="two matrices"),
        pytest.param("a.json", json.dumps({"R": 1}), "unknown key 'R'.*; name the parts, as translation: ", id="none"),
        pytest.param("a.json", '{"pose_of": "camera"}', "'translation' missing; .*; name the parts, as", id="no part"),
        pytest.param("a.json", json.dumps(ROS | {"translation": {"a": 1}}),
                     r"translation: found keys a, expected .* as {x: 0.0, y: 0.0, z: 0.0}", id="axes"),
        pytest.param("a.json", json.dumps(NAMED | {"quaternion_wxyz": {}}),
                     r"found keys none, expected .* {w: 1.0, x: 0.0,", id="no axes"),
        pytest.param("a.json", '{"T_camera_lidar": {"matrix": 1}}',
                     r"T_camera_lidar: key 'data' missing; found matrix; write .* rows: 1, cols: 2, data: \[1.0, 0.5\]",
                     id="matrix"),
        pytest.param("a.json", json.dumps(PARTS | {"optical": 3}), "optical: ", id="optical"),
        pytest.param(
            "a.json", json.dumps(ROS | {"quaternion_xyzw": [0, 0, 0, 1]}), "expected one of", id="two rotations"
        ),
        pytest.param("a.txt", "1 0 0 nan 0 1 0 0 0 0 1 0", "expected finite numbers, got nan", id="NaN"),
        pytest.param(
            "a.json",
            '{"optical": true, "optical": false, ' + json.dumps(PARTS)[1:],
            "'optical' stands there twice",
            id="twice",
        ),
        pytest.param("a.txt", ROWS.replace("-1.0", "1.0", 1), "deviates|a mirror", id="mirror"),
    ],
)  # fmt: skip
def test_faults_are_named_with_their_file(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(ldls.LdlsError, match=rf"{name}.*({message})"):
        as_extrinsic(tmp_path / name)


def test_the_example_of_errors_is_a_transform(tmp_path):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    (tmp_path / "a.yaml").write_text(f"--- {{{EXAMPLE.removeprefix('name the parts, as ')}}}")
    np.testing.assert_array_equal(as_extrinsic(tmp_path / "a.yaml")[:3, 3], [-0.1, 0, 0.2])


def test_a_camera_takes_the_file_beside_it(tmp_path):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    (tmp_path / "camera.yaml").write_text("K: [50, 0, 40, 0, 50, 30, 0, 0, 1]\nD: []\n")
    (tmp_path / "lidar.json").write_text(json.dumps(PARTS))
    for extrinsic in (tmp_path / "lidar.json", PARTS):
        camera = ldls.read_camera(tmp_path / "camera.yaml", T_camera_lidar=extrinsic)
        np.testing.assert_allclose(camera.T_camera_lidar, T, atol=1e-12)

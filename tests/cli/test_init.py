"""`ldls init`: the ldls.toml of folders as people have them, and what it says is missing."""

import json
import os
import shlex
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ldls
import ldls.errors
from command import command
from datasets import layouts
from ldls.datasets import open_source
from ldls.simulation import sample_frame
from ldls.simulation.kitti_layout import calibration_lines

NAMES = ("000007", "000008", "000011")


@pytest.fixture
def rig(tmp_path, sample):
    """Sweeps, images and YOLO's masks of three frames, without calibration."""
    (image,) = sample.images
    for name in NAMES:
        write(tmp_path / f"lidar/{name}.bin", np.asarray(sample.points, np.float32).tobytes())
        (tmp_path / "front").mkdir(exist_ok=True)
        Image.fromarray(image.read()).save(tmp_path / f"front/{name}.png")
        write(tmp_path / f"labels/{name}.txt", b"2 0.1 0.4 0.2 0.4 0.2 0.6 0.1 0.6\n")
    return tmp_path


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())


def intrinsics(camera):
    K = camera.projection[:, :3].ravel().tolist()
    return f"camera_matrix: {K}\ndistortion_coefficients: [0, 0, 0, 0, 0]\nimage_width: 1242\nimage_height: 375\n"


def rows(matrix):
    return "\n".join(" ".join(repr(float(value)) for value in row) for row in matrix)


def described(folder):
    return tomllib.loads((folder / "ldls.toml").read_text())


def pose(camera):
    """x y z and the quaternion x y z w of the camera in the lidar frame."""
    matrix = np.linalg.inv(camera.T_camera_lidar)
    w = np.sqrt(1 + np.trace(matrix[:3, :3])) / 2
    R = matrix[:3, :3]
    xyz = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w)
    return matrix[:3, 3].tolist(), [*xyz.tolist(), float(w)]


def in_kitti_files(folder, camera):
    for name in NAMES:
        write(folder / f"calib/{name}.txt", "\n".join(calibration_lines(camera)) + "\n")


def in_parts_that_say_how(folder, camera):
    translation, quaternion = pose(camera)
    write(folder / "camera.yaml", intrinsics(camera))
    parts = {"translation": translation, "quaternion_xyzw": quaternion, "pose_of": "camera"}
    write(folder / "extrinsic.json", json.dumps(parts))


def in_a_matrix_the_other_way_round(folder, camera):
    cam = {"K": camera.projection[:, :3].tolist(), "D": [0.0] * 5}
    tf = np.linalg.inv(camera.T_camera_lidar).tolist()
    write(folder / "config.json", json.dumps({"cam": cam, "other": 4, "tf": tf}))


def in_parts_that_leave_it_open(folder, camera):
    translation, (x, y, z, w) = pose(camera)
    write(folder / "camera.yaml", intrinsics(camera))
    rotation = f"{{x: {x}, y: {y}, z: {z}, w: {w}}}"
    write(folder / "mount.yaml", f"lidar_to_cam:\n  translation: {translation}\n  rotation: {rotation}\n")


def in_angles_that_leave_it_open(folder, camera):
    translation, _ = pose(camera)
    R = np.linalg.inv(camera.T_camera_lidar)[:3, :3]
    angles = np.degrees([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]), np.arctan2(R[1, 0], R[0, 0])])
    write(folder / "camera.yaml", intrinsics(camera))
    write(folder / "mount.yaml", f"translation: {translation}\nroll_pitch_yaw_deg: {angles.tolist()}\n")


def in_rows_of_numbers(folder, camera):
    write(folder / "front.yaml", intrinsics(camera))
    write(folder / "T.txt", rows(camera.T_camera_lidar))


def in_rows_of_numbers_the_other_way_round(folder, camera):
    write(folder / "front.yaml", intrinsics(camera))
    write(folder / "T.txt", rows(np.linalg.inv(camera.T_camera_lidar)))


@pytest.mark.parametrize(
    "calibrate",
    [
        in_kitti_files,
        in_parts_that_say_how,
        in_a_matrix_the_other_way_round,
        in_parts_that_leave_it_open,
        in_angles_that_leave_it_open,
        in_rows_of_numbers,
        in_rows_of_numbers_the_other_way_round,
    ],
    ids=lambda each: each.__name__,
)
def test_the_camera_is_found_and_the_folder_is_a_source(rig, sample, calibrate):
    camera = sample.images[0].camera
    calibrate(rig, camera)
    outcome = command("init", rig)
    assert outcome.exit_code == 0, outcome.output
    assert "missing" not in outcome.output
    assert "3 images of 375 x 1242 (height x width), 3 with a sweep" in " ".join(outcome.output.split())
    assert described(rig)["points"] == "lidar/{frame}.bin"
    assert described(rig)["cameras"]["front"]["masks"] == "labels/{frame}.txt"
    source = open_source(rig)
    assert source.names == NAMES
    read = source[0].images[0]
    np.testing.assert_allclose(read.camera.T_camera_lidar, camera.T_camera_lidar, atol=1e-6)
    np.testing.assert_allclose(read.camera.projection[:, :3], camera.projection[:, :3], atol=1e-6)
    assert command("info", rig).exit_code == 0
    done = command("run", rig, "--masks", rig / "labels", "--out", rig / "out")
    assert done.exit_code == 0, done.output


def write_masks_of_all(path, images):
    """COCO's data set with one mask of each of these images."""
    mask = {"category_id": 3, "segmentation": [[100, 100, 200, 100, 200, 200]], "iscrowd": 0}
    records = [{"id": k, "file_name": name, "height": 375, "width": 1242} for k, name in enumerate(images)]
    annotations = [mask | {"id": k, "image_id": k} for k in range(len(images))]
    write(path, json.dumps({"images": records, "annotations": annotations, "categories": [{"id": 3, "name": "car"}]}))


@pytest.mark.parametrize(
    ("place", "images", "expected"),
    [
        pytest.param("all.json", [f"{name}.png" for name in NAMES], "all.json", id="beside the folders"),
        pytest.param("a/instances_2.json", [f"x/{name}.jpg" for name in NAMES], "a/instances_2.json", id="in a folder"),
        pytest.param("all.json", ["1.png"], None, id="of other images"),
    ],
)  # fmt: skip
def test_one_file_with_the_masks_of_all_images_is_found(rig, sample, place, images, expected):
    in_kitti_files(rig, sample.images[0].camera)
    shutil.rmtree(rig / "labels")
    write_masks_of_all(rig / place, images)
    assert command("init", rig).exit_code == 0
    assert described(rig)["cameras"]["front"].get("masks") == expected
    assert expected is None or len(open_source(rig)[0].images[0].masks) == 1


def test_masks_of_cameras_are_of_those_that_they_name(rig, sample):
    write_rig(rig, sample, ("back_left", "left", "rear"))
    write(rig / f"masks/back_left/{NAMES[0]}.txt", b"2 0.1 0.4 0.2 0.4 0.2 0.6 0.1 0.6\n")
    write_masks_of_all(rig / "all.json", [f"left/{name}.png" for name in NAMES])
    assert command("init", rig).exit_code == 0
    found = {name: camera.get("masks") for name, camera in described(rig)["cameras"].items()}
    assert found == {
        "images_back_left": "masks/back_left/{frame}.txt",
        "images_left": "all.json",
        "images_rear": None,
    }


def test_what_was_guessed_is_a_question(rig, sample):
    in_a_matrix_the_other_way_round(rig, sample.images[0].camera)
    assert command("init", rig).exit_code == 0
    questions = [line for line in (rig / "ldls.toml").read_text().splitlines() if line.startswith("# ?")]
    assert any("tf of config.json, turned round, one of 2 ways to read it" in line for line in questions)
    assert any("points are in view of front" in line for line in questions)


def test_other_ways_to_read_a_transform_are_listed(rig, sample):
    camera = sample.images[0].camera
    translation, (x, y, z, w) = pose(camera)
    write(rig / "camera.yaml", intrinsics(camera))
    write(rig / "mount.yaml", f"translation: {translation}\nrotation: [{w}, {x}, {y}, {z}]\n")
    assert command("init", rig).exit_code == 0
    text = (rig / "ldls.toml").read_text()
    listed = [line.removeprefix("# ") for line in text.splitlines() if "T_camera_lidar = " in line]
    assert len(listed) > 1
    matrices = [tomllib.loads(line)["T_camera_lidar"] for line in listed]
    assert any(np.allclose(matrix, camera.T_camera_lidar, atol=1e-6) for matrix in matrices)
    assert "quaternion_wxyz" in text


def test_two_cameras_have_the_files_of_their_names(rig, sample):
    camera = sample.images[0].camera
    shutil.copytree(rig / "front", rig / "left")
    for name, focal in (("left", 500.0), ("front", 721.0)):
        K = [[focal, 0, 609.6], [0, focal, 172.9], [0, 0, 1]]
        calibration = {"camera_matrix": K, "distortion_coefficients": [], "image_width": 1242, "image_height": 375}
        write(rig / f"calibration/{name}.yaml", json.dumps(calibration))
    write(rig / "calibration/extrinsic.txt", rows(camera.T_camera_lidar))
    assert command("init", rig).exit_code == 0
    focals = {image.name: image.camera.projection[0, 0] for image in open_source(rig)[0].images}
    assert focals == {"front": 721.0, "left": 500.0}


def write_rig(rig, sample, names):
    """Images, a calibration and a transform of each camera, without masks; each has its own focal length."""
    camera = sample.images[0].camera
    for number, name in enumerate(names):
        shutil.copytree(rig / "front", rig / "images" / name)
        K = [[500 + number, 0, 609.6], [0, 500 + number, 172.9], [0, 0, 1]]
        calibration = {"camera_matrix": K, "distortion_coefficients": [], "image_width": 1242, "image_height": 375}
        write(rig / f"{name}.yaml", json.dumps(calibration))
        write(rig / f"{name}_T.txt", rows(camera.T_camera_lidar))
    shutil.rmtree(rig / "front")
    shutil.rmtree(rig / "labels")


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(("front", "rear"), id="two"),
        pytest.param(("back_left", "left"), id="one in the name of the other"),
        pytest.param(("r", "l"), id="letters that are in other words"),
        pytest.param(("front", "left", "rear", "right"), id="four"),
        pytest.param(("cam0", "cam1", "cam2", "cam3"), id="numbered"),
        pytest.param(("cam7", "cam8", "cam9", "cam10", "cam11"), id="numbered like the frames"),
    ],
)
def test_cameras_in_a_folder_have_the_files_of_their_names(rig, sample, names):
    write_rig(rig, sample, names)
    for path in rig.rglob("0000*"):
        path.rename(path.with_stem(str(int(path.stem))))
    assert command("init", rig).exit_code == 0
    assert "# ? is this" not in (rig / "ldls.toml").read_text()
    cameras = described(rig)["cameras"].values()
    named = {
        Path(camera["images"]).parent.name: (camera["calibration"], camera["T_camera_lidar"]) for camera in cameras
    }
    assert named == {name: (f"{name}.yaml", f"{name}_T.txt") for name in names}


@pytest.mark.parametrize("lacks_one", [False, True], ids=["each", "not each"])
@pytest.mark.parametrize("camera", ["front", "7"])
def test_calibrations_named_like_frames_are_of_frames(rig, sample, camera, lacks_one):
    in_kitti_files(rig, sample.images[0].camera)
    for path in rig.rglob("0000*"):
        path.rename(path.with_stem(str(int(path.stem))))
    (rig / "front").rename(rig / camera)
    if lacks_one:
        min((rig / "calib").iterdir()).unlink()
    assert command("init", rig).exit_code == 0
    assert described(rig)["cameras"][camera]["calibration"] == "calib/{frame}.txt"


def test_one_calibration_with_a_number_is_a_file(rig, sample):
    camera = sample.images[0].camera
    write(rig / "cam0.yaml", intrinsics(camera))
    write(rig / "T0.txt", rows(camera.T_camera_lidar))
    assert command("init", rig).exit_code == 0
    assert described(rig)["cameras"]["front"]["calibration"] == "cam0.yaml"
    assert len(open_source(rig)) == len(NAMES)


@pytest.mark.parametrize("has_own", [True, False], ids=["of its own", "of the other"])
def test_a_transform_of_the_camera_goes_before_one_that_shows_more_points(rig, sample, has_own):
    write_rig(rig, sample, ("front", "rear"))
    turn = np.diag([-1.0, -1, 1, 1])
    ahead = np.asarray(sample.points[::50, :3]) @ turn[:3, :3]
    for path in (rig / "lidar").iterdir():
        points = np.zeros((len(sample.points) + len(ahead), 4), np.float32)
        points[:, :3] = np.concatenate([sample.points[:, :3], ahead])
        write(path, points.tobytes())
    own = rig / "rear_T.txt"
    if has_own:
        write(own, rows(sample.images[0].camera.T_camera_lidar @ turn))
    else:
        own.unlink()
    assert command("init", rig).exit_code == 0
    rear = described(rig)["cameras"]["images_rear"]
    assert rear["T_camera_lidar"] == ("rear_T.txt" if has_own else "front_T.txt")
    asked = (rig / "ldls.toml").read_text().count("is this the transform of this camera? Its file is not named like it")
    assert asked == (0 if has_own else 1)


def test_links_that_lead_out_are_warned_of_with_what_allows_them(rig, sample, tmp_path_factory):
    in_kitti_files(rig, sample.images[0].camera)
    for path in (rig / "lidar").iterdir():
        path.symlink_to(shutil.move(path, tmp_path_factory.mktemp("elsewhere") / path.name))
    outcome = command("init", rig)
    assert outcome.exit_code == 0, outcome.output
    assert f"warning: {rig}: links lead out of it; copy their files there, or give each command" in outcome.stderr
    allowed = ("--option", "allow_outside=true")
    assert " ".join(allowed) in outcome.stdout and command("info", rig, *allowed).exit_code == 0
    refused = command("info", rig)
    assert refused.stderr.rstrip().endswith(f"; copy it there, or pass {' '.join(allowed)}"), refused.output


def test_names_that_are_times(tmp_path, sample):
    camera = sample.images[0].camera
    for stamp in ("1547131046.353", "1547131046.453", "1547131046.553", "1547131047.653"):
        write(tmp_path / f"os1/{stamp}.bin", np.asarray(sample.points, np.float32).tobytes())
        (tmp_path / "cam").mkdir(exist_ok=True)
        Image.fromarray(sample.images[0].read()).save(tmp_path / f"cam/{stamp}.jpg")
    in_rows_of_numbers(tmp_path, camera)
    assert command("init", tmp_path).exit_code == 0
    assert len(open_source(tmp_path)) == 4


def test_rows_of_six_floats(rig, sample):
    wide = np.zeros((len(sample.points), 6), np.float32)
    wide[:, :4] = sample.points
    wide[:, 4:] = 0.37
    for name in NAMES:
        write(rig / f"lidar/{name}.bin", wide.tobytes())
    in_rows_of_numbers(rig, sample.images[0].camera)
    assert command("init", rig).exit_code == 0
    assert described(rig)["columns"] == 6
    np.testing.assert_array_equal(open_source(rig)[0].points[:, :3], sample.points[:, :3])


@pytest.mark.parametrize("name", ['left "one"', "back\\slash", "tab\tand\nline", "über", "\x7f"])
def test_names_of_any_text_are_quoted(rig, sample, name):
    (rig / "front").rename(rig / name)
    (rig / "lidar").rename(rig / f"lidar {name}")
    (rig / "labels").rename(rig / f"labels {name}")
    (calibration,) = (image.camera for image in sample.images)
    write(rig / f"{name}.yaml", intrinsics(calibration))
    write(rig / f"{name}.txt", rows(calibration.T_camera_lidar))
    result = command("init", rig)
    assert result.exit_code == 0, result.output
    assert described(rig)["points"] == f"lidar {name}/{{frame}}.bin"
    (camera,) = next(iter(open_source(rig))).images
    np.testing.assert_allclose(camera.camera.T_camera_lidar, calibration.T_camera_lidar)


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
def test_a_name_that_is_no_text_is_named(rig):
    (rig / "lidar").rename(rig / os.fsdecode(b"lidar\xff"))
    result = command("init", rig)
    assert result.exit_code == 1
    assert "not in UTF-8 cannot stand in ldls.toml; rename it" in " ".join(result.output.split())
    assert not (rig / "ldls.toml").exists()


NO_TRANSFORM = "where the lidar is, for front: found no transform, none of 2 tried shows a point"


def _with_a_transform_in_millimetres(rig):
    camera = sample_frame().images[0].camera
    write(rig / "front.yaml", intrinsics(camera))
    write(rig / "T.txt", rows(np.column_stack([camera.T_camera_lidar[:3, :3], 1000 * camera.T_camera_lidar[:3, 3]])))


@pytest.mark.parametrize(
    ("harm", "missing"),
    [
        pytest.param(lambda rig: None, "calibration of front: found none", id="no calibration"),
        pytest.param(lambda rig: shutil.rmtree(rig / "front"), "images: found none", id="no images"),
        pytest.param(
            lambda rig: [path.rename(path.with_name(f"x{int(path.stem)}.png")) for path in (rig / "front").iterdir()],
            "images: no image has the name of a sweep (front/x{frame}.png: 11, lidar/{frame}.bin: 000007)",
            id="other names",
        ),
        pytest.param(
            lambda rig: write(rig / "camera.yaml", intrinsics(sample_frame().images[0].camera)),
            "where the lidar is, for front: found no transform; docs",
            id="no transform",
        ),
        pytest.param(
            _with_a_transform_in_millimetres,
            f"{NO_TRANSFORM} (T_camera_lidar: the lidar is 288 m from",
            id="no transform in metres",
        ),
    ],
)
def test_what_is_missing_is_said_and_the_rest_is_written(rig, harm, missing):
    harm(rig)
    outcome = command("init", rig)
    assert outcome.exit_code == 1
    assert f"missing  {missing}" in outcome.output
    assert described(rig)["points"] == "lidar/{frame}.bin"


@pytest.mark.parametrize(
    ("points", "translation", "warnings"),
    [
        pytest.param(1, 1, [], id="metres"),
        pytest.param(1000, 1, ["lidar/{frame}.bin: points: extent is"], id="clouds"),
        pytest.param(1000, 1000, ["lidar/{frame}.bin: points: extent is", "front: T_camera_lidar: the lidar is 288 m"],
                     id="both"),
    ],
)  # fmt: skip
def test_millimetres_are_warned_of(rig, sample, points, translation, warnings):
    scaled = np.asarray(sample.points, np.float32) * np.float32([points, points, points, 1])
    write(rig / f"lidar/{NAMES[0]}.bin", scaled.tobytes())
    camera = sample.images[0].camera
    T = camera.T_camera_lidar * [[1, 1, 1, translation]]
    T[3, 3] = 1
    write(rig / "front.yaml", intrinsics(camera))
    write(rig / "T.txt", rows(T))
    outcome = command("init", rig)
    assert outcome.exit_code == 0, outcome.output
    said = [line for line in outcome.stderr.splitlines() if line.startswith("warning: ")]
    assert all(line.startswith(f"warning: {each}") for line, each in zip(said, warnings, strict=True)), said
    assert all("in metres? Divide millimetres by 1000" in line for line in said)
    distant = "T_camera_lidar: the lidar is 288 m from the camera; is its"
    assert (distant in " ".join(command("info", rig).output.replace("│", " ").split())) == (translation > 1)


def test_a_file_that_is_there_is_kept(rig):
    (rig / "ldls.toml").write_text("mine")
    outcome = command("init", rig)
    assert outcome.exit_code == 1
    assert "ldls.toml: is there already" in outcome.stderr
    assert (rig / "ldls.toml").read_text() == "mine"


def test_a_folder_without_a_sweep(tmp_path):
    write(tmp_path / "notes.md", "nothing")
    outcome = command("init", tmp_path)
    assert outcome.exit_code == 1
    assert "no file is a lidar sweep" in outcome.stderr
    assert "found notes.md" in outcome.stderr
    assert not (tmp_path / "ldls.toml").exists()


@pytest.mark.skipif("LDLS_TEST_DATA" not in os.environ, reason="LDLS_TEST_DATA is not set")
def test_real_folders(tmp_path):
    real = Path(os.environ["LDLS_TEST_DATA"]) / "real"
    if not real.exists():
        pytest.skip("LDLS_TEST_DATA has no folder real")
    drive = command("init", real / "kitti_raw/2011_09_26/2011_09_26_drive_0005_sync")
    assert "is read as it is (kitti-raw)" in drive.output
    shutil.copytree(real / "boards", tmp_path / "boards", copy_function=shutil.copyfile)
    outcome = command("init", tmp_path / "boards")
    assert outcome.exit_code == 0, outcome.output
    with pytest.warns(ldls.errors.LeftOutWarning, match="7 of 8 sweeps are left out: 7 no cameras.camera"):
        camera = open_source(tmp_path / "boards")[0].images[0].camera
    config = json.loads((real / "boards/config.json").read_text())
    np.testing.assert_allclose(camera.T_camera_lidar, config["tf"])
    assert camera.distortion == ldls.Distortion("plumb_bob", tuple(config["cam"]["D"]))


def test_the_commands_that_are_next_can_be_pasted(rig, sample, tmp_path):
    folder = tmp_path / "mein Ordner ü"
    folder.mkdir()
    for name in ("lidar", "front", "labels"):
        (tmp_path / name).rename(folder / name)
    following = f"ldls info {shlex.quote(str(folder))} --picture check.png"
    assert f"then: {following}\n" in command("init", folder).output
    (folder / "ldls.toml").unlink()
    in_kitti_files(folder, sample.images[0].camera)
    assert f"next: {following};" in command("init", folder).output


@pytest.mark.parametrize("inside", ["", "a drive"])
def test_the_command_for_what_is_read_as_it_is_can_be_pasted(tmp_path, inside):
    source = layouts.many_frames(tmp_path / "two words" / inside, 1)
    outcome = command("init", tmp_path / "two words")
    assert outcome.output.endswith(f"next: ldls info '{source}'\n"), outcome.output

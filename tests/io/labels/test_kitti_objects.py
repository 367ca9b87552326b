from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.camera.rigid import transformed
from ldls.errors import CorruptFileError, InputError, TruncatedFileError
from ldls.evaluation import ClassSet
from ldls.io.labels.kitti_objects import KittiObject, label_by_boxes, read_kitti_boxes, read_kitti_objects
from ring_samples import as_views, random_ring

ROW = "Car 0.25 1 -1.57 599.41 156.40 629.75 189.25 1.5 1.6 4.0 1.0 1.5 20.0 -1.56"
BOX = KittiObject(
    type="Car", truncated=0, occluded=0, alpha=0, bbox=(0, 0, 1, 1),
    dimensions=(1.5, 1.6, 4.0), location=(1.0, 1.5, 20.0), rotation_y=0.0,
)  # fmt: skip
# lidar axes as the camera's: x right, y down, z forward
CAMERA = ldls.Camera(projection=[[100.0, 0, 50], [0, 100, 40], [0, 0, 1]], image_size=(80, 100))


def test_classes_are_spelled_as_kitti_does(tmp_path):
    names = ("CAR", "dontcare", "person_Sitting", "tractor")
    (tmp_path / "a.txt").write_text("".join(f"{name} {ROW.partition(' ')[2]}\n" for name in names))
    found = read_kitti_objects(tmp_path / "a.txt")
    assert [each.type for each in found] == ["Car", "DontCare", "Person_sitting", "tractor"]
    assert [each.is_region for each in found] == [False, True, False, False]


def test_objects_have_all_fields(tmp_path):
    (tmp_path / "a.txt").write_text(
        f"{ROW}\n{ROW} 0.9\n\nDontCare -1 -1 -10 1 2 3 4 -1 -1 -1 -1000 -1000 -1000 -10\r\n"
    )
    car, scored, region = read_kitti_objects(tmp_path / "a.txt")
    assert car == KittiObject(
        type="Car", truncated=0.25, occluded=1, alpha=-1.57, bbox=(599.41, 156.40, 629.75, 189.25),
        dimensions=(1.5, 1.6, 4.0), location=(1.0, 1.5, 20.0), rotation_y=-1.56,
    )  # fmt: skip
    assert scored == replace(car, score=0.9)
    assert (region.is_region, car.is_region) == (True, False)
    (tmp_path / "b.txt").write_text("")
    assert read_kitti_objects(tmp_path / "b.txt") == ()


@pytest.mark.parametrize(
    ("row", "error", "message"),
    [
        pytest.param(ROW.rsplit(" ", 1)[0], TruncatedFileError, "line 2: expected 15 fields.*got 14", id="14 fields"),
        pytest.param(f"{ROW} 1 2", CorruptFileError, "line 2: expected 15 fields.*got 17", id="17 fields"),
        pytest.param(ROW.replace("20.0", "nan"), CorruptFileError, "a finite number, got 'nan'", id="nan"),
        pytest.param(ROW.replace("20.0", "2_0.0"), CorruptFileError, "got '2_0.0'", id="underscore"),
        pytest.param(ROW.replace("20.0", "20,0"), CorruptFileError, "got '20,0'", id="decimal comma"),
    ],
)
def test_broken_rows_are_named(tmp_path, row, error, message):
    (tmp_path / "a.txt").write_text(f"{ROW}\n{row}\n")
    with pytest.raises(error, match=message):
        read_kitti_objects(tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("point", "turn", "inside"),
    [
        pytest.param((1.0, 1.5, 20.0), 0.0, True, id="middle of the bottom"),
        pytest.param((1.0, 0.0, 20.0), 0.0, True, id="middle of the roof"),
        pytest.param((1.0, -0.01, 20.0), 0.0, False, id="above"),
        pytest.param((1.0, 1.51, 20.0), 0.0, False, id="below"),
        pytest.param((2.9, 1.0, 20.0), 0.0, True, id="length lies along x"),
        pytest.param((1.0, 1.0, 21.9), 0.0, False, id="width lies along z"),
        pytest.param((2.9, 1.0, 20.0), np.pi / 2, False, id="turned: width along x"),
        pytest.param((1.0, 1.0, 21.9), np.pi / 2, True, id="turned: length along z"),
        # rotation_y turns x towards -z: the nose of a box turned by 45 degrees points right and back
        pytest.param((2.3, 1.0, 18.7), np.pi / 4, True, id="45 degrees, along the nose"),
        pytest.param((2.3, 1.0, 21.3), np.pi / 4, False, id="45 degrees, across the nose"),
        pytest.param((2.5, 1.0, 18.5), np.pi / 4, False, id="45 degrees, beyond the nose"),
        pytest.param((np.nan, 1.0, 20.0), 0.0, False, id="nan"),
        pytest.param((np.inf, 1.0, np.inf), np.pi / 4, False, id="infinite"),
    ],
)
def test_points_in_a_box(point, turn, inside):
    assert replace(BOX, rotation_y=turn).contains(np.array([point])).tolist() == [inside]


def test_boxes_regions_and_view_label_points():
    person = replace(BOX, type="Pedestrian", dimensions=(1.5, 0.5, 0.5), location=(0.0, 1.5, 20.0))
    region = replace(BOX, type="DontCare", bbox=(0, 0, 20, 79), dimensions=(-1, -1, -1), location=(-1000,) * 3)
    points = np.array([
        [1.5, 1.0, 20.0],  # in the car
        [0.0, 1.0, 20.0],  # in the person's box and the car's
        [-8.0, 0.0, 20.0],  # pixel u = 10: in the region
        [5.0, 0.0, 20.0],  # nowhere
        [1.0, 1.0, -20.0],  # behind
        [30.0, 0.0, 20.0],  # beside the image
        [np.nan, 0.0, 1.0],
    ])  # fmt: skip
    found = label_by_boxes([person, region, BOX], points, CAMERA)
    assert [found.names[c] for c in found.classes] == ["Car", "Pedestrian", "DontCare"] + ["background"] * 4
    assert found.instances.tolist() == [3, 1, 0, 0, 0, 0, 0]
    assert found.ignored.tolist() == [False] * 4 + [True] * 3
    # the order of the rows does not choose between boxes
    assert label_by_boxes([BOX, region, person], points, CAMERA).classes.tolist() == found.classes.tolist()


def test_a_box_whose_volume_is_beyond_float64_is_the_largest():
    huge = replace(BOX, type="Tram", dimensions=(1e308,) * 3)
    found = label_by_boxes([BOX, huge], np.array([[1.5, 1.0, 20.0], [5.0, 1.0, 20.0]]), CAMERA)
    assert [found.names[c] for c in found.classes] == ["Car", "Tram"]


def test_an_object_in_a_region_keeps_its_points():
    region = replace(BOX, type="DontCare", bbox=(0, 0, 99, 79))
    found = label_by_boxes([BOX, region], np.array([[1.5, 1.0, 20.0]]), CAMERA)
    assert found.names[found.classes[0]] == "Car"


def test_classes_of_ones_own_and_rows_without_a_box_are_accepted():
    own = replace(BOX, type="Tractor")
    flat = replace(BOX, dimensions=(-1, -1, -1), location=(-1000,) * 3)
    found = label_by_boxes([flat, own], np.array([[1.5, 1.0, 20.0]]), CAMERA)
    assert found.names[found.classes[0]] == "Tractor"
    assert found.instances.tolist() == [2]


def test_what_is_no_object_is_refused():
    with pytest.raises(InputError, match=r"objects: expected a list of KittiObject, got int in a list; ldls"):
        label_by_boxes([1], np.zeros((3, 3)), CAMERA)


def test_no_objects_are_all_background():
    found = label_by_boxes([], np.array([[0.0, 0, 10]]), CAMERA)
    assert (found.classes.tolist(), found.ignored.tolist()) == ([0], [False])


@pytest.mark.parametrize(
    ("name", "classes"),
    [
        pytest.param("000000", {"Pedestrian"}, id="a pedestrian"),
        pytest.param("000001", {"Truck", "Car", "Cyclist"}, id="far away"),
        pytest.param("000002", {"Misc", "Car"}, id="misc"),
        pytest.param("000003", {"Car", "DontCare"}, id="a car and regions"),
    ],
)
def test_real_boxes_hold_points(data_folder, name, classes):
    training = data_folder / "kitti/training"
    points = ldls.read_points(training / f"velodyne/{name}.bin")
    camera = ldls.read_camera(training / f"calib/{name}.txt")
    found = read_kitti_boxes(training / f"label_2/{name}.txt", points=points, camera=camera)
    counts = {name for name, count in found.counts().items() if count} - {"background"}
    assert counts == classes
    assert 15_000 < (~found.ignored).sum() < 25_000


TURNED = np.array([[0.8, 0, -0.6, 0.3], [0, 1, 0, -0.2], [0.6, 0, 0.8, 0.5], [0, 0, 0, 1]])
PITCHED = np.array([[1, 0, 0, 0.3], [0, 0.96, -0.28, -0.2], [0, 0.28, 0.96, 0.5], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    "camera",
    [
        pytest.param({}, id="lidar axes are the camera's"),
        pytest.param({"T_camera_lidar": TURNED}, id="turned about the camera's y axis"),
        pytest.param({"T_camera_lidar": PITCHED}, id="looks down, so that the boxes of the lidar frame stand askew"),
        pytest.param({"distortion": ldls.Distortion("plumb_bob", [-0.1, 0.01, 0, 0, 0])}, id="not rectified"),
    ],
)
def test_boxes_that_are_written_hold_the_points_of_their_object(small_scene, tmp_path, camera):
    points, masks, straight = small_scene
    seen_by = replace(straight, **camera)
    # the scene stands before the camera, wherever that is
    back = np.linalg.inv(seen_by.T_camera_lidar)
    placed = points @ back[:3, :3].T + back[:3, 3]
    result = ldls.segment(placed, masks, seen_by)
    ldls.save(result, tmp_path / "a.txt")
    rows = read_kitti_objects(tmp_path / "a.txt")
    assert [row.type for row in rows] == ["Pedestrian", "Car"]
    in_camera = transformed(placed, seen_by.T_camera_lidar)
    for row, found in zip(rows, result.objects, strict=True):
        own = result.labels == found.label
        assert found.n_points > 50 and row.contains(in_camera[own]).all()
        # and no larger than they need
        low, high = in_camera[own].min(axis=0), in_camera[own].max(axis=0)
        assert row.dimensions[0] == pytest.approx(high[1] - low[1], abs=2e-3)
        assert row.location[1] == pytest.approx(high[1], abs=2e-4)
        x, _, z = row.location
        assert row.alpha == pytest.approx((row.rotation_y - np.arctan2(x, z) + np.pi) % (2 * np.pi) - np.pi, abs=2e-4)
        assert -np.pi <= row.rotation_y <= np.pi
        assert (row.truncated, row.occluded, row.score) == (-1, 3, pytest.approx(found.score, abs=1e-4))


def test_rectangles_that_are_written_are_those_of_the_masks(small_scene, tmp_path):
    points, masks, camera = small_scene
    ldls.save(ldls.segment(points, masks, camera), tmp_path / "a.txt")
    assert [row.bbox for row in read_kitti_objects(tmp_path / "a.txt")] == [(17, 23, 28, 37), (51, 23, 62, 37)]
    again = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))
    np.testing.assert_array_equal(again.to_array(), masks.to_array())
    assert [mask.name for mask in again] == ["person", "car"]


def test_objects_without_points_have_no_line(small_scene, tmp_path):
    points, masks, camera = small_scene
    ldls.save(ldls.segment(points[:0], masks, camera), tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_bytes() == b""


@pytest.mark.parametrize(
    ("name", "written"),
    [
        pytest.param("car", "Car", id="COCO's car"),
        pytest.param("person", "Pedestrian", id="COCO's person"),
        pytest.param("train", "Tram", id="COCO's train"),
        pytest.param("PERSON", "Pedestrian", id="capitals"),
        pytest.param("bicyclist", "Cyclist", id="SemanticKITTI's cyclist"),
        pytest.param("vehicle.car", "Car", id="nuScenes' car"),
        pytest.param("Van", "Van", id="KITTI's own"),
        pytest.param("cyclist", "Cyclist", id="KITTI's in small letters"),
        pytest.param("bicycle", "bicycle", id="none of KITTI's"),
        pytest.param("traffic light", "traffic_light", id="two words"),
        pytest.param("a\tb\nc", "a_b_c", id="all kinds of blanks"),
    ],
)
def test_names_become_types_of_kitti(small_scene, tmp_path, name, written):
    points, masks, camera = small_scene
    named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[200, 200], names={200: name})
    ldls.save(ldls.segment(points, named, camera), tmp_path / "a.txt")
    assert {row.type for row in read_kitti_objects(tmp_path / "a.txt")} == {written}


def test_names_of_two_words_can_be_read_again(small_scene, tmp_path):
    points, masks, camera = small_scene
    plants = ldls.InstanceMasks.from_array(masks.to_array(), categories=[64, 10])
    ldls.save(ldls.segment(points, plants, camera), tmp_path / "a.txt")
    again = ldls.read_masks(tmp_path / "a.txt", image_size=(60, 80))
    assert [mask.name for mask in again] == ["potted plant", "traffic light"]
    labeling = read_kitti_boxes(tmp_path / "a.txt", points=points, camera=camera)
    scored = ClassSet(names=("traffic light", "Potted Plant"))
    assert set(scored.map(labeling, truth=False).classes) == {0, 1, 2}


def test_several_cameras_are_refused(tmp_path):
    points, views = random_ring(3)
    with pytest.raises(InputError, match=r"a\.txt: KITTI's labels are of one camera, the result has 3; save_objects"):
        ldls.save(ldls.segment(points, as_views(views)), tmp_path / "a.txt")
    assert not (tmp_path / "a.txt").exists()


def test_real_objects_lie_in_the_boxes_that_are_written(kitti_frame, tmp_path):
    result = ldls.segment(kitti_frame.points, kitti_frame.masks, kitti_frame.camera)
    ldls.save(result, tmp_path / "a.txt")
    points = transformed(kitti_frame.points, kitti_frame.camera.T_camera_lidar)
    found = [each for each in result.objects if each.n_points]
    for row, each in zip(read_kitti_objects(tmp_path / "a.txt"), found, strict=True):
        assert row.contains(points[result.labels == each.label]).all()

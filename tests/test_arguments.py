"""Arguments of a wrong type or shape: every public function and class refuses them by name."""

import re
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import ldls
from conftest import pinhole
from ldls import evaluation, stages
from ldls.segmentation import fit_upright_box

NONSENSE = [
    None, True, -1, 10**400, float("nan"), 1e308, "x", b"x", object(), {}, {"a": 1}, [], [1], ["a"], [None],
    [[1, 2, 3], [1, 2]], ldls.Params, ldls,
    set(), len, np.zeros((2, 2, 2), complex), np.array(["a", "b"]), np.array([object()]), np.ma.zeros((4, 3)),
    np.zeros(0), np.full((3, 3), np.nan), np.array(5), np.zeros((2, 3), "M8[s]"), np.zeros(3, "f4,f4"),
]  # fmt: skip


def world():
    """A small scene, and what the functions of the package make of it."""
    generator = np.random.default_rng(3)
    points = generator.uniform([-2, -1, 9], [2, 1, 11], (40, 3))
    pixels = np.zeros((2, 60, 80), bool)
    pixels[0, 20:40, 20:40] = pixels[1, 20:40, 42:60] = True
    masks, camera = ldls.InstanceMasks.from_array(pixels, categories=[1, 3]), pinhole()
    result = ldls.segment(points, masks, camera, params=ldls.Params.paper())
    in_view, uv = stages.project(points, camera, image_size=masks.image_size)
    xyz = points[in_view]
    heights = stages.ground(xyz, camera)
    depths = stages.depth_groups(xyz, uv, masks, camera, heights)
    indices, _ = stages.neighbors(xyz)
    graph, labels = stages.point_graph(xyz, indices), stages.pixel_labels(uv, masks)
    A, b = stages.normalize_rows(graph, labels)
    z = stages.diffuse(A, b)
    labeling = ldls.labeling.Labeling.from_segmentation(result)
    sweep = ldls.Sweep(points, [], np.eye(4), 0.0)
    tracked = replace(result, instances=tuple(replace(each, track=each.label) for each in result.instances))
    street = generator.uniform([-20, -20, -2], [20, 20, 2], (4000, 3))
    return SimpleNamespace(**locals())


W = world()
MATRIX = [[100, 0, 40], [0, 100, 30], [0, 0, 1]]
POSE = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "camera_intrinsic": MATRIX}
SENSOR = {"K": np.ravel(MATRIX), "D": [], "height": 60, "width": 80}
TORCHVISION = {"labels": [1], "scores": [0.5], "masks": np.zeros((1, 1, 4, 4))}
RLE = {"size": [2, 2], "counts": [1, 2, 1]}
COCO = {"images": [], "categories": [], "annotations": [{"image_id": 1, "category_id": 1, "segmentation": RLE}]}
CLASSES = evaluation.ClassSet(names=("person", "car"))
NAMES = ("background", "car")

CALLS = {
    "segment": (
        ldls.segment,
        {
            "points": W.points,
            "masks": W.masks,
            "camera": W.camera,
            "params": None,
            "nonfinite": "drop",
            "keep_origin": False,
            "same_object": 0.5,
        },
    ),
    "LabelDiffusion": (ldls.LabelDiffusion, {"camera": W.camera, "params": None}),
    "LabelDiffusion.segment": (
        ldls.LabelDiffusion(W.camera).segment,
        {"points": W.points, "masks": W.masks, "nonfinite": "drop", "keep_origin": False, "same_object": 1},
    ),
    "View": (ldls.View, {"masks": W.masks, "camera": W.camera, "name": "a"}),
    "Params": (ldls.Params, dict(vars(ldls.Params()))),
    "Params.paper": (ldls.Params.paper, {"threads": 1}),
    "Camera": (
        ldls.Camera,
        {
            "projection": MATRIX,
            "T_camera_lidar": np.eye(4),
            "image_size": (60, 80),
            "min_depth_m": 0.1,
            "distortion": ldls.Distortion(),
        },
    ),
    "Camera.from_opencv": (
        ldls.Camera.from_opencv,
        {"K": MATRIX, "D": [0.1, 0, 0, 0], "R": np.eye(3), "t": [0, 0, 0], "fisheye": False, "image_size": (60, 80)},
    ),
    "Camera.from_camera_info": (
        ldls.Camera.from_camera_info,
        {"message": SENSOR, "T_camera_lidar": np.eye(4), "rectified": False},
    ),
    "Camera.from_nuscenes": (
        ldls.Camera.from_nuscenes,
        {
            "calibrated_camera": POSE,
            "ego_pose_camera": POSE,
            "calibrated_lidar": POSE,
            "ego_pose_lidar": POSE,
            "image_size": None,
        },
    ),
    "Distortion": (ldls.Distortion, {"model": "plumb_bob", "coefficients": (0.1, 0, 0, 0)}),
    "Distortion.from_opencv": (ldls.Distortion.from_opencv, {"coefficients": (0.1, 0, 0, 0), "fisheye": False}),
    "InstanceMasks": (
        ldls.InstanceMasks,
        {"rles": [], "image_size": (60, 80), "categories": [], "scores": [], "names": None},
    ),
    "InstanceMasks.from_array": (
        ldls.InstanceMasks.from_array,
        {
            "masks": W.pixels,
            "categories": [1, 3],
            "scores": [1, 0.5],
            "names": {1: "a", 3: "b"},
            "image_size": (60, 80),
            "instance_axis": 0,
        },
    ),
    "InstanceMasks.from_coco": (
        ldls.InstanceMasks.from_coco,
        {"content": COCO, "image_id": 1, "image_size": (2, 2), "names": {1: "a"}},
    ),
    "InstanceMasks.from_instance_image": (
        ldls.InstanceMasks.from_instance_image,
        {"image": np.eye(4, dtype=int), "categories": None, "scores": None, "names": None, "class_divisor": None},
    ),
    "InstanceMasks.from_boxes": (
        ldls.InstanceMasks.from_boxes,
        {"boxes": [[1, 2, 3, 4]], "image_size": (9, 9), "categories": [1], "scores": [1], "names": {1: "a"}},
    ),
    "InstanceMasks.from_torchvision": (
        ldls.InstanceMasks.from_torchvision,
        {"output": TORCHVISION, "threshold": 0.5, "names": None},
    ),
    "InstanceMasks.from_supervision": (
        ldls.InstanceMasks.from_supervision,
        {
            "detections": SimpleNamespace(
                mask=W.pixels, xyxy=np.zeros((2, 4)), confidence=None, class_id=None, data={}
            ),
            "names": None,
            "image_size": (60, 80),
        },
    ),
    "InstanceMasks.from_ultralytics": (
        ldls.InstanceMasks.from_ultralytics,
        {"result": SimpleNamespace(masks=None, boxes=None, names={0: "a"}, orig_shape=(4, 4))},
    ),
    "InstanceMasks.from_sam": (
        ldls.InstanceMasks.from_sam,
        {
            "records": [{"segmentation": np.eye(4) > 0, "predicted_iou": 0.5}],
            "categories": None,
            "names": None,
            "image_size": None,
        },
    ),
    "InstanceMasks.to_coco": (W.masks.to_coco, {"image_id": 1, "file_name": "a.png"}),
    "InstanceMasks.select": (W.masks.select, {"indices": [0]}),
    "InstanceMasks.filter": (W.masks.filter, {"min_score": 0.5, "categories": [1], "min_area": 2}),
    "InstanceMasks.resolve_overlaps": (W.masks.resolve_overlaps, {"by": "score"}),
    "InstanceMasks.grow": (W.masks.grow, {"radius": 1}),
    "InstanceMasks.shrink": (W.masks.shrink, {"radius": 1}),
    "InstanceMasks[index]": (W.masks.__getitem__, {"index": 0}),
    "Segmentation.per_point": (W.result.per_point, {"values": [0, 1, 2], "out_of_view": 7}),
    "explain": (ldls.explain, {"result": W.result, "point": 0}),
    "stages.project": (
        stages.project,
        {"points": W.points, "camera": W.camera, "image_size": (60, 80), "keep_origin": False, "threads": None},
    ),
    "stages.ground": (stages.ground, {"points": W.xyz, "camera": W.camera, "local_ground": True, "threads": None}),
    "stages.on_ground": (stages.on_ground, {"heights": W.heights}),
    "stages.in_graph": (stages.in_graph, {"heights": W.heights, "ground_clearance": 0.1}),
    "stages.depth_groups": (
        stages.depth_groups,
        {
            "points": W.xyz,
            "pixels": W.uv,
            "masks": W.masks,
            "camera": W.camera,
            "heights": W.heights,
            "depth_gap": 0.5,
            "bridged_gap": 1.0,
            "edge_margin": 0.1,
            "threads": None,
        },
    ),
    "stages.DepthGroups": (
        stages.DepthGroups,
        {"intervals": W.depths.intervals, "distances": W.depths.distances, "unsure": W.depths.unsure},
    ),
    "stages.DepthGroups.of_points": (W.depths.of_points, {"rows": [0, 1]}),
    "stages.neighbors": (stages.neighbors, {"points": W.xyz, "k": 3, "threads": None}),
    "stages.point_graph": (
        stages.point_graph,
        {
            "points": W.xyz,
            "indices": W.indices,
            "heights": W.heights,
            "sigma": 1.0,
            "ground_edges": 0.1,
            "threads": None,
        },
    ),
    "stages.pixel_labels": (
        stages.pixel_labels,
        {"pixels": W.uv, "masks": W.masks, "window": 5, "depths": W.depths, "pixel_weight": 0.1, "threads": None},
    ),
    "stages.direct_labels": (stages.direct_labels, {"pixels": W.uv, "masks": W.masks}),
    "stages.normalize_rows": (stages.normalize_rows, {"graph": W.graph, "labels": W.labels}),
    "stages.normalize_rows of parts": (
        lambda **parts: stages.normalize_rows(W.graph, stages.PixelLabels(**parts)),
        {"weights": W.labels.weights, "mass": W.labels.mass},
    ),
    "stages.diffuse": (stages.diffuse, {"A": W.A, "b": W.b, "iterations": 3, "every": None, "threads": None}),
    "stages.diffuse, one by one": (
        lambda **arguments: list(stages.diffuse(**arguments)),
        {"A": W.A, "b": W.b, "iterations": 3, "every": 1, "threads": None},
    ),
    "stages.remove_outliers": (
        stages.remove_outliers,
        {"graph": W.A, "labels": W.z.argmax(axis=1), "points": W.xyz, "part_gap": 0.5},
    ),
    "stages.confidence": (stages.confidence, {"z": W.z, "labels": W.z.argmax(axis=1), "masks": W.masks}),
    "fit_upright_box": (fit_upright_box, {"points": W.points}),
    "Sweep": (
        ldls.Sweep,
        {"points": W.points, "views": [ldls.View(W.masks, W.camera)], "pose": np.eye(4), "stamp": 0.1},
    ),
    "segment_sweeps": (
        ldls.segment_sweeps,
        {
            "sweeps": [ldls.Sweep(W.points, [ldls.View(W.masks, W.camera)], np.eye(4), at) for at in (0.1, 0.2)],
            "params": ldls.Params(threads=1),
            "nonfinite": "drop",
            "keep_origin": False,
            "same_object": 0.5,
        },
    ),
    "Tracker.track": (
        lambda **arguments: ldls.Tracker().track(**arguments),
        {
            "sweeps": [ldls.Sweep(W.points, [ldls.View(W.masks, W.camera)], np.eye(4), 0.1)],
            "results": ldls.segment_sweeps([ldls.Sweep(W.points, [ldls.View(W.masks, W.camera)], np.eye(4), 0.1)]),
        },
    ),
    "Trajectory": (ldls.Trajectory, {"stamps": [0, 0.1], "poses": np.stack([np.eye(4)] * 2)}),
    "Trajectory.at": (ldls.Trajectory([0, 0.1], np.stack([np.eye(4)] * 2)).at, {"stamp": 0.05}),
    "Trajectory.motion": (ldls.Trajectory([0, 0.1], np.stack([np.eye(4)] * 2)).motion, {"start": 0.05, "end": 0.0}),
    "Trajectory.deskew": (
        ldls.Trajectory([0, 0.1], np.stack([np.eye(4)] * 2)).deskew,
        {"points": np.ones((2, 3)), "times": np.array([0.0, 0.05]), "stamp": 0.05},
    ),
    "odometry": (ldls.odometry, {"sweeps": [(0.0, W.street), (0.1, W.street)]}),
    "LabelledMap": (ldls.LabelledMap, {"voxel_m": 0.1}),
    "LabelledMap.add": (ldls.LabelledMap().add, {"sweep": W.sweep, "result": W.tracked}),
    "Labeling": (
        ldls.labeling.Labeling,
        {"classes": [0, 1], "instances": [0, 1], "ignored": [False, True], "names": NAMES},
    ),
    "Labeling.from_codes": (
        ldls.labeling.Labeling.from_codes,
        {"codes": [0, 4], "table": {0: "background", 4: "car"}, "instances": [0, 1]},
    ),
    "Labeling.from_segmentation": (ldls.labeling.Labeling.from_segmentation, {"result": W.result}),
    "Labeling.from_instance_labels": (
        ldls.labeling.Labeling.from_instance_labels,
        {"labels": [0, -1, 1], "class_names": ["car"]},
    ),
    "Labeling.restricted": (W.labeling.restricted, {"keep": np.ones(len(W.points), bool)}),
    "ClassSet": (evaluation.ClassSet, {"names": ("car",), "aliases": {"Car": "car"}, "left_out": (), "background": ()}),
    "ClassSet.kitti": (
        evaluation.ClassSet.kitti,
        {"names": ("Car",), "merge_sitting": True, "leave_out": None, "background": ()},
    ),
    "ClassSet.map": (CLASSES.map, {"labeling": W.labeling, "truth": False}),
    "Pair": (
        evaluation.Pair,
        {
            "name": "a",
            "prediction": W.labeling,
            "truth": W.labeling,
            "ranges_m": np.ones(len(W.points)),
            "confidence": np.ones(len(W.points)),
        },
    ),
    "evaluate": (
        evaluation.evaluate,
        {
            "pairs": [("a", W.labeling, W.labeling)],
            "classes": CLASSES,
            "thresholds": (0.5,),
            "max_range_m": None,
            "minimum_points": 0,
            "track": True,
        },
    ),
    "object_scores": (
        evaluation.object_scores,
        {"pair": evaluation.Pair("a", W.labeling, W.labeling, np.ones(len(W.points))), "classes": CLASSES},
    ),
    "bound_labels": (evaluation.bound_labels, {"result": W.result, "truth": W.labeling, "classes": CLASSES}),
    "annotate": (evaluation.annotate, {"objects": [], "points": W.points, "camera": W.camera, "clean": True}),
    "InstanceScores": (evaluation.InstanceScores, {"names": ("car",), "thresholds": (0.5,), "minimum_points": 0}),
    "PanopticScores": (evaluation.PanopticScores, {"names": ("car",), "minimum_points": 0}),
    "SemanticScores": (evaluation.SemanticScores, {"names": ("car",)}),
    "SemanticScores.add": (
        evaluation.SemanticScores(("person", "car")).add,
        {"prediction": W.labeling, "truth": W.labeling},
    ),
    "TrackingScores": (evaluation.TrackingScores, {"names": ("car",), "minimum_points": 0}),
    "TrackingScores.add": (
        evaluation.TrackingScores(("person", "car")).add,
        {"prediction": W.labeling, "truth": W.labeling},
    ),
    "tracking_table": (evaluation.tracking_table, {"scores": {"a": evaluation.TrackingScores(("car",))}}),
    "semantic_table": (evaluation.semantic_table, {"evaluations": {"a": evaluation.evaluate([], classes=CLASSES)}}),
    "frame_table": (evaluation.frame_table, {"evaluation": evaluation.evaluate([], classes=CLASSES)}),
}
CASES = [pytest.param(*call, name, id=f"{where} {name}") for where, call in CALLS.items() for name in call[1]]


@pytest.mark.parametrize(("call", "arguments", "name"), CASES)
def test_nonsense_in_an_argument_is_refused_as_an_error_of_ldls(call, arguments, name):
    for nonsense in NONSENSE:
        refusal = error_of(call, {**arguments, name: nonsense})
        # sequences end with an IndexError
        allowed = (ldls.LdlsError, IndexError) if call == W.masks.__getitem__ else ldls.LdlsError
        assert refusal is None or isinstance(refusal, allowed), (nonsense, refusal)
        assert refusal is None or not isinstance(refusal, ldls.InternalError), (nonsense, refusal)


@pytest.mark.parametrize("where", CALLS)
def test_what_the_table_calls_right_is_right(where):
    call, arguments = CALLS[where]
    assert error_of(call, arguments) is None


def error_of(call, arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call(**arguments)
        except Exception as error:
            return error
    return None


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        pytest.param(
            lambda: ldls.segment([[1, 2, 3], [1, 2]], W.masks, W.camera),
            ldls.ShapeError,
            r"^points: expected an array of numbers, got \[\[1, 2, 3\], \[1, 2\]\]; .*inhomogeneous",
            id="ragged points",
        ),
        pytest.param(
            lambda: ldls.Distortion(None), ldls.CalibrationError, "^model: got None, expected text", id="no model"
        ),
        pytest.param(
            lambda: ldls.Distortion("plumb_bob", [0.1, 0.2, 0.3]),
            ldls.CalibrationError,
            "^distortion: plumb_bob has 4 or 5 coefficients, got 3",
            id="three coefficients",
        ),
        pytest.param(
            lambda: ldls.Distortion([0.1, 0.2]),
            ldls.CalibrationError,
            r"^model: got \[0.1, 0.2\], expected text",
            id="coefficients for a model",
        ),
        pytest.param(
            lambda: ldls.Params(sigma="1.0"),
            ldls.ParameterError,
            "^sigma: got '1.0', expected a finite number",
            id="text",
        ),
        pytest.param(
            lambda: ldls.Params(sigma=10**400),
            ldls.ParameterError,
            "^sigma: got 1000.*, expected a finite number",
            id="large",
        ),
        pytest.param(
            lambda: ldls.Params(sigma=10**5000),
            ldls.ParameterError,
            "^sigma: got a value of type int, expected a finite number",
            id="larger than text can be",
        ),
        pytest.param(
            lambda: ldls.segment(W.points, W.masks, W.camera, params={}),
            ldls.ParameterError,
            r"^params: expected Params, got dict; make them with Params\(...\)",
            id="params as a dict",
        ),
        pytest.param(
            lambda: ldls.segment(W.points, W.masks, W.camera, same_object="x"),
            ldls.ParameterError,
            "^same_object: got 'x', expected a finite number",
            id="same_object as text",
        ),
        pytest.param(
            lambda: ldls.Camera(projection=MATRIX, image_size=5),
            ldls.CalibrationError,
            r"^image_size is 5, expected \(height, width\)",
            id="one side of a camera's image",
        ),
        pytest.param(
            lambda: ldls.InstanceMasks.from_boxes([], 5),
            ldls.MaskError,
            r"^size is 5, expected \(height, width\)",
            id="one side of an image",
        ),
        pytest.param(
            lambda: stages.project(W.points, W.camera, image_size=5),
            ldls.ParameterError,
            r"^image_size is 5, expected \(height, width\)",
            id="one side of a stage's image",
        ),
        pytest.param(
            lambda: ldls.Camera(projection=[[10**400] * 4] * 3),
            ldls.CalibrationError,
            r"^projection: expected numbers, got \[\[10+\.\.\.; give numbers alone, of 64 bits at most$",
            id="a matrix of numbers that are too large",
        ),
        pytest.param(
            lambda: stages.direct_labels([["a", "b"]], W.masks),
            ldls.DtypeError,
            r"^pixels: expected numbers, got \[\['a', 'b'\]\]; give numbers alone$",
            id="text",
        ),
        pytest.param(
            lambda: stages.point_graph(W.xyz, W.indices.astype(np.int64) - 50),
            ldls.InputError,
            "^indices: got -.*, expected 0 to 4294967295",
            id="negative indices",
        ),
        pytest.param(
            lambda: ldls.segment(W.points, np.zeros((0, 60, 80), bool)),
            ldls.InputError,
            "^masks: expected InstanceMasks or a list of View, got ndarray",
            id="pixels of no mask for views",
        ),
        pytest.param(
            lambda: stages.diffuse(np.eye(3), W.b),
            ldls.DtypeError,
            "^A: expected a sparse matrix of SciPy",
            id="dense matrix",
        ),
    ],
)
def test_wrong_types_are_refused_by_the_name_of_the_argument(call, error, message):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "wrong", "near"),
    [
        pytest.param(ldls.Params, "neighbours", "neighbors", id="Params"),
        pytest.param(ldls.segment, "parms", "params", id="segment"),
        pytest.param(ldls.LabelDiffusion, "cam", "camera", id="LabelDiffusion"),
        pytest.param(ldls.Camera, "T_lidar_camera", "T_camera_lidar", id="Camera"),
        pytest.param(ldls.InstanceMasks.from_array, "score", "scores", id="InstanceMasks.from_array"),
        pytest.param(stages.diffuse, "iteration", "iterations", id="stages.diffuse"),
        pytest.param(evaluation.evaluate, "treshold", "thresholds", id="evaluate"),
    ],
)
def test_an_unknown_keyword_names_the_nearest(call, wrong, near):
    name = re.escape(call.__qualname__)
    with pytest.raises(
        TypeError, match=rf"^{name}\(\) got an unexpected keyword argument '{wrong}'; did you mean '{near}'\?"
    ):
        call(**{wrong: 1})


READERS = {
    "read_points": (ldls.read_points, {"path": "none.bin", "columns": 4, "recover": False}),
    "read_camera": (ldls.read_camera, {"path": "none.txt", "format": None, "camera": None, "image_size": None}),
    "read_masks": (ldls.read_masks, {"path": "none.json", "image_id": None, "image_size": None, "names": None}),
    "read_poses": (ldls.read_poses, {"path": "none.txt", "format": None, "stamps": None, "T_camera_lidar": None}),
    "read_image": (ldls.read_image, {"path": "none.png"}),
    "read_result": (ldls.read_result, {"path": "none.npz"}),
    "save": (ldls.save, {"thing": W.result, "path": "none/none.npz"}),
    "save_objects": (ldls.save_objects, {"results": W.result, "path": "none/none.csv"}),
}
READER_CASES = [
    pytest.param(*READERS[which], name, id=f"{which} {name}") for which in READERS for name in READERS[which][1]
]


@pytest.mark.parametrize(("call", "arguments", "name"), READER_CASES)
def test_nonsense_in_an_argument_of_a_reader_is_refused_or_the_file_is_missing(tmp_path, call, arguments, name):
    there = {**arguments, "path": tmp_path / arguments["path"]}
    assert isinstance(error_of(call, there), FileNotFoundError)
    for nonsense in NONSENSE:
        if name != "path" or not isinstance(nonsense, str):
            refusal = error_of(call, {**there, name: nonsense})
            allowed = ldls.InputError if name == "path" else (ldls.LdlsError, FileNotFoundError)
            assert isinstance(refusal, allowed), (nonsense, refusal)


MANY = 2**31 + 5


@pytest.mark.parametrize(
    "call",
    [
        pytest.param(lambda: ldls.segment(many(3), W.masks, W.camera), id="points"),
        pytest.param(lambda: ldls.segment(many(3, np.float32), W.masks, W.camera), id="points of single precision"),
        pytest.param(lambda: stages.project(many(3), W.camera, image_size=(60, 80)), id="project"),
        pytest.param(lambda: stages.neighbors(many(3)), id="neighbors"),
        pytest.param(lambda: stages.ground(many(3), W.camera), id="ground"),
        pytest.param(lambda: stages.direct_labels(many(2), W.masks), id="pixels"),
        pytest.param(lambda: stages.pixel_labels(many(2), W.masks), id="pixels with windows"),
        pytest.param(lambda: stages.remove_outliers(W.A, many(1, np.int64)[:, 0]), id="labels"),
        pytest.param(lambda: stages.confidence(many(3, np.float32), [0], W.masks), id="likelihoods"),
        pytest.param(lambda: ldls.labeling.Labeling(many(1, np.int64)[:, 0], [0], [False], NAMES), id="classes"),
        pytest.param(lambda: ldls.InstanceMasks.from_array(np.broadcast_to(False, (MANY, 1, 1))), id="masks"),
        pytest.param(
            lambda: ldls.InstanceMasks.from_array(np.broadcast_to(False, (1, MANY, 3))), id="pixels of a mask"
        ),
        pytest.param(
            lambda: ldls.InstanceMasks.from_array(np.broadcast_to(False, (1, 60_000, 60_000))), id="a large mask"
        ),
        pytest.param(
            lambda: ldls.InstanceMasks.from_instance_image(np.broadcast_to(1, (60_000, 60_000))), id="a large image"
        ),
        pytest.param(lambda: ldls.InstanceMasks.from_boxes(many(4), (9, 9)), id="boxes"),
        pytest.param(lambda: W.masks.select(np.broadcast_to(0, MANY)), id="indices"),
    ],
)
def test_more_rows_than_can_be_numbered_are_refused_before_they_are_copied(call):
    # the arrays are views of one row: a copy would take 2 GB at the least
    with pytest.raises(ldls.LimitError):
        call()


def many(columns, dtype=np.float64):
    return np.broadcast_to(np.zeros((1, columns), dtype), (MANY, columns))

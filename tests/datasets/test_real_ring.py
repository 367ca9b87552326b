"""The real nuScenes frame as a ring of six, with masks made of its 2D boxes."""

import json

import numpy as np
import pytest

import ldls
from ldls.categories import COCO_NAMES, category_ids
from ldls.datasets import open_source, read_boxes_2d
from ldls.datasets.nuscenes_frame import points_in_upright_box

FEWEST_POINTS = 20
NAMES = ["car", "pedestrian", "truck", "bus", "bicycle", "motorcycle", "barrier", "traffic_cone",
         "construction_vehicle", "trailer", "other"]  # fmt: skip


@pytest.fixture(scope="module")
def ring(data_folder):
    folder = data_folder / "nuscenes"
    (frame,) = open_source(folder)
    boxes = read_boxes_2d(folder)
    ids, names = category_ids(dict(enumerate(NAMES)))
    views = []
    for image in frame.images:
        found = boxes[image.name]
        masks = ldls.InstanceMasks.from_boxes(
            [box.ltrb_px for box in found],
            image.camera.image_size,
            categories=[ids[NAMES.index(box.category)] for box in found],
            names=COCO_NAMES | names,
        )
        views.append(ldls.View(masks, image.camera, image.name))
    described = json.loads((folder / "frame.json").read_text())["boxes_3d"]
    inside = [points_in_upright_box(frame.points, np.array(box["center_size_yaw"])) for box in described]
    return frame.points, views, [points for points in inside if points.sum() >= FEWEST_POINTS]


def best_iou(labels, truth):
    ious = [0.0]
    for label in np.unique(labels[truth]):
        if label > 0:
            found = labels == label
            ious.append((found & truth).sum() / (found | truth).sum())
    return max(ious)


def ious_of(truths, labels):
    return [best_iou(labels, truth) for truth in truths]


def test_most_objects_are_found(ring):
    points, views, truths = ring
    paper = ldls.Params.paper()
    ious = ious_of(truths, ldls.segment(points, views, params=paper).labels)
    assert len(truths) == 7
    assert sum(iou >= 0.5 for iou in ious) == 7
    singles = [ldls.segment(points, view.masks, view.camera, params=paper).labels for view in views]
    of_singles = [max(best_iou(own, truth) for own in singles) for truth in truths]
    # a ring of its own graph is no worse than the better of its cameras, by more than a hair
    assert np.mean(ious) >= np.mean(of_singles) - 0.02
    best = ious_of(truths, ldls.segment(points, views).labels)
    assert np.mean(best) > np.mean(ious) + 0.03


def test_points_that_two_cameras_see_have_one_answer(ring):
    points, views, _ = ring
    result = ldls.segment(points, views)
    seen_by = np.zeros(len(points), int)
    for seen in result.views:
        seen_by[seen.in_view] += 1
    assert (seen_by > 1).sum() > 1000
    assert (result.labels[seen_by == 0] == -1).all()
    assert (result.labels[seen_by > 0] >= 0).all()
    merged = [instance for instance in result.instances if len(instance.sources) > 1]
    assert len(merged) >= 10
    for instance in merged:
        assert len({camera for camera, _ in instance.sources}) == len(instance.sources)
        categories = {int(views[camera].masks.categories[mask]) for camera, mask in instance.sources}
        assert categories == {instance.category}


@pytest.mark.parametrize(
    ("params", "order", "most"),
    [
        pytest.param(ldls.Params.paper(), [5, 4, 3, 2, 1, 0], 0, id="the paper's method"),
        pytest.param(ldls.Params(), [0, 5, 4, 3, 2, 1], 0, id="the same camera first"),
        pytest.param(ldls.Params(), [4, 0, 1, 2, 3, 5], 40, id="another camera first"),
    ],
)
def test_no_camera_but_the_first_has_a_place_that_matters(ring, params, order, most):
    points, views, _ = ring
    as_given = objects_of(ldls.segment(points, views, params=params))
    ordered = objects_of(ldls.segment(points, [views[at] for at in order], params=params))
    assert sum(one != other for one, other in zip(as_given, ordered, strict=True)) <= most


def objects_of(result):
    """What each point is of: the masks of its object by camera, whatever its label."""
    masks = [frozenset((result.views[view].view.name, mask) for view, mask in each) for each in result.sources]
    return [frozenset() if label < 1 else masks[label - 1] for label in result.labels.tolist()]

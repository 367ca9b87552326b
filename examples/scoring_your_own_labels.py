"""Scoring labels of your own beside ldls, by the paper's measures.

    python examples/scoring_your_own_labels.py [OUT]        needs the extras sim and eval

Your method is whatever gives each point a class and an instance; here it is direct projection followed by keeping, of
each instance, the points near its median. `ldls evaluate` does the same on files.
"""

import sys
from pathlib import Path

import numpy as np

import ldls
from ldls.evaluation import ClassSet, Labeling, evaluate, instance_table, semantic_table
from ldls.simulation import scene_frame

NEAR_M = 3.0


def my_method(result: ldls.Segmentation) -> np.ndarray:
    """(N,) labels: -1 not judged, 0 background, m instance m."""
    labels = result.direct_labels.copy()
    for instance in result.instances:
        own = np.flatnonzero(labels == instance.label)
        if len(own):
            middle = np.median(result.points[own, :2], axis=0)
            labels[own[np.linalg.norm(result.points[own, :2] - middle, axis=1) > NEAR_M]] = 0
    return labels


out = Path(sys.argv[1] if len(sys.argv) > 1 else "scores")
out.mkdir(parents=True, exist_ok=True)

mine, ours, projected = [], [], []
for seed in range(300, 304):
    frame = scene_frame(seed)  # `ldls.io.labels.read_labeling` reads the truth of KITTI, SemanticKITTI, nuScenes, ...
    (image,) = frame.images
    result = ldls.segment(frame.points, image.masks, image.camera)
    names = np.array([instance.name for instance in result.instances])
    for pairs, labels in (
        (projected, result.direct_labels),
        (mine, my_method(result)),
        (ours, result.labels),
    ):
        pairs.append((frame.name, Labeling.from_instance_labels(labels, names), frame.truth))

classes = ClassSet.kitti(("car", "person"))  # names of COCO, KITTI and other data sets are understood
methods = {"direct projection": projected, "my method": mine, "ldls": ours}
found = {name: evaluate(pairs, classes=classes) for name, pairs in methods.items()}
for name, table in (("semantic", semantic_table(found)), ("instances", instance_table(found))):
    print(table.markdown())
    (out / f"{name}.md").write_text(table.markdown())

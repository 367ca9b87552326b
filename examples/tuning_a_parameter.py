"""Tuning a parameter: mean IoU against sigma and K on frames with truth, and the choice held against other frames.

    python examples/tuning_a_parameter.py [OUT]        needs the extras sim and eval

Tune on frames like yours and judge on others; the defaults are a good start, and differences of a point or two of IoU
on a handful of frames mean nothing.
"""

import sys
from pathlib import Path

import numpy as np

import ldls
from ldls.datasets import Frame
from ldls.evaluation import ClassSet, Labeling, evaluate
from ldls.simulation import scene_frame

SIGMAS = (0.01, 0.1, 1.0, 10.0)
NEIGHBORS = (5, 10, 20)
CLASSES = ClassSet.kitti(("car", "person"))  # names of COCO, KITTI and other data sets are understood


def mean_iou(frames: list[Frame], params: ldls.Params) -> float:
    """Mean IoU of cars and persons, in percent; frames of your own come from `ldls.datasets.open_source`."""
    pairs = []
    for frame in frames:
        (image,) = frame.images
        result = ldls.segment(frame.points, image.masks, image.camera, params=params)
        pairs.append((frame.name, Labeling.from_segmentation(result), frame.truth))
    counts = evaluate(pairs, classes=CLASSES).semantic
    return 100 * float(np.mean([counts[name].iou for name in CLASSES.names]))


out = Path(sys.argv[1] if len(sys.argv) > 1 else "tuning")
out.mkdir(parents=True, exist_ok=True)
tuning = [scene_frame(seed) for seed in range(100, 103)]
held_out = [scene_frame(seed) for seed in range(200, 203)]

found = {}
rows = ["| sigma, m^2 | " + " | ".join(f"K = {k}" for k in NEIGHBORS) + " |", "| ---: |" + " ---: |" * len(NEIGHBORS)]
for sigma in SIGMAS:
    for neighbors in NEIGHBORS:
        params = ldls.Params(sigma=sigma, neighbors=neighbors)
        found[params] = mean_iou(tuning, params)
    scores = [f"{found[ldls.Params(sigma=sigma, neighbors=neighbors)]:.1f}" for neighbors in NEIGHBORS]
    rows.append(f"| {sigma:g} | {' | '.join(scores)} |")
table = "\n".join(rows)
(out / "tuning.md").write_text(table + "\n")
print("mean IoU of car and person on the tuning frames, percent\n" + table)

best, defaults = max(found, key=found.__getitem__), ldls.Params()
print(f"best there: sigma = {best.sigma:g}, K = {best.neighbors}")
scores = [mean_iou(held_out, params) for params in (best, defaults)]
print("on other frames: {:.1f} with these, {:.1f} with the defaults".format(*scores))

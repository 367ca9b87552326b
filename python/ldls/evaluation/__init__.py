"""Predictions of point labels scored against truth, as in the evaluation of the LDLS paper.

    pairs = [("000123", prediction, truth), ...]  # Labelings, from ldls.io.labels.read_labeling or arrays
    scores = evaluate(pairs, classes=ClassSet.kitti())
    print(semantic_table({"my method": scores}).markdown())

Needs the extra `eval`.
"""

from ldls.evaluation.annotation import Annotation, annotate
from ldls.evaluation.bound import bound_labels
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.counts import Counts
from ldls.evaluation.evaluation import Evaluation, FrameCounts, evaluate
from ldls.evaluation.figures import iou_against, iou_against_range, scores_against_range
from ldls.evaluation.instance import InstanceScores, ObjectScore, object_scores
from ldls.evaluation.pair import Pair
from ldls.evaluation.panoptic import PanopticQuality, PanopticScores
from ldls.evaluation.reliability import Reliability
from ldls.evaluation.semantic import SemanticScores
from ldls.evaluation.tables import (
    Table,
    ablation_table,
    frame_table,
    instance_table,
    panoptic_table,
    semantic_table,
    tracking_table,
)
from ldls.evaluation.tracking import TrackingQuality, TrackingScores
from ldls.labeling import Labeling

__all__ = [
    "Annotation",
    "ClassSet",
    "Counts",
    "Evaluation",
    "FrameCounts",
    "InstanceScores",
    "Labeling",
    "ObjectScore",
    "Pair",
    "PanopticQuality",
    "PanopticScores",
    "Reliability",
    "SemanticScores",
    "Table",
    "TrackingQuality",
    "TrackingScores",
    "ablation_table",
    "annotate",
    "bound_labels",
    "evaluate",
    "frame_table",
    "instance_table",
    "iou_against",
    "iou_against_range",
    "object_scores",
    "panoptic_table",
    "scores_against_range",
    "semantic_table",
    "tracking_table",
]

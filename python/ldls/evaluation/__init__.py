"""Predictions of point labels scored against truth, as in the evaluation of the LDLS paper.

    pairs = [("000123", prediction, truth), ...]  # Labelings, from read_labeling or arrays
    found = evaluate(pairs, classes=ClassSet.kitti())
    print(semantic_table({"my method": found}).markdown())

Needs the extra `eval`.
"""

from ldls.evaluation.annotate import Annotation, annotate
from ldls.evaluation.annotations import read_annotations, write_annotations
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.counts import Counts
from ldls.evaluation.evaluate import Evaluation, FrameCounts, evaluate
from ldls.evaluation.figures import iou_against_iterations, iou_against_range, scores_against_range
from ldls.evaluation.formats import FORMATS, Format, read_labeling
from ldls.evaluation.instance import InstanceScores
from ldls.evaluation.kitti_boxes import label_by_boxes, points_in_box, read_kitti_boxes
from ldls.evaluation.nuscenes import read_lidarseg, read_panoptic
from ldls.evaluation.object_scores import ObjectScore, object_scores
from ldls.evaluation.pair import Pair
from ldls.evaluation.panoptic import PanopticQuality, PanopticScores
from ldls.evaluation.results import read_results, write_labeling
from ldls.evaluation.semantic import SemanticScores
from ldls.evaluation.semantic_kitti import read_semantic_kitti
from ldls.evaluation.squeezeseg import read_squeezeseg, read_squeezeseg_ranges
from ldls.evaluation.tables import Table, ablation_table, frame_table, instance_table, panoptic_table, semantic_table
from ldls.io.kitti_objects import KittiObject, read_kitti_objects
from ldls.labeling import Labeling

__all__ = [
    "FORMATS",
    "Annotation",
    "ClassSet",
    "Counts",
    "Evaluation",
    "Format",
    "FrameCounts",
    "InstanceScores",
    "KittiObject",
    "Labeling",
    "ObjectScore",
    "Pair",
    "PanopticQuality",
    "PanopticScores",
    "SemanticScores",
    "Table",
    "ablation_table",
    "annotate",
    "evaluate",
    "frame_table",
    "instance_table",
    "iou_against_iterations",
    "iou_against_range",
    "label_by_boxes",
    "object_scores",
    "panoptic_table",
    "points_in_box",
    "read_annotations",
    "read_kitti_boxes",
    "read_kitti_objects",
    "read_labeling",
    "read_lidarseg",
    "read_panoptic",
    "read_results",
    "read_semantic_kitti",
    "read_squeezeseg",
    "read_squeezeseg_ranges",
    "scores_against_range",
    "semantic_table",
    "write_annotations",
    "write_labeling",
]

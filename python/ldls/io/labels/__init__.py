"""Files of labels, one module a format: a `Labeling` in and out, and label files of a `Segmentation`."""

from ldls.io.labels.annotations import write_annotations
from ldls.io.labels.kitti_objects import KittiObject, label_by_boxes, read_kitti_objects
from ldls.io.labels.label_formats import FORMATS, read_labeling
from ldls.io.labels.labeling_npz import write_labeling

__all__ = [
    "FORMATS",
    "KittiObject",
    "label_by_boxes",
    "read_kitti_objects",
    "read_labeling",
    "write_annotations",
    "write_labeling",
]

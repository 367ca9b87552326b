"""Labels of the points of a cloud, and the objects they make."""

from ldls.segmentation.objects import SegmentedObject
from ldls.segmentation.oriented_box import OrientedBox, fit_upright_box
from ldls.segmentation.segmentation import Instance, Report, Segmentation

__all__ = ["Instance", "OrientedBox", "Report", "Segmentation", "SegmentedObject", "fit_upright_box"]

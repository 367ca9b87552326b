"""Masks of what networks find."""

import numpy as np

from ldls.segmenters.classes import named_classes
from ldls.segmenters.crops import Crop, assemble


def test_instances_of_no_object_and_without_a_pixel_are_left_out():
    classes = named_classes(dict(enumerate(["__background__", "background", "cone", "car"])))
    one, none = np.ones((2, 3), bool), np.zeros((2, 3), bool)
    crops = [Crop(one, 1, 2, classes.ids[number], 0.5) for number in range(4)]
    masks = assemble([*crops, Crop(none, 1, 2, 3, 0.5)], (6, 8), classes.names)
    assert [(mask.name, mask.area, mask.bounding_box) for mask in masks] == [
        ("cone", 6, (1, 2, 2, 3)),
        ("car", 6, (1, 2, 2, 3)),
    ]

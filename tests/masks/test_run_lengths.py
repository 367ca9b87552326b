import numpy as np
import pytest
from pycocotools import mask as cocomask

import ldls

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools


def test_ten_thousand_masks_have_the_strings_of_the_coco_tools():
    generator = np.random.default_rng(11)
    for _ in range(200):
        height, width = (int(side) for side in generator.integers(1, generator.choice([3, 20, 130]), 2))
        density = generator.choice([0, 0.02, 0.5, 0.98, 1], (50, 1, 1))
        pixels = generator.random((50, height, width)) < density
        blocks = generator.random((50, 1, 1)) < 0.5  # long runs beside short ones
        pixels = np.where(blocks, np.repeat(np.repeat(pixels, 9, 1), 9, 2)[:, :height, :width], pixels)
        expected = cocomask.encode(np.asfortranarray(np.moveaxis(pixels, 0, 2).astype(np.uint8)))
        written = ldls.InstanceMasks.from_array(pixels).to_coco()["annotations"]
        assert [a["segmentation"]["counts"].encode() for a in written] == [rle["counts"] for rle in expected]
        results = [{"category_id": 1, "segmentation": rle} for rle in expected]
        np.testing.assert_array_equal(ldls.InstanceMasks.from_coco(results).to_array(), pixels)

"""Masks at random, and what makes files of them by hand."""

import struct
import zlib

import numpy as np

import ldls
from ldls.categories import COCO_NAMES

NAMES = {3: "car", 101: "Kran", 102: "叉车", 64: "potted plant", 9: 'unused, "quoted"\n'}


def random_masks(seed, count=5, names=NAMES):
    """`count` masks that overlap, the last without a pixel."""
    generator = np.random.default_rng(seed)
    height, width = (int(side) for side in generator.integers([1, count + 1], 30))
    pixels = generator.random((count, height, width)) > generator.random((count, 1, 1))
    pixels[-1:] = False
    categories = generator.choice(list(names), count)
    return ldls.InstanceMasks.from_array(
        pixels,
        categories=categories,
        scores=generator.random(count, np.float32),
        names=names,
        image_size=(height, width),
    )


def of_coco(masks):
    """The same pixels and scores with COCO's names."""
    categories = np.array(list(COCO_NAMES))[masks.categories % len(COCO_NAMES)]
    return ldls.InstanceMasks.from_array(
        masks.to_array(), categories=categories, scores=masks.scores, image_size=masks.image_size
    )


def plain(masks):
    """The same pixels, every mask an object of score 1."""
    return ldls.InstanceMasks.from_array(masks.to_array())


def png(width, height, *, bits=8, color=0, image_data=b"", chunks=(), interlace=0):
    """The bytes of a PNG file from those of its chunks."""
    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, interlace)
    parts = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(image_data)), (b"IEND", b"")]
    body = (
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(body)

"""Image and CompressedImage messages to RGB pixels."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, UnsupportedFormatError, within
from ldls.io.images import decode
from ldls.io.ros.messages import Message

Pixels = NDArray[np.uint8]

CHANNELS: dict[str, tuple[int, ...]] = {
    "rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2, 3), "bgra8": (2, 1, 0, 3), "mono8": (0, 0, 0),
    "8UC1": (0, 0, 0), "8UC3": (2, 1, 0), "8UC4": (2, 1, 0, 3), "rgb16": (0, 1, 2), "bgr16": (2, 1, 0),
    "mono16": (0, 0, 0),
}  # fmt: skip
"""Channels of red, green and blue (and alpha) in each encoding; 8UC1 to 8UC4 are OpenCV's, in its order."""
LUMA = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
"""Which of the two samples of a pixel is its brightness; the others are colours of two pixels side by side."""
BAYER = {"bayer_rggb": "RGGB", "bayer_bggr": "BGGR", "bayer_gbrg": "GBRG", "bayer_grbg": "GRBG"}
"""Colours of the upper left four pixels, by rows."""


def decode_image(message: Message) -> Pixels:
    """(H, W, 3) uint8 RGB pixels; of 16 bits the upper 8, of a Bayer pattern the bilinear colours, of YUV OpenCV's.

    Raises:
        UnsupportedFormatError: The encoding is none of colours or grey.
        CorruptFileError: The data are fewer than height, width and step say.
    """
    encoding = message.encoding
    if encoding in CHANNELS:
        channels = CHANNELS[encoding]
        samples = _samples(message, max(channels) + 1, 2 if encoding.endswith("16") else 1)
        return np.ascontiguousarray(samples[..., channels[:3]])
    if encoding in LUMA:
        return _from_yuv(_samples(message, 2, 1), LUMA[encoding])
    mosaic, depth = encoding[:10], encoding[10:]
    if mosaic in BAYER and depth in ("8", "16"):
        return demosaic(_samples(message, 1, int(depth) // 8)[..., 0], BAYER[mosaic])
    known = ", ".join([*CHANNELS, *LUMA, *(f"{pattern}8" for pattern in BAYER)])
    raise UnsupportedFormatError(f"image: encoding {encoding!r} is not read, expected one of {known}")


def _samples(message: Message, channels: int, sample_bytes: int) -> Pixels:
    """(H, W, channels) samples of 8 bits; rows are `step` bytes apart."""
    height, width, step = message.height, message.width, message.step
    row_bytes = width * channels * sample_bytes
    content = np.ascontiguousarray(message.data).view(np.uint8)
    needed = (height - 1) * step + row_bytes if height and width else 0
    if not height or not width or step < row_bytes or len(content) < needed:
        raise CorruptFileError(
            f"image: {len(content)} bytes in rows of {step}, expected {height} rows of {row_bytes} bytes for "
            f"{height} x {width} pixels of {message.encoding}"
        )
    rows: Pixels = np.ndarray((height, row_bytes), np.uint8, content, strides=(step, 1))
    if sample_bytes == 2:
        # the upper byte comes first in big-endian numbers, last in little-endian ones
        rows = rows[:, 0 if message.is_bigendian else 1 :: 2]
    return rows.reshape(height, width, channels)


def _from_yuv(samples: Pixels, luma: int) -> Pixels:
    """(H, W, 3) RGB from (H, W, 2) samples of 4:2:2, whose brightness goes from 16 to 235 (BT.601).

    Raises:
        CorruptFileError: Pixels are no pairs.
    """
    width = samples.shape[1]
    if width % 2:
        raise CorruptFileError(f"image: {width} pixels a row, expected an even number, for two share their colours")
    bright = 1.164 * np.maximum(samples[..., luma].astype(np.float32) - 16, 0)
    u, v = (np.repeat(samples[:, start::2, 1 - luma].astype(np.float32) - 128, 2, axis=1) for start in (0, 1))
    rgb = np.stack([bright + 1.596 * v, bright - 0.813 * v - 0.391 * u, bright + 2.018 * u], axis=-1)
    return np.round(rgb).clip(0, 255).astype(np.uint8)


def demosaic(mosaic: Pixels, pattern: str) -> Pixels:
    """(H, W, 3) RGB from (H, W) samples of a Bayer pattern such as "RGGB": missing colours are means of neighbours."""
    rgb = np.empty((*mosaic.shape, 3), np.uint8)
    for channel, colour in enumerate("RGB"):
        measured = np.zeros(mosaic.shape, bool)
        for place in range(4):
            if pattern[place] == colour:
                measured[place // 2 :: 2, place % 2 :: 2] = True
        weight = _spread(measured.astype(np.float32))
        mean = _spread(np.where(measured, mosaic, 0).astype(np.float32)) / np.maximum(weight, 1e-9)
        rgb[..., channel] = np.where(measured, mosaic, np.round(mean))
    return rgb


def _spread(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums over 3 x 3 pixels with weights 1 2 1 along rows and columns."""
    padded = np.pad(values, 1)
    across = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    summed: NDArray[np.float32] = across[:-2] + 2 * across[1:-1] + across[2:]
    return summed


def decode_compressed(message: Message) -> Pixels:
    """(H, W, 3) uint8 RGB pixels of a JPEG or PNG.

    Raises:
        UnsupportedFormatError: It is neither, as a compressed depth image.
        CorruptFileError: It is not whole.
        LimitError: It has more pixels than Pillow opens.
    """
    if "compressedDepth" in message.format:
        raise UnsupportedFormatError(f"image: {message.format!r} holds depths, expected colours or grey")
    content = bytes(message.data)
    with within(f"image: {message.format[:40]!r}"):
        return decode(io.BytesIO(content), len(content))

"""Labels small frames in one process, some of them broken, and tells by how much memory grows: `make soak`."""

import argparse
import gc
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import ldls
from memory import resident_bytes

WARM_UP = 500
"""Frames after which memory is measured: allocators and pools have what they need by then."""
A_SAMPLE = 100
"""Frames from one measurement to the next."""
MOST_BYTES_A_FRAME = 1024
MATRIX = [[60, 0, 40], [0, 60, 30], [0, 0, 1]]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    options = parser.parse_args()
    samples, refused = soak(options.frames)
    bytes_a_frame, total = growth(samples), samples[-1][1] - samples[0][1]
    print(
        f"{options.frames} frames, {refused} of them refused: memory grows by {bytes_a_frame:.0f} bytes a frame after "
        f"the first {WARM_UP} ({total / 1024:.0f} KB in all), {samples[-1][1] / 2**20:.0f} MB at the end"
    )
    sys.exit(not bytes_a_frame < MOST_BYTES_A_FRAME)


def soak(frames, warm_up=WARM_UP):
    """Frames done and bytes of memory at each measurement after the first frames, and how many frames were refused."""
    generator, samples, refused = np.random.default_rng(0), [], 0
    for number in range(frames + 1):
        if number >= warm_up and (number - warm_up) % A_SAMPLE == 0:
            gc.collect()
            samples.append((number, resident_bytes()))
        refused += not label(number, generator)
    return samples, refused


def label(number, generator):
    """Label frame `number`, of one to three cameras; false if it is one of those that are refused."""
    count, n_masks = generator.integers(0, 3000), int(generator.integers(0, 6))
    points = generator.uniform([-4, -3, 2], [4, 3, 12], (count, 3)).astype(np.float32 if number % 2 else np.float64)
    corners = np.sort(generator.uniform(0, 60, (n_masks, 2, 2)), axis=1)
    masks = ldls.InstanceMasks.from_boxes(
        corners.reshape(-1, 4), (60, 80), categories=generator.integers(1, 4, n_masks)
    )
    camera = ldls.Camera(projection=MATRIX)
    views = [ldls.View(masks, camera)] * int(generator.integers(1, 4))
    try:
        if number % 10 == 3:
            break_something(number // 10, points, masks)
        params = ldls.Params(iterations=None if number % 7 == 0 else 20)
        result = ldls.segment(points, views, params=params)
        _ = result.direct_labels, result.objects
    except ldls.LdlsError:
        return False
    return True


def break_something(number, points, masks):
    """One of several mistakes, each of which is refused."""
    mistakes = (
        lambda: ldls.segment(points[:, :2], masks, ldls.Camera(projection=MATRIX)),
        lambda: ldls.segment(np.full((9, 3), 1e30), masks, ldls.Camera(projection=MATRIX)),
        lambda: ldls.Camera(projection=np.zeros((3, 3))),
        lambda: ldls.InstanceMasks.from_array(np.full((1, 4, 4), 7)),
        lambda: ldls.InstanceMasks.from_coco(
            [{"category_id": 1, "segmentation": {"size": [9, 9], "counts": "1" * 60}}]
        ),
        lambda: ldls.Params(sigma=-1.0),
        lambda: ldls.segment(points, masks.to_array(), None),
        lambda: ldls._ldls.panic_in_worker(),
    )
    mistakes[number % len(mistakes)]()


def growth(samples):
    """Bytes a frame, by the line that fits the measurements best."""
    frames, sizes = np.array(samples, float).T
    return float(np.polyfit(frames, sizes, 1)[0])


if __name__ == "__main__":
    main()

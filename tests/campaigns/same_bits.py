"""Labels simulated scenes with every number of threads, again and again, and compares every bit: `make same-bits`."""

import argparse
import hashlib
import sys
import warnings
from dataclasses import replace

import ldls
from ldls.simulation import make_rig, scene_frame

THREADS = (1, 2, 3, 4, 8, 16)
KINDS = ("street", "campus")
RIGS = (("hdl-64e", "kitti"), ("vlp-16", "kitti"), ("hdl-32e", "ring"), ("os1-128", "ring"), ("hdl-64e", "ring"))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=50)
    parser.add_argument("--runs", type=int, default=20)
    options = parser.parse_args()
    n_same = n_labellings = 0
    for seed in range(options.scenes):
        found = digests(*scene(seed), threads=THREADS, runs=options.runs)
        n_same += len(set(found)) == 1
        n_labellings += len(found)
        print(f"\r{seed + 1} scenes", end="", file=sys.stderr, flush=True)
    print(
        f"\n{n_same} of {options.scenes} scenes have the same bits over {', '.join(map(str, THREADS))} threads and "
        f"{options.runs} runs: {n_labellings} labellings"
    )
    sys.exit(n_same != options.scenes)


def scene(seed):
    """Points, views and parameters of a scene: single cameras and rings, by the paper's parameters and by ours."""
    lidar, camera = RIGS[seed % len(RIGS)]
    frame = scene_frame(seed, kind=KINDS[seed % 2], rig=make_rig(lidar=lidar, camera=camera))
    # until nothing changes takes seconds with more beams
    iterations = None if lidar == "vlp-16" else 50
    params = (ldls.Params(), ldls.Params.paper(), ldls.Params(iterations=iterations))[seed % 3]
    return frame.points, [ldls.View(image.masks, image.camera) for image in frame.images], params


def digests(points, views, params, *, threads, runs):
    """A digest of labels, diffused labels and confidence of each run."""
    return [digest(points, views, replace(params, threads=each)) for each in threads for _ in range(runs)]


def digest(points, views, params):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = ldls.segment(points, views, params=params)
    parts = (result.labels, result.diffused_labels, result.confidence, result.in_view)
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


if __name__ == "__main__":
    main()

"""A drive: frame after frame as a stream, then all of it as a batch that can be interrupted.

python examples/drive.py [OUT]        needs the extra sim, for the drive
"""

import sys
import time
from pathlib import Path

import ldls
from ldls import batch
from ldls.datasets import open_source
from ldls.simulation import Drive, drive_folder, write_drive

N_FRAMES = 5
out = Path(sys.argv[1] if len(sys.argv) > 1 else "drive")

drive = Drive(n_frames=N_FRAMES, seed=4)
for _ in write_drive(out / "raw", drive):
    print(".", end="", flush=True)
source = open_source(drive_folder(out / "raw", drive))
masks_folder = source.path / "masks_02"
print(f"\n{source.kind}: {len(source)} frames, cameras {', '.join(source.camera_names)}")

# As on a robot: frame after frame, each with the camera of its moment.
stream = ldls.LabelDiffusion()
for frame in source:
    (image,) = frame.images
    masks = ldls.read_masks(masks_folder / f"{frame.name}.json")
    start = time.perf_counter()
    result = stream.segment(frame.points, [ldls.View(masks, image.camera, image.name)])
    took_ms = 1e3 * (time.perf_counter() - start)
    nearest = min((found.distance_m for found in result.objects if found.distance_m), default=float("nan"))
    n_found = sum(found.n_points > 0 for found in result.objects)
    print(f"{frame.stamp % 60:6.2f} s  {took_ms:5.1f} ms  {n_found:2} objects, the nearest at {nearest:.1f} m")

# As for a data set: all cores, a journal, files that are whole or not there. The second run finds nothing left to do.
settings = batch.RunSettings(masks=str(masks_folder), formats=("npz", "label"))
for _ in range(2):
    summary = batch.run(source, out / "labels", settings)
    print(f"{summary.n_done} frames done, {summary.n_earlier} of them by earlier runs")
print("objects:", ", ".join(f"{count} x {name}" for name, count in summary.objects.items()))
print(f"now try: ldls view {out / 'labels' / source.names[0]}.npz")

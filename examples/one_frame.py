"""One frame: points, masks and a camera become labels, objects, files and pictures.

    python examples/one_frame.py [OUT]

The frame is a simulated one that comes with ldls; with files of your own it begins with

    points = ldls.read_points("velodyne/000571.bin")
    masks = ldls.read_masks("masks/000571.json")
    camera = ldls.read_camera("calib/000571.txt")
    image = ldls.read_image("image_2/000571.png")
"""

import sys
from pathlib import Path

import ldls
from ldls.simulation import sample_frame
from ldls.viewing import save_pictures

out = Path(sys.argv[1] if len(sys.argv) > 1 else "one-frame")
out.mkdir(parents=True, exist_ok=True)

frame = sample_frame()
points, (front,) = frame.points, frame.images  # (N, 4) float32 in metres
masks, camera, image = front.masks, front.camera, front.read()  # the image is (H, W, 3) uint8

result = ldls.segment(points, masks, camera)

print(result)
for found in sorted(result.objects, key=lambda each: each.distance_m or float("inf")):
    if found.box is not None:
        length, width, height = found.box.size
        print(
            f"{found.name:>13} {found.label:<3} {found.n_points:5} points at {found.distance_m:5.1f} m, "
            f"{length:.1f} x {width:.1f} x {height:.1f} m"
        )

nearest = min((each for each in result.objects if each.box is not None), key=lambda each: each.distance_m)
cloud = points[result.labels == nearest.label, :3]  # the points of one object
print(f"the nearest is {nearest.name} {nearest.label}: x from {cloud[:, 0].min():.2f} to {cloud[:, 0].max():.2f} m")

ldls.save(result, out / "frame.npz")  # everything, for ldls.read_result, `ldls view` and `ldls explain`
ldls.save(result, out / "frame.label")  # SemanticKITTI; docs/formats.md has the others
for path in save_pictures(out / "frame.png", result, image):
    print("wrote", path)

"""A camera and a lidar of your own: from calibration sheets to a folder that every command reads.

    python examples/own_camera_and_lidar.py [OUT]        needs the extra sim, for the frames

A robot with a 16-beam lidar and a small camera stands in for yours. What you need is the intrinsic matrix K, the pose
of the camera on the vehicle, and files; the folder's ldls.toml says where they lie.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import ldls
from ldls.datasets import open_source
from ldls.simulation import make_rig, scene_frame
from ldls.viewing import save_picture, save_pictures
from ldls.viewing.depth import depth_picture

out = Path(sys.argv[1] if len(sys.argv) > 1 else "own-rig")

# The frames that your robot took: points, image, masks. Replace this by your own files.
rig = make_rig(lidar="vlp-16", camera="robot")
frames = [scene_frame(seed, kind="campus", rig=rig) for seed in (5, 6)]
for number, frame in enumerate(frames):
    for folder in ("lidar", "front", "masks"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    frame.points.tofile(out / "lidar" / f"{number:04}.bin")  # x y z intensity, float32, metres
    Image.fromarray(frame.images[0].read()).save(out / "front" / f"{number:04}.png")
    ldls.save(frame.images[0].masks, out / "masks" / f"{number:04}.json")

# The calibration. T_camera_lidar takes lidar coordinates to camera coordinates (x right, y down, z forward). Most
# sheets say the opposite, where the camera sits in the lidar's frame: turn that around, do not copy it.
true = rig.cameras[0]
position = np.linalg.inv(true.T_camera_lidar())[:3, 3]  # of the camera, in the lidar's frame, in metres
print("the camera sits at x y z =", np.round(position, 3), "m of the lidar")
axes = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # right is -y, down is -z, forward is x: it looks straight ahead
T_camera_lidar = np.eye(4)
T_camera_lidar[:3, :3] = axes
T_camera_lidar[:3, 3] = -axes @ position
K = true.model.projection()[:3, :3]

(out / "ldls.toml").write_text(f"""\
points = "lidar/{{frame}}.bin"
columns = 4

[cameras.front]
images = "front/{{frame}}.png"
masks = "masks/{{frame}}.json"
K = {K.tolist()}
T_camera_lidar = {T_camera_lidar.tolist()}
""")

# Look before you label: points coloured by depth must lie on their things. `ldls info OUT --picture` does the same.
source = open_source(out)
save_picture(out / "check.png", depth_picture(source[0]))
print("wrote", out / "check.png")

# A camera that looks a degree aside is seen in that picture, and costs points:
for turn_deg in (0.0, 1.0, 2.0):
    turn = np.radians(turn_deg)
    aside = np.eye(4)
    aside[:3:2, :3:2] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    camera = ldls.Camera(projection=K, T_camera_lidar=aside @ T_camera_lidar)
    labels = ldls.segment(frames[0].points, frames[0].images[0].masks, camera).labels
    right = ((labels > 0) == (frames[0].truth.instances > 0))[labels >= 0]
    print(f"turned by {turn_deg:.0f} degrees: {100 * right.mean():.1f} % of the points in view are right")

# From here on, everything works: ldls info, ldls run, ldls view, and Python.
for frame in source:
    (image,) = frame.images
    result = ldls.segment(frame.points, image.masks, image.camera)
    print(frame.name, result)
    save_pictures(out / f"seen-{frame.name}.png", result, image.read())
print("now try: ldls info", out)

"""Small sources of frames in the layouts of data sets: three frames of a cloud that a camera half sees."""

import json

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

SIZE = (60, 80)
K = np.array([[50.0, 0, 40], [0, 50.0, 30], [0, 0, 1]])
T = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""Lidar to camera: x ahead becomes z forward."""
P = np.hstack([K, np.zeros((3, 1))])
START_US = 1_500_000_000_000_000
CHANNELS = ("CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_RIGHT", "CAM_BACK", "CAM_BACK_LEFT", "CAM_FRONT_LEFT")
NUSCENES_CHANNELS = ("LIDAR_TOP", *CHANNELS, "RADAR_FRONT")


def cloud(columns=4):
    """Points ahead and behind, half of them in view."""
    ahead = np.random.default_rng(3).uniform([8, -2, -2], [12, 2, 2], (50, 3))
    points = np.zeros((100, columns), "<f4")
    points[:, :3] = np.vstack([ahead, ahead * [-1, 1, 1]])
    points[:, 3] = 0.5
    return points


def write_points(path, points=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((cloud() if points is None else points).tobytes())


def write_image(path, size=SIZE):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size[::-1], (10, 90, 200)).save(path)


def write_text(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def row(matrix):
    return " ".join(f"{value:.9e}" for value in np.ravel(matrix))


def ascii_body(rows):
    """These rows as the text of a file, with all digits."""
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist()).encode()


def kitti_object(folder, frames=("000000", "000001", "000002")):
    for name in frames:
        write_points(folder / f"velodyne/{name}.bin")
        write_image(folder / f"image_2/{name}.png")
        rows = {"P2": P, "R0_rect": np.eye(3), "Tr_velo_to_cam": T[:3]}
        write_text(folder / f"calib/{name}.txt", "".join(f"{key}: {row(m)}\n" for key, m in rows.items()))
    return folder


def kitti_raw(folder, n_frames=3):
    day = folder / "2011_09_26"
    drive = day / "2011_09_26_drive_0001_sync"
    cameras = f"calib_time: 09-Jan-2012 13:57:47\nS_rect_02: 80 60\nR_rect_00: {row(np.eye(3))}\nP_rect_02: {row(P)}\n"
    write_text(day / "calib_cam_to_cam.txt", cameras)
    write_text(day / "calib_velo_to_cam.txt", f"R: {row(T[:3, :3])}\nT: {row(T[:3, 3])}\ndelta_f: 0 0\n")
    for k in range(n_frames):
        write_points(drive / f"velodyne_points/data/{k:010d}.bin")
        write_image(drive / f"image_02/data/{k:010d}.png")
    for sensor, nanoseconds in (("velodyne_points", 951199337), ("image_02", 941199337)):
        lines = [f"2011-09-26 13:02:{25 + k}.{nanoseconds:09d}\n" for k in range(n_frames)]
        write_text(drive / sensor / "timestamps.txt", "".join(lines))
    return drive


def turns(drive, n_frames=3, before_s=0.04, after_s=0.06):
    """When the sweeps of a drive of `kitti_raw` begin and end."""
    for name, later_s in (("start", -before_s), ("end", after_s)):
        lines = [f"2011-09-26 13:02:{25.951199337 + later_s + k:012.9f}\n" for k in range(n_frames)]
        write_text(drive / f"velodyne_points/timestamps_{name}.txt", "".join(lines))
    return drive


def oxts(drive, way, T_lidar_imu, clock):
    """Poses of the lidar as those of an IMU near Karlsruhe, by a sphere of the earth; returns their folder."""
    for number, pose in enumerate(way @ T_lidar_imu):
        roll, pitch, yaw = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
        # over some metres a sphere is as good as a projection
        east, north, up = pose[:3, 3]
        latitude = 49 + np.degrees(north / 6378137)
        longitude = 8.4 + np.degrees(east / 6378137 / np.cos(np.radians(49)))
        numbers = [latitude, longitude, 100 + up, roll, pitch, yaw, *[0] * 19, 4, 11, 4, 4, 0]
        line = " ".join(f"{x:.14g}" for x in numbers)
        write_text(drive / f"oxts/data/{number:010d}.txt", f"{line}\n")
    write_text(drive / "oxts/timestamps.txt", "".join(clock))
    rotation, translation = row(T_lidar_imu[:3, :3]), row(T_lidar_imu[:3, 3])
    calibration = f"calib_time: 25-May-2012 16:47:16\nR: {rotation}\nT: {translation}\n"
    write_text(drive.parent / "calib_imu_to_velo.txt", calibration)
    return drive / "oxts"


def kitti_odometry(folder, n_frames=3):
    sequence = folder / "sequences/08"
    write_text(sequence / "calib.txt", f"P2: {row(P)}\nTr: {row(T[:3])}\n")
    write_text(sequence / "times.txt", "".join(f"{0.1 * k:e}\n" for k in range(n_frames)))
    for k in range(n_frames):
        write_points(sequence / f"velodyne/{k:06d}.bin")
        write_image(sequence / f"image_2/{k:06d}.png")
        labels = np.full(100, 10 | (7 << 16), "<u4")
        labels[50:] = 0
        write_points(sequence / f"labels/{k:06d}.label", labels)
    return sequence


MODALITIES = {"LIDAR": "lidar", "CAM": "camera", "RADAR": "radar"}


def nuscenes(folder, scenes=("scene-0001",), n_frames=2, version="v1.0-mini", channels=NUSCENES_CHANNELS):
    """Each scene drives along global x at 10 m/s; images are 20 ms earlier than their sweep."""
    made = {name: [] for name in ("scene", "sample", "sample_data", "calibrated_sensor", "ego_pose", "sensor")}
    made["lidarseg"], made["category"] = [], []
    for channel in channels:
        is_camera = channel.startswith("CAM")
        # w x y z of the turn from a camera's axes (right, down, forward) to the car's
        turn = [0.5, -0.5, 0.5, -0.5] if is_camera else [1.0, 0, 0, 0]
        made["sensor"].append(
            {
                "token": f"sensor {channel}",
                "channel": channel,
                "modality": MODALITIES[channel.partition("_")[0]],
            }
        )
        made["calibrated_sensor"].append(
            {
                "token": f"calibrated {channel}",
                "sensor_token": f"sensor {channel}",
                "translation": [0.0, 0.0, 1.8],
                "rotation": turn,
                "camera_intrinsic": K.tolist() if is_camera else [],
            }
        )
    for at, scene in enumerate(scenes):
        made["scene"].append({"token": f"token {scene}", "name": scene, "nbr_samples": n_frames})
        for number in range(n_frames):
            _sample(folder, made, scene, number, START_US + at * 60_000_000 + number * 500_000, channels)
    for name, rows in made.items():
        write_text(folder / version / f"{name}.json", json.dumps(rows, indent=0))
    return folder


def _sample(folder, made, scene, number, stamp_us, channels):
    token = f"{scene} {number}"
    made["sample"].append({"token": token, "scene_token": f"token {scene}", "timestamp": stamp_us})
    for channel in channels:
        is_camera = channel.startswith("CAM")
        own_us = stamp_us - 20_000 if is_camera else stamp_us
        name = f"samples/{channel}/{scene}__{number}.{'jpg' if is_camera else 'pcd.bin'}"
        pose = f"pose {token} {channel}"
        made["ego_pose"].append(
            {"token": pose, "translation": [10 * (own_us - START_US) / 1e6, 0, 0], "rotation": [1, 0, 0, 0]}
        )
        taken = {
            "token": f"{token} {channel}",
            "sample_token": token,
            "ego_pose_token": pose,
            "calibrated_sensor_token": f"calibrated {channel}",
            "filename": name,
            "timestamp": own_us,
            "is_key_frame": True,
            "height": SIZE[0] if is_camera else 0,
            "width": SIZE[1] if is_camera else 0,
        }
        between = taken | {"token": f"between {token} {channel}", "is_key_frame": False, "filename": "sweeps/none"}
        made["sample_data"] += [taken, between]
        if is_camera:
            write_image(folder / name)
        elif channel.startswith("LIDAR"):
            points = cloud(5)
            points[:, 4] = np.arange(100) % 32
            write_points(folder / name, points)
    labels = f"lidarseg/v1.0-mini/{scene}_{number}_lidarseg.bin"
    write_points(folder / labels, np.full(100, 17, np.uint8))
    made["lidarseg"].append({"sample_data_token": f"{token} LIDAR_TOP", "filename": labels})


FOLDER_TOML = f"""
points = "lidar/{{frame}}.bin"
stamps = "stamps.txt"

[cameras.front]
images = "front/{{frame}}.png"
masks = "masks/{{frame}}.npz"
K = {K.tolist()}
T_camera_lidar = {T.tolist()}
distortion = {{ model = "plumb_bob", coefficients = [-0.1, 0.0, 0.0, 0.0, 0.0] }}
"""


def plain_folder(folder, description=FOLDER_TOML, frames=("a", "b")):
    write_text(folder / "ldls.toml", description)
    write_text(folder / "stamps.txt", "".join(f"{name} {k / 10}\n" for k, name in enumerate(frames)))
    for name in frames:
        write_points(folder / f"lidar/{name}.bin")
        write_image(folder / f"front/{name}.png")
    return folder


def many_frames(folder, n_frames=300, cameras=(2,)):
    """KITTI's object layout with a cloud of its own for each frame, masks for each camera, and boxes."""
    generator = np.random.default_rng(5)
    rows = {f"P{camera}": P for camera in cameras} | {"R0_rect": np.eye(3), "Tr_velo_to_cam": T[:3]}
    calib = "".join(f"{key}: {row(m)}\n" for key, m in rows.items())
    for number in range(n_frames):
        name = f"{number:06d}"
        points = np.ones((200, 4), "<f4")
        points[:, :3] = generator.uniform([8, -4, -2], [14, 4, 2], (200, 3))
        write_points(folder / f"velodyne/{name}.bin", points)
        write_text(folder / f"calib/{name}.txt", calib)
        left = int(generator.integers(10, 40))
        box = f"{left}.00 20.00 {left + 20}.00 40.00"
        write_text(folder / f"label_2/{name}.txt", f"Car 0.00 0 -1.5 {box} 1.5 1.6 3.9 1.0 1.7 20.0 -1.6\n")
        for camera in cameras:
            write_image(folder / f"image_{camera}/{name}.png")
            place = f"image_{camera}/{name}" if len(cameras) > 1 else name
            write_text(folder / f"masks/{place}.json", json.dumps(coco(left + camera)))
    return folder


def coco(left):
    """Two objects as polygons."""
    segments = [[x, 20, x + 20, 20, x + 20, 40, x, 40] for x in (left, left + 22)]
    annotations = [
        {"id": k, "image_id": 1, "category_id": category, "segmentation": [segment], "score": 0.9, "iscrowd": 0}
        for k, (category, segment) in enumerate(zip((1, 3), segments, strict=True), start=1)
    ]
    return {
        "images": [{"id": 1, "height": SIZE[0], "width": SIZE[1], "file_name": "image.png"}],
        "categories": [{"id": 1, "name": "person"}, {"id": 3, "name": "car"}],
        "annotations": annotations,
    }

"""Camera chains of Kalibr.

Source: https://github.com/ethz-asl/kalibr/wiki/yaml-formats.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.fields import Fields
from ldls.camera.rigid import inverse, rigid
from ldls.errors import CalibrationError, within

LIDAR = ("T_cam_lidar", "T_camera_lidar"), ("T_lidar_cam", "T_lidar_camera")
IMU = ("T_cam_imu",), ("T_imu_cam",)
"""Keys of the transform to the camera, and of the one back."""
PREVIOUS = "T_cn_cnm1"


def camera_of(
    chain: Fields,
    *,
    camera: str | int = "cam0",
    T_camera_lidar: NDArray[np.float64] | None = None,
    T_imu_lidar: NDArray[np.float64] | None = None,
) -> Camera:
    """Camera of the raw image; a pinhole with radtan, equidistant or no distortion.

    Args:
        chain: The file's entries.
        camera: Key of the camera, or its number.
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates; without it the file must have
            T_cam_lidar at this camera or at one before it in the chain (T_cn_cnm1).
        T_imu_lidar: (4, 4) rigid transform from lidar to IMU coordinates, to go by the file's T_cam_imu or T_imu_cam
            instead.

    Raises:
        CalibrationError: A key is missing, the camera is no pinhole, or nothing leads to the lidar.
    """
    camera = camera if isinstance(camera, str) else f"cam{camera}"
    fields = chain.section(camera)
    model = fields.get("camera_model")
    if model != "pinhole":
        raise CalibrationError(f"{fields.place}: camera_model is {model!r}, expected 'pinhole'; calibrate with that")
    fx, fy, cx, cy = fields.matrix((4,), "intrinsics")
    distortion_model = str(fields.get("distortion_model"))
    coefficients = np.zeros(0) if distortion_model == "none" else fields.numbers("distortion_coeffs")
    width, height = (_side(fields, side) for side in fields.matrix((2,), "resolution"))
    if T_camera_lidar is None:
        T_camera_lidar = _from_lidar(chain, camera, T_imu_lidar)
    distortion = fields.distortion(distortion_model, coefficients)
    with within(fields.place):
        return Camera(
            projection=np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
            T_camera_lidar=T_camera_lidar,
            distortion=distortion,
            image_size=(height, width),
        )


def _side(fields: Fields, pixels: float) -> int:
    if not (pixels >= 1 and pixels == int(pixels)):
        raise CalibrationError(f"{fields.place}: resolution: expected whole numbers of pixels, got {pixels}")
    return int(pixels)


def _from_lidar(chain: Fields, camera: str, T_imu_lidar: NDArray[np.float64] | None) -> NDArray[np.float64]:
    direct = _extrinsic(chain, camera, LIDAR)
    if direct is not None:
        return direct
    by_imu = None if T_imu_lidar is None else _extrinsic(chain, camera, IMU)
    if by_imu is None or T_imu_lidar is None:
        raise CalibrationError(
            f"{chain.place}: {camera}: no {LIDAR[0][0]}, or {IMU[0][0]} or {IMU[1][0]} together with T_imu_lidar=, on "
            "the way to the lidar; pass T_camera_lidar="
        )
    return by_imu @ rigid("T_imu_lidar", T_imu_lidar)


def _extrinsic(chain: Fields, camera: str, keys: tuple[tuple[str, ...], tuple[str, ...]]) -> NDArray[np.float64] | None:
    """Transform to `camera` of what `keys` name, there or back, by the cameras before it if it has none itself."""
    from_there = np.eye(4)
    for name in _back_from(camera):
        if chain.find(name) is None:
            return None
        fields = chain.section(name)
        for spellings, turned in zip(keys, (False, True), strict=True):
            if fields.find(*spellings) is not None:
                found = rigid(f"{fields.place}: {spellings[0]}", fields.matrix((4, 4), *spellings))
                return from_there @ (inverse(found) if turned else found)
        if fields.find(PREVIOUS) is None:
            return None
        from_there = from_there @ rigid(f"{fields.place}: {PREVIOUS}", fields.matrix((4, 4), PREVIOUS))
    return None


def _back_from(camera: str) -> list[str]:
    """`camera` and those before it in the chain: cam2, cam1, cam0."""
    number = camera.removeprefix("cam")
    return [f"cam{i}" for i in range(int(number), -1, -1)] if number.isdecimal() else [camera]

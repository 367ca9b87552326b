"""nuScenes' records `calibrated_sensor` and `ego_pose`.

Source: https://www.nuscenes.org/nuscenes#data-format.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera.fields import Fields
from ldls.camera.rigid import from_parts, from_quaternion, inverse

Record = Mapping[str, Any]


def arguments(
    calibrated_camera: Record, ego_pose_camera: Record, calibrated_lidar: Record, ego_pose_lidar: Record
) -> dict[str, Any]:
    """Arguments of `Camera` at the moment of its image, seen from the lidar at the moment of its sweep.

    T_camera_lidar = T_ego_camera^-1 T_global_ego(camera)^-1 T_global_ego(lidar) T_ego_lidar.

    Raises:
        CalibrationError: A key is missing, or a value has the wrong size or is no rotation.
    """
    camera = Fields("calibrated_camera", calibrated_camera)
    from_ego = inverse(_pose(camera)) @ inverse(_pose(Fields("ego_pose_camera", ego_pose_camera)))
    to_ego = _pose(Fields("ego_pose_lidar", ego_pose_lidar)) @ _pose(Fields("calibrated_lidar", calibrated_lidar))
    return {
        "projection": camera.matrix((3, 3), "camera_intrinsic", mend="is it the record of a lidar?"),
        "T_camera_lidar": from_ego @ to_ego,
    }


def _pose(fields: Fields) -> NDArray[np.float64]:
    rotation = from_quaternion(f"{fields.place}: rotation", fields.matrix((4,), "rotation"))
    return from_parts(rotation, fields.matrix((3,), "translation"))

"""Sources of frames: data sets, drives, bags and folders, one module each.

    for frame in open_source("2011_09_26/2011_09_26_drive_0001_sync"):
        result = ldls.segment(frame.points, masks_of(frame.images[0].read()), frame.images[0].camera)

reads one frame after the other.
"""

from ldls.datasets.folder import FolderSource
from ldls.datasets.frame import CameraImage, Frame, Source
from ldls.datasets.kitti_object import KittiObjectSource
from ldls.datasets.kitti_odometry import KittiOdometrySource
from ldls.datasets.kitti_raw import KittiRawSource
from ldls.datasets.nuscenes import NuScenesSource
from ldls.datasets.nuscenes_frame import Box2d, NuScenesFrameSource, read_boxes_2d
from ldls.datasets.odometry import odometry_of
from ldls.datasets.registry import SOURCES, SourceClass, open_source
from ldls.datasets.rosbag import RosBag

__all__ = [
    "SOURCES",
    "Box2d",
    "CameraImage",
    "FolderSource",
    "Frame",
    "KittiObjectSource",
    "KittiOdometrySource",
    "KittiRawSource",
    "NuScenesFrameSource",
    "NuScenesSource",
    "RosBag",
    "Source",
    "SourceClass",
    "odometry_of",
    "open_source",
    "read_boxes_2d",
]

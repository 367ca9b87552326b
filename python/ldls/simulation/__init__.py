"""Scenes with perfect labels, seen by sensors and a segmenter that err as real ones do.

`sample_frame` needs nothing more; all else needs `pip install 'ldls[sim]'` when it is called.
"""

from ldls.simulation.drives import Drive, drive_frame, robot_drive
from ldls.simulation.error_model import SegmenterErrors, SensorErrors
from ldls.simulation.kitti_layout import write_kitti
from ldls.simulation.lidars import LIDARS, Lidar
from ldls.simulation.photograph import PixelTruth
from ldls.simulation.production import (
    FrameOrder,
    FrameSummary,
    make_frames,
    make_suite,
    suite,
    suite_folder,
    suite_orders,
)
from ldls.simulation.raw_layout import drive_folder, write_drive
from ldls.simulation.rigs import Rig, make_rig
from ldls.simulation.ros_layout import write_robot_drive
from ldls.simulation.sample import sample_frame
from ldls.simulation.scene_object import SceneObject
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.segmenting import segmented, true_masks
from ldls.simulation.simulated_frame import SimulatedFrame, SimulatedImage, scene_frame

__all__ = [
    "LIDARS",
    "Drive",
    "FrameOrder",
    "FrameSummary",
    "Lidar",
    "PixelTruth",
    "Rig",
    "Scene",
    "SceneObject",
    "SegmenterErrors",
    "SensorErrors",
    "SimulatedFrame",
    "SimulatedImage",
    "drive_folder",
    "drive_frame",
    "make_frames",
    "make_rig",
    "make_scene",
    "make_suite",
    "robot_drive",
    "sample_frame",
    "scene_frame",
    "segmented",
    "suite",
    "suite_folder",
    "suite_orders",
    "true_masks",
    "write_drive",
    "write_kitti",
    "write_robot_drive",
]

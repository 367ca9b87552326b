"""Scenes with perfect labels: the small street of the demo, and whole scenes with sensors and their errors.

`street_scene` needs nothing more; all else needs `pip install 'ldls[sim]'` when it is called.
"""

from ldls.simulation.demo.street import SimulatedFrame, street_scene
from ldls.simulation.drive import Drive, drive_frame
from ldls.simulation.errors import SegmenterErrors, SensorErrors
from ldls.simulation.frame import SceneFrame, View, scene_frame
from ldls.simulation.kitti_layout import write_kitti
from ldls.simulation.lidars import LIDARS, Lidar
from ldls.simulation.objects import SceneObject
from ldls.simulation.photograph import PixelTruth
from ldls.simulation.production import FrameOrder, FrameSummary, make_frames
from ldls.simulation.raw_layout import drive_folder, write_drive
from ldls.simulation.rig import Rig, make_rig
from ldls.simulation.robot_drive import Moment, robot_drive
from ldls.simulation.ros_layout import write_robot_drive
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.segmenting import segmented, true_masks
from ldls.simulation.suite import make_suite, suite, suite_folder, suite_orders

__all__ = [
    "LIDARS",
    "Drive",
    "FrameOrder",
    "FrameSummary",
    "Lidar",
    "Moment",
    "PixelTruth",
    "Rig",
    "Scene",
    "SceneFrame",
    "SceneObject",
    "SegmenterErrors",
    "SensorErrors",
    "SimulatedFrame",
    "View",
    "drive_folder",
    "drive_frame",
    "make_frames",
    "make_rig",
    "make_scene",
    "make_suite",
    "robot_drive",
    "scene_frame",
    "segmented",
    "street_scene",
    "suite",
    "suite_folder",
    "suite_orders",
    "true_masks",
    "write_drive",
    "write_kitti",
    "write_robot_drive",
]

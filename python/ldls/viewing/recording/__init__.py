"""Recordings for the Rerun viewer (https://rerun.io): a segmentation, its input and its diffusion, over time.

    with open_recording("000571.rrd", name="000571") as recording:
        recording.add(result, images={"image_2": image})

In a stream of one's own, `Recording(stream).log_result(result)` logs at the time that is set. Entities, where "world"
is the `entity` of the call:

=============================  ==================================================================================
entity                         content
=============================  ==================================================================================
world                          view coordinates (right-handed, z up) and the annotation context: categories as
                               classes, instances as their keypoints
world/points                   all finite points: instance colour, class id = category, keypoint id = label
                               or, where the result is tracked, track
world/points/direct            points in view, labelled by direct projection
world/boxes                    upright box of each object, with its name, number and speed
world/truth                    points by their true class, where the frame has truth
world/truth/boxes              upright box of each true instance
world/camera/NAME              pinhole and pose of each camera
world/camera/NAME/image        its image, as JPEG
world/camera/NAME/image/masks  labels of its masks' pixels, and an annotation context that names them
world/camera/NAME/image/points points that it sees
world/objects                  table of the objects and the report, as Markdown
world/statistics/...           points of each category, mean confidence, milliseconds of each stage
diffusion                      view coordinates and the annotation context
diffusion/points               points in view: winner's colour, the greyer the smaller its share; class id = category
=============================  ==================================================================================

Positions are in metres in the lidar frame, in single precision. Pixels are those of Rerun, whose pixel centres lie at
halves: u + 0.5, v + 0.5. A camera with a distorted lens stands in the 3D view as a pinhole without its distortion, for
Rerun knows no other; points on its image are exact. Keypoint id 0 is background and 65535 out of view.

Frames that are added have the timelines "frame" (0, 1, ...), "time" where they have stamps, and "iteration" where
their diffusion is recorded. Needs the extra `viz`.
"""

from ldls.viewing.recording.blueprint import Contents, layout
from ldls.viewing.recording.session import Recording, open_recording

__all__ = ["Contents", "Recording", "layout", "open_recording"]

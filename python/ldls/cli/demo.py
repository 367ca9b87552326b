"""`ldls demo`: the method on a simulated street, without any data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image
from rich.table import Table

import ldls
from ldls.cli.messages import console, object_table, speaks_plainly, timing_table
from ldls.cli.outputs import DEFAULT_OUTPUTS, Output, write_outputs
from ldls.cli.recording_options import ONLY_CAMERA, RerunOption, check_recording, record
from ldls.io import save

if TYPE_CHECKING:
    from ldls.simulation import SimulatedFrame


@speaks_plainly
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the results; made if need be.", file_okay=False)] = Path(
        "ldls-demo"
    ),
    seed: Annotated[int, typer.Option(help="Which street; every number is another one.", min=0)] = 0,
    rerun: RerunOption = None,
) -> None:
    """Run the method on a simulated street: no data needed.

    Builds a small street with cars, people and more, simulates a lidar sweep and the masks that a network would
    find, segments the sweep, and holds direct projection and the method against the scene's true labels. Writes the
    results as `ldls segment` does, pictures (the image, the bird's-eye view, and the comparison with direct
    projection), and the frame itself so that you can run that command on it.
    """
    from ldls.simulation import street_scene
    from ldls.viewing import save_pictures

    check_recording(rerun)
    frame = street_scene(seed)
    masks = ldls.InstanceMasks.from_array(
        frame.masks,
        categories=frame.categories,
        scores=frame.scores,
        image_size=frame.image.shape[:2],
    )
    camera = ldls.Camera(projection=frame.projection, T_camera_lidar=frame.T_camera_lidar)
    result = ldls.segment(frame.points, masks, camera)
    outputs = [output for output in DEFAULT_OUTPUTS if output is not Output.PNG]
    written = write_outputs(out, "demo", result, frame.image, outputs)
    written += save_pictures(out / "demo.png", result, frame.image)
    command = write_inputs(out, frame, masks)

    screen = console()
    screen.print(object_table(result.objects))
    screen.print(timing_table(result.timings))
    screen.print(accuracy_table(frame, masks, result))
    screen.print("wrote " + " ".join(map(str, written)), highlight=False, soft_wrap=True)
    screen.print(f"the same from files: {command}", highlight=False, soft_wrap=True)
    if rerun is not None:
        said = record(result, rerun, name="demo", images={ONLY_CAMERA: frame.image})
        screen.print(said, highlight=False, soft_wrap=True)


def accuracy_table(frame: SimulatedFrame, masks: ldls.InstanceMasks, result: ldls.Segmentation) -> Table:
    """Intersection over union of each object with the truth, for direct projection and for the method."""
    truth = frame.truth[result.in_view]
    direct = result.direct_labels[result.in_view]
    found = result.labels[result.in_view]
    ious = [(_iou(direct, truth, m), _iou(found, truth, m)) for m in range(1, len(masks) + 1)]
    mean = np.nanmean(ious, axis=0)
    table = Table(title="accuracy against the true labels (IoU of points, %)", show_footer=True)
    table.add_column("object", footer="mean")
    table.add_column("true points", justify="right", footer=f"{(truth > 0).sum():,}")
    table.add_column("direct projection", justify="right", footer=f"{mean[0]:.1%}".rstrip("%"))
    table.add_column("ldls", justify="right", footer=f"{mean[1]:.1%}".rstrip("%"))
    for m, (mask, iou) in enumerate(zip(masks, ious, strict=True), start=1):
        row = [mask.name, f"{(truth == m).sum():,}", *(f"{i:.1%}".rstrip("%") for i in iou)]
        table.add_row(*row)
    return table


def write_inputs(out: Path, frame: SimulatedFrame, masks: ldls.InstanceMasks) -> str:
    """Write the frame as files that `ldls segment` reads; the command that does so."""
    folder = out / "input"
    folder.mkdir(parents=True, exist_ok=True)
    frame.points.tofile(folder / "points.bin")
    save(masks, folder / "masks.npz")
    Image.fromarray(frame.image).save(folder / "image.png")
    matrices = {
        "P2": frame.projection,
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": frame.T_camera_lidar[:3],
    }
    lines = (f"{key}: {' '.join(map(repr, matrix.ravel().tolist()))}\n" for key, matrix in matrices.items())
    (folder / "calib.txt").write_text("".join(lines))
    return (
        f"ldls segment --points {folder / 'points.bin'} --calib {folder / 'calib.txt'} "
        f"--masks {folder / 'masks.npz'} --image {folder / 'image.png'} --out {out / 'from-files'}"
    )


def _iou(labels: NDArray[np.int32], truth: NDArray[np.int32], m: int) -> float:
    union = ((labels == m) | (truth == m)).sum()
    return float(((labels == m) & (truth == m)).sum() / union) if union else float("nan")

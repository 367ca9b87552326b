"""A stored result, in a recording or as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cli.recording_options import record
from ldls.errors import InputError
from ldls.io import read_result


def view_result(
    path: Path, images: Sequence[str], target: str | None, *, name: str, diffusion: int | None, picture: Path | None
) -> str:
    """Show a stored result; what to tell the user."""
    from ldls.view import camera_names

    result = read_result(path)
    pictures = read_images(images, camera_names(result.views))
    said = []
    if picture is not None:
        from ldls.viewing import save_pictures

        each = [pictures.get(camera) for camera in camera_names(result.views)]
        said.append("wrote " + " ".join(map(str, save_pictures(picture, result, each))))
    if target is not None:
        said.append(record(result, target, name=name, images=pictures, diffusion=diffusion))
    return "\n".join(said)


def read_images(texts: Sequence[str], cameras: Sequence[str]) -> dict[str, NDArray[np.uint8]]:
    """Images by camera: FILE for the cameras in their order, CAMERA=FILE for one by name.

    Raises:
        InputError: There are more images than cameras, or one camera has two.
    """
    from ldls.io import read_image

    paths: dict[str, str] = {}
    for number, text in enumerate(texts):
        camera, equals, file = text.partition("=")
        if not equals or camera not in cameras:
            if number >= len(cameras):
                raise InputError(f"--image: got {len(texts)} images, the result has cameras {', '.join(cameras)}")
            camera, file = cameras[number], text
        if camera in paths:
            raise InputError(f"--image: camera {camera} has {paths[camera]} and {file}; give one")
        paths[camera] = file
    return {camera: read_image(file) for camera, file in paths.items()}

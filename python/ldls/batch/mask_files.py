"""Stored masks of the frames of a run."""

from __future__ import annotations

from pathlib import Path

from ldls.batch.settings import fill
from ldls.errors import InputError

SUFFIXES = (".json", ".npz", ".png", ".npy", ".txt")
"""Suffixes looked for in a folder of masks, in this order."""


class MaskFiles:
    """Finds the file of masks of a frame, or of each image of a frame.

    Attributes:
        place: A folder with FRAME.json (or .npz, .png, .npy, .txt), for several cameras CAMERA/FRAME.json; or a path
            with {frame} and {camera} in it.
    """

    def __init__(self, place: str) -> None:
        """Masks at `place`.

        Raises:
            InputError: It is neither a folder nor a path with {frame}.
        """
        self.place = place
        if "{frame}" not in place and not Path(place).is_dir():
            raise InputError(
                f"masks: {place!r} is no folder and has no {{frame}} in it; expected a folder with a file a frame, or "
                "a path such as masks/{frame}.json"
            )

    def path(self, frame: str, camera: str, only_camera: bool) -> Path:
        """The file of masks of an image of a frame.

        Raises:
            InputError: The folder has none.
        """
        if "{frame}" in self.place:
            return Path(fill(self.place, frame, camera))
        folders = [Path(self.place) / camera, *([Path(self.place)] if only_camera else [])]
        for folder in folders:
            for suffix in SUFFIXES:
                if (folder / f"{frame}{suffix}").is_file():
                    return folder / f"{frame}{suffix}"
        looked = " or ".join(str(folder) for folder in folders)
        raise InputError(f"masks: no file {frame} with one of {' '.join(SUFFIXES)} in {looked}")

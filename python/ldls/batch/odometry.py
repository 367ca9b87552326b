"""Poses that the sweeps of a source tell, found once for the folder of a run."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ldls.batch.journal import Record, check_goes_on
from ldls.batch.lock import only_run
from ldls.batch.poses import FOUND, FOUND_POSES, KISS_ICP, holds_found_poses
from ldls.batch.settings import RunSettings
from ldls.datasets import Source, odometry_of
from ldls.errors import BatchError
from ldls.io.files import make_folder
from ldls.io.poses import tum


def with_odometry(source: Source, settings: RunSettings, folder: Path, of_source: Record) -> RunSettings:
    """The settings with a file of poses where these are to be found from the sweeps, which is done once a folder.

    Args:
        source: The sweeps.
        settings: Settings of the run.
        folder: Folder of the run; made if need be.
        of_source: The source as the journal has it.

    Raises:
        BatchError: The folder holds a run of other settings, another run is at work there, or a file that no run wrote
            is in the place of the poses.
        LdlsError: The sweeps do not say how the lidar moved; see `ldls.datasets.odometry_of`.
        ImportError: `ldls[odometry]` is not installed.
    """
    if settings.poses != KISS_ICP:
        return settings
    path = folder / FOUND_POSES
    found = replace(settings, poses=str(path))
    is_new = not folder.exists()
    make_folder(folder)
    # all that may refuse the folder comes before the work, and before the file
    try:
        with only_run(folder):
            if holds_found_poses(folder):
                return found
            if os.path.lexists(path):
                raise BatchError(
                    f"{path}: is there, no run here wrote it, and poses by {KISS_ICP} would take its place; take them "
                    f"from it by --poses {path}, or give another --out"
                )
            check_goes_on(folder, {"settings": found.record(), "source": of_source})
            tum.write(path, odometry_of(source), comment=FOUND)
    except BaseException:
        if is_new:
            # what holds something stays
            with suppress(OSError):
                folder.rmdir()
        raise
    return found

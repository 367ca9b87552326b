"""The way of a source's lidar, where the source has no poses."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

from ldls.checks import checked
from ldls.datasets.frame import Frame, Source
from ldls.errors import InputError, LdlsError, LeftOutWarning, PoseError, SourceError, some, within
from ldls.sequences import Trajectory
from ldls.sequences.odometry import PERIOD_S, Parts, Way

MOST_LEFT_OUT = 2
"""With more sweeps in a row left out the way may be lost unseen: at 14 m/s two cost nothing, three some metres."""
BEGINNING = 3
"""Fewer sweeps do not foresee where one after a gap lies: the way begins anew behind it."""


@checked
def odometry_of(source: Source) -> Trajectory:
    """Return the poses of the lidar at the frames of a drive, from its sweeps alone, by `ldls.odometry`.

    Stamps are those of the frames; where frames have none, frame k is taken at k x 0.1 s.
    Where frames have the times of their points, `ldls.odometry` takes the motion out of its sweeps.
    Frames are read one after the other, and none is kept. Frames that cannot be read, have too few points or come no
    later than the one before are left out with a `LeftOutWarning`: up to two in a row, and any number at either end
    that cannot be read or have too few points. So are the first ones before a gap, if they are fewer than three.

    Args:
        source: The drive, its frames in the order of time.

    Raises:
        SourceError: Some frames have stamps and others none.
        PoseError: A sweep has nothing in common with the one before it, or more than two in a row are left out, or come
            no later than the one before them.
        InputError: It is no source, or fewer than two frames are left.
        ImportError: `ldls[odometry]` is not installed.
    """
    if not hasattr(source, "names"):
        raise InputError(f"source: got {type(source).__name__}, expected a drive as ldls.datasets.open_source opens it")
    left_out: dict[str, str] = {}
    with within(source.path):
        try:
            trajectory = _way(source, left_out).trajectory()
        except InputError as error:
            why = "".join(f"; frame {name}: {reason}" for name, reason in [*left_out.items()][:1])
            raise type(error)(f"{error}{why}") from None
    if left_out:
        name, reason = next(iter(left_out.items()))
        names = [each for each in source.names if each in left_out]
        message = (
            f"{source.path}: {len(names):,} of {len(source):,} frames ({some(names)}) are left out of the way of the "
            f"lidar; {name}: {reason}"
        )
        warnings.warn(message, LeftOutWarning, stacklevel=3)
    return trajectory


def _way(source: Source, left_out: dict[str, str]) -> Way:
    """The way of the frames that can be used; names of others, and why they cannot, go to `left_out`."""
    way, laid = Way(), [-1]
    for number, frame in _readable(source, left_out):
        stamp = number * PERIOD_S if frame.stamp is None else frame.stamp
        sweep: Parts = stamp, frame.points, frame.times
        gap = [source.names[k] for k in range(laid[-1] + 1, number)]
        try:
            usable = way.usable(*sweep)
        except LdlsError as error:
            # one or two clocks that jump are a fault; more are another drive, or another order
            if isinstance(error, PoseError) and number - laid[-1] > MOST_LEFT_OUT:
                raise PoseError(f"frame {frame.name}: {error}") from None
            left_out[frame.name] = str(error)
            continue
        if gap and len(way) < BEGINNING:
            left_out |= {source.names[k]: "a gap comes after it before motion is known" for k in laid[1:]}
            way, laid = Way(), [-1]
            usable = way.usable(*sweep)
        elif len(gap) > MOST_LEFT_OUT:
            raise PoseError(
                f"{len(gap)} frames in a row ({some(gap)}) cannot be laid on those before, and past more than "
                f"{MOST_LEFT_OUT} the way is lost; mend them, or give poses of another origin"
            )
        way.lay(sweep, usable)
        laid.append(number)
    return way


def _readable(source: Source, left_out: dict[str, str]) -> Iterator[tuple[int, Frame]]:
    """Number and frame of those that can be read."""
    stamped = None
    for number, name in enumerate(source.names):
        try:
            frame = source[number]
        except (LdlsError, OSError) as error:
            left_out[name] = str(error)
            continue
        if stamped is None:
            stamped = frame.stamp is not None
        if stamped != (frame.stamp is not None):
            lacks = "no stamp" if stamped else "a stamp"
            raise SourceError(
                f"frame {frame.name} has {lacks}, unlike those before it; expected stamps of all frames or of none"
            )
        yield number, frame

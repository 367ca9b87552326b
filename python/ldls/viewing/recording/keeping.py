"""When annotation contexts are logged: the viewer (0.41) wants them in another way from a file than from a stream.

Of a file that it opens, it reads only contexts that hold for all times. Streamed to it, a context for all times that is
logged a second time is lost, and one for its own time is read. So a file gets each context once, at its end, for all
times; a viewer gets them as they come, each for its time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ldls.viewing.recording.stream import Entity

_held: dict[str, dict[str, tuple[Entity, Any]]] = {}
_timed: set[str] = set()


def log_context(entity: Entity, context: Any) -> None:  # noqa: ANN401
    """Log an annotation context, or hold it back; for all times in a recording of the user's own."""
    held = _held.get(entity.recording_id)
    if held is not None:
        held[entity.path] = (entity, context)
    else:
        entity.log(context, static=entity.recording_id not in _timed)


@contextmanager
def held_to_the_end(stream: Any) -> Iterator[None]:  # noqa: ANN401
    """Hold back the contexts of a recording; when the block ends well, the last of each entity holds for all times."""
    recording_id = stream.get_recording_id()
    held = _held[recording_id] = {}
    try:
        yield
    finally:
        del _held[recording_id]
    for entity, context in held.values():
        entity.log(context, static=True)


@contextmanager
def at_their_times(stream: Any) -> Iterator[None]:  # noqa: ANN401
    """Log the contexts of a recording for the times at which they come."""
    recording_id = stream.get_recording_id()
    _timed.add(recording_id)
    try:
        yield
    finally:
        _timed.discard(recording_id)

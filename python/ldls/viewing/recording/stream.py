"""A stream of Rerun, the entities in it, and when annotation contexts are logged to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

from ldls._optional import require
from ldls.checks import choice
from ldls.errors import InputError

Contexts = Literal["static", "timed", "held"]
"""Annotation contexts are logged for all times as they come, for the time that is set, or for all times at the end."""


def rerun() -> Any:  # noqa: ANN401
    """The module `rerun`.

    Raises:
        ImportError: It is not installed; the message names the extra.
    """
    return require("rerun", "viz")


class Stream:
    """A stream of Rerun, and the annotation contexts that are held back from it.

    The viewer (0.41) wants contexts in another way from a file than from a stream. Of a file that it opens, it reads
    only contexts that hold for all times. Streamed to it, a context for all times that is logged a second time is lost,
    and one for its own time is read.

    Attributes:
        rerun: The `rerun.RecordingStream`.
    """

    def __init__(self, stream: Any, contexts: Contexts) -> None:  # noqa: ANN401
        """The stream given, or the active one for None.

        Raises:
            InputError: No stream is active.
            ParameterError: There is no such way to log contexts.
        """
        choice("contexts", contexts, get_args(Contexts))
        self.rerun = rerun().get_data_recording(stream)
        if self.rerun is None:
            raise InputError(
                "recording: none is active; call rerun.init(...) first, or pass a rerun.RecordingStream, or use "
                "open_recording"
            )
        self._contexts = contexts
        self._held: dict[Entity, Any] = {}

    def log_context(self, entity: Entity, context: Any) -> None:  # noqa: ANN401
        """Log an annotation context, or hold it back in the place of an earlier one of the entity."""
        if self._contexts == "held":
            self._held[entity] = context
        else:
            entity.log(context, static=self._contexts == "static")

    def log_held(self) -> None:
        """Log the contexts that were held back, for all times."""
        for entity, context in self._held.items():
            entity.log(context, static=True)


@dataclass(frozen=True)
class Entity:
    """A place in a stream, and all below it.

    Attributes:
        path: Its path, escaped where a name needs it.
        stream: Its stream.
    """

    path: str
    stream: Stream

    def __truediv__(self, name: str) -> Entity:
        return Entity(f"{self.path}/{rerun().escape_entity_path_part(name)}", self.stream)

    def log(self, *archetypes: Any, static: bool = False) -> None:  # noqa: ANN401
        """Log archetypes here, at the time that is set or for all times."""
        # strict: archetypes that cannot be logged are an error, not a note in the terminal
        rerun().log(self.path, *archetypes, static=static, recording=self.stream.rerun, strict=True)

    def clear(self) -> None:
        """From the time that is set on, show nothing here and below."""
        self.log(rerun().Clear(recursive=True))

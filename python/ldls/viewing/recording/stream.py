"""The library that writes recordings, and entities of one of its streams."""

from __future__ import annotations

from typing import Any

from ldls._optional import require
from ldls.errors import InputError


def rerun() -> Any:  # noqa: ANN401
    """The module `rerun`.

    Raises:
        ImportError: It is not installed; the message names the extra.
    """
    return require("rerun", "viz")


def blueprints() -> Any:  # noqa: ANN401
    """The module `rerun.blueprint`.

    Raises:
        ImportError: It is not installed; the message names the extra.
    """
    return require("rerun.blueprint", "viz")


class Entity:
    """A place in a recording, and what is below it.

    Attributes:
        path: Its path, escaped where a name needs it.
    """

    def __init__(self, path: str, recording: Any) -> None:  # noqa: ANN401
        """The entity at `path` of a stream; of the active one where `recording` is None.

        Raises:
            InputError: There is no active stream.
        """
        stream = rerun().get_data_recording(recording)
        if stream is None:
            raise InputError(
                "recording: none is active; call rerun.init(...) first, or pass a rerun.RecordingStream, or use "
                "open_recording"
            )
        self.path = path
        self._stream = stream

    @property
    def recording_id(self) -> str:
        """What tells its recording from others."""
        found: str = self._stream.get_recording_id()
        return found

    def __truediv__(self, name: str) -> Entity:
        return Entity(f"{self.path}/{rerun().escape_entity_path_part(name)}", self._stream)

    def log(self, *archetypes: Any, static: bool = False) -> None:  # noqa: ANN401
        """Log archetypes here, at the time that is set or for all times."""
        # strict: what cannot be logged is an error, not a note in the terminal
        rerun().log(self.path, *archetypes, static=static, recording=self._stream, strict=True)

    def clear(self) -> None:
        """From the time that is set on, show nothing here and below."""
        self.log(rerun().Clear(recursive=True))

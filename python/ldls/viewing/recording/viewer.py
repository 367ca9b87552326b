"""The Rerun viewer, where there is a display for it."""

from __future__ import annotations

import os
import socket
import sys
from typing import Any

PORT = 9876
"""The port on which viewers listen."""
ANSWER_S = 1.0


def has_display() -> bool:
    """Return True if a window can be opened: on macOS and Windows always, on Linux where X or Wayland is named."""
    named = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    return named or sys.platform in ("darwin", "win32")


def is_open() -> bool:
    """Return True if a viewer, or a program in its place, listens on this machine."""
    try:
        with socket.create_connection(("127.0.0.1", PORT), timeout=ANSWER_S):
            return True
    except OSError:
        return False


def connect(stream: Any) -> None:  # noqa: ANN401
    """Send all that is logged to `stream` to the viewer that is open, or to one that is started.

    Raises:
        ConnectionError: None is open and there is no display, or the viewer does not answer.
    """
    if not has_display() and not is_open():
        raise ConnectionError("rerun: there is no display to open a viewer on; name a file, as --rerun frames.rrd")
    stream.spawn(port=PORT)
    flush(stream)


def flush(stream: Any) -> None:  # noqa: ANN401
    """Wait until the viewer has all that was logged to `stream`.

    Raises:
        ConnectionError: It does not answer.
    """
    try:
        stream.flush()
    except RuntimeError as error:
        message = f"rerun: the viewer does not answer ({error}); name a file instead, as --rerun frames.rrd"
        raise ConnectionError(message) from None

"""Bags in which some message types cannot be parsed: their topics are listed, all others are read."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

from ldls._optional import require


class KnownTypes:
    """A reader of `rosbags` whose connections lack the definitions that cannot be parsed, or are none of their type."""

    def __init__(self, reader: Any) -> None:  # noqa: ANN401
        """Stand in for `reader`."""
        self._reader = reader

    @property
    def connections(self) -> list[Any]:
        """Those of the reader; where the definition is of no use, without it."""
        interfaces = require("rosbags.interfaces", "ros")
        none = interfaces.MessageDefinition(interfaces.MessageDefinitionFormat.NONE, "")
        return [
            connection if _is_known(connection) else connection._replace(msgdef=none, digest="")
            for connection in self._reader.connections
        ]

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._reader, name)

    def __enter__(self) -> Self:
        self._reader.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._reader.__exit__(kind, error, traceback)


def _is_known(connection: Any) -> bool:  # noqa: ANN401
    typesys = require("rosbags.typesys", "ros")
    formats = require("rosbags.interfaces", "ros").MessageDefinitionFormat
    if connection.msgdef.format != formats.MSG:
        return True
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    try:
        store.register(typesys.get_types_from_msg(connection.msgdef.data, connection.msgtype))
        ros2 = hasattr(connection.ext, "offered_qos_profiles")
        digest = store.hash_rihs01(connection.msgtype) if ros2 else store.generate_msgdef(connection.msgtype)[1]
    except Exception:
        return False
    return not connection.digest or bool(digest == connection.digest)

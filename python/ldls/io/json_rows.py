"""JSON files that hold one long list of objects, read an object at a time."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from os import PathLike
from typing import IO, Any

from ldls.errors import CorruptFileError, TruncatedFileError
from ldls.io.files import open_file

MAX_BYTES = 1 << 36
CHUNK_CHARACTERS = 1 << 20
LONGEST_OBJECT = 1 << 24
"""Characters after which what has not ended is no object."""
START = re.compile(r"\s*\[")
BETWEEN = re.compile(r"[\s,]*")


def read_json_rows(path: str | PathLike[str]) -> Iterator[dict[str, Any]]:
    """The objects of a file that holds a JSON list of them; takes a few megabytes however long the file is.

    Raises:
        TruncatedFileError: The list does not end.
        CorruptFileError: The file is no JSON list of objects; the message says after how many of them.
        FileNotFoundError: There is no such file.
    """
    count = 0
    with open_file(path, "JSON list", limit=MAX_BYTES) as file:
        try:
            for count, row in enumerate(_rows(file), start=1):  # noqa: B007 - the handlers below tell it
                yield row
        except EOFError:
            raise TruncatedFileError(f"the list ends after {count:,} whole objects without a ']'") from None
        except (ValueError, RecursionError) as error:
            raise CorruptFileError(f"not a JSON list of objects after the first {count:,} ({error})") from None


def _rows(content: IO[bytes]) -> Iterator[dict[str, Any]]:
    decode = json.JSONDecoder().raw_decode
    with io.TextIOWrapper(content, encoding="utf-8-sig") as file:
        text = file.read(CHUNK_CHARACTERS)
        start = START.match(text)
        if start is None:
            raise json.JSONDecodeError("Expecting '['", text, 0)
        at = start.end()
        while True:
            at = BETWEEN.match(text, at).end()  # type: ignore[union-attr]  # it matches nothing, too
            if text.startswith("]", at):
                return
            if at < len(text) and text[at] != "{":
                raise json.JSONDecodeError("Expecting '{'", text, at)
            try:
                row, at = decode(text, at)
            except json.JSONDecodeError:
                # the object may go on in the next chunk
                more = file.read(CHUNK_CHARACTERS)
                if not more:
                    raise EOFError from None
                if len(text) - at > LONGEST_OBJECT:
                    raise
                text, at = text[at:] + more, 0
                continue
            yield row

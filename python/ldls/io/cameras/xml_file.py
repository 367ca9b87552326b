"""OpenCV's FileStorage as XML.

Source: https://docs.opencv.org/4.x/da/d56/classcv_1_1FileStorage.html.
"""

from __future__ import annotations

from xml.etree import ElementTree

from ldls.errors import CalibrationError, UnsupportedFormatError

ROOT = "opencv_storage"
MATRIX = "opencv-matrix"


def entries_of(text: str) -> dict[str, object]:
    """The entries of a file by name: matrices with `rows`, `cols` and `data`, tables, lists, and words as they stand.

    Raises:
        CalibrationError: It is not XML; the message names the line.
        UnsupportedFormatError: It is XML of something else.
    """
    # entities may grow beyond their text, and OpenCV writes none
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UnsupportedFormatError("XML with a document type of its own; OpenCV writes none")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise CalibrationError(f"line {error.position[0]}: not XML ({error})") from None
    if root.tag != ROOT:
        raise UnsupportedFormatError(f"XML of <{root.tag[:60]}>, expected OpenCV's <{ROOT}>")
    return _table(root)


def _table(element: ElementTree.Element) -> dict[str, object]:
    entries: dict[str, object] = {}
    for child in element:
        if child.tag in entries:
            raise CalibrationError(f"key '{child.tag[:60]}' stands there twice")
        entries[child.tag] = _value(child)
    return entries


def _value(element: ElementTree.Element) -> object:
    words = (element.text or "").split()
    if element.get("type_id") == MATRIX:
        return {child.tag: (child.text or "").split() for child in element if child.tag in ("rows", "cols", "data")}
    if len(element) and all(child.tag == "_" for child in element):
        return [_value(child) for child in element]
    if len(element):
        return _table(element)
    return words[0].strip('"') if len(words) == 1 else words

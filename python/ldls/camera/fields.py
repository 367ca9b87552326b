"""Entries of a calibration file or message, each checked when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.camera.distortion import Distortion
from ldls.checks.values import shown
from ldls.errors import CalibrationError, within


@dataclass(frozen=True)
class Fields:
    """Named entries, found in capitals or not.

    Attributes:
        place: File or message that they are from, for errors.
        entries: The entries by name.
    """

    place: str
    entries: Mapping[str, object]

    def find(self, *spellings: str) -> object | None:
        """The first entry under one of `spellings`; None where there is none."""
        by_name = {str(name).lower(): value for name, value in self.entries.items()}
        return next((by_name[name.lower()] for name in spellings if name.lower() in by_name), None)

    def get(self, *spellings: str, mend: str = "") -> object:
        """The first entry under one of `spellings`.

        Raises:
            CalibrationError: There is none; the message says what there is, what was expected, and `mend`.
        """
        value = self.find(*spellings)
        if value is None:
            keys = " ".join(map(str, self.entries)) or "none"
            others = f", expected that or {', '.join(spellings[1:])}" if len(spellings) > 1 else ""
            hint = f"; {mend}" if mend else ""
            raise CalibrationError(f"{self.place}: key '{spellings[0]}' missing; found {keys}{others}{hint}")
        return value

    def section(self, name: str) -> Fields:
        """The entries of the entry `name`.

        Raises:
            CalibrationError: There is none, or it has no entries.
        """
        entries = self.get(name)
        if not isinstance(entries, Mapping):
            raise CalibrationError(f"{self.place}: {name} is {shown(entries)}, expected keys with values")
        return Fields(f"{self.place}: {name}", entries)

    def image_size(self) -> tuple[int, int] | None:
        """(height, width) in pixels of `image_height` and `image_width`; None where one is missing or 0."""
        height, width = self.whole_number("image_height", "height"), self.whole_number("image_width", "width")
        return (height, width) if height and width else None

    def numbers(self, *spellings: str, mend: str = "") -> NDArray[np.float64]:
        """The numbers of an entry as they stand: a list, a list of rows, or `rows`, `cols` and `data`.

        Raises:
            CalibrationError: There is no such entry, or it holds something else, or a number is not finite.
        """
        name, value = spellings[0], self.get(*spellings, mend=mend)
        if isinstance(value, Mapping):
            return Fields(f"{self.place}: {name}", value)._rows_and_columns()
        try:
            values = np.array(value, np.float64)
        except (TypeError, ValueError):
            raise CalibrationError(
                f"{self.place}: {name}: expected numbers with a decimal point, got {shown(value)}"
            ) from None
        except OverflowError:  # a whole number that float64 has not
            values = np.array(np.inf)
        if not np.isfinite(values).all():
            raise CalibrationError(f"{self.place}: {name}: expected finite numbers, got {shown(value)}")
        return values

    def matrix(self, shape: tuple[int, ...], *spellings: str, mend: str = "") -> NDArray[np.float64]:
        """The numbers of an entry in `shape`.

        Raises:
            CalibrationError: As `numbers`, or there are more or fewer of them.
        """
        values = self.numbers(*spellings, mend=mend)
        expected = int(np.prod(shape))
        if values.size != expected or (values.ndim == 2 and values.shape != shape and 1 not in values.shape):
            size = " x ".join(map(str, shape))
            amount = f"{values.size} as {' x '.join(map(str, values.shape))}" if values.ndim > 1 else str(values.size)
            raise CalibrationError(f"{self.place}: {spellings[0]}: expected {expected} numbers ({size}), got {amount}")
        return values.reshape(shape)

    def whole_number(self, *spellings: str) -> int | None:
        """A whole number from 0; None where there is no such entry.

        Raises:
            CalibrationError: It is something else.
        """
        value = self.find(*spellings)
        if value is None:
            return None
        number = self.matrix((1,), *spellings)[0]
        if not (number >= 0 and number == np.floor(number)):
            raise CalibrationError(f"{self.place}: {spellings[0]}: expected a whole number from 0, got {shown(value)}")
        return int(number)

    def distortion(self, model: str, coefficients: NDArray[np.float64]) -> Distortion:
        """Distortion by the `model` and `coefficients` that stand here.

        Raises:
            CalibrationError: The model is unknown or has another number of coefficients.
        """
        with within(self.place):
            return Distortion(model, tuple(coefficients.ravel().tolist()))

    def _rows_and_columns(self) -> NDArray[np.float64]:
        """The matrix whose `rows`, `cols` and `data` these entries are."""
        values = self.numbers("data", mend="write a list of numbers, or rows: 1, cols: 2, data: [1.0, 0.5]")
        rows, columns = self.whole_number("rows"), self.whole_number("cols")
        if rows is None or columns is None:
            return values
        if values.size != rows * columns:
            raise CalibrationError(f"{self.place}: {rows} rows x {columns} cols, got {values.size} numbers")
        return values.reshape(rows, columns)

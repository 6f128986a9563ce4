"""A table of a CSV or Parquet file: named columns of numbers, each read when it is asked for.

CSV as laboratories write it: a comma, semicolon or tab between cells, a decimal comma beside semicolons or tabs, lines
that begin with `#` left out, empty cells for values that were not measured; UTF-8, UTF-16 or Windows-1252. The first
line names the columns.
"""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ldcs_ros import extras
from ldcs_ros.errors import RecordingError, one_line
from ldcs_ros.schema.fields import did_you_mean

if TYPE_CHECKING:
    from pyarrow import Table

SUFFIXES = (".csv", ".tsv", ".txt", ".parquet")
LARGEST_FILE = 512_000_000
"""Size from which on a file is refused [bytes]."""
SEPARATORS = (",", ";", "\t")
_FRACTION = re.compile(r"[.,](\d+)")
# Day, month and year with dots between are in this order everywhere; with slashes they are not.
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})(?=\D)")
_LEFT_OUT = "; lines that begin with # are left out"
_NOTHING = ("", "nan", "na", "n/a", "null", "none", "-")


class TableFile(Protocol):
    """Named columns of one file.

    Attributes:
        name: Path of the file, for errors.
        names: Column names in their order.
    """

    name: str
    names: tuple[str, ...]

    def column(self, name: str) -> np.ndarray:
        """Return a column of numbers, NaN where a cell is empty, shape (n_rows,).

        Raises:
            RecordingError: There is no such column, more than one, or a cell that is no number.
        """
        ...

    def times(self, name: str, scale: float) -> np.ndarray:
        """Return a column of times [ns], int64, shape (n_rows,); the least int64 where a cell is empty.

        Dates with a time of day (ISO 8601, or day.month.year; UTC without an offset) are taken as such, numbers times
        `scale` [s].

        Raises:
            RecordingError: As `column`.
        """
        ...


NO_TIME = int(np.iinfo(np.int64).min)
_MOST_SHOWN = 30  # column names in an error
_FARTHEST = 9.0e18  # ns: 285 years


def is_table(path: Path) -> bool:
    """Return whether a path names a table by its suffix."""
    return path.suffix.lower() in SUFFIXES


def open_table(path: Path) -> TableFile:
    """Return the table of a file.

    Raises:
        RecordingError: It cannot be read, is too large or no table.
        MissingPackageError: The package for its format is not installed.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {one_line(error)}") from error
    if not path.is_file():
        raise RecordingError(f"{path} is a folder or a device, expected a file")
    if size > LARGEST_FILE:
        raise RecordingError(f"{path}: got {size} bytes, expected a file of at most {LARGEST_FILE} bytes")
    return _Parquet(path) if path.suffix.lower() == ".parquet" else _Csv(path)


def nanoseconds(seconds: np.ndarray, name: str) -> np.ndarray:
    """Return times [ns] of times [s], shape (n,), NO_TIME where they are NaN; RecordingError if one is too far."""
    scaled = 1e9 * seconds
    known = np.isfinite(scaled)
    if (np.abs(scaled[known]) > _FARTHEST).any() or np.isinf(scaled).any():
        raise RecordingError(f"{name} holds {np.nanmax(np.abs(seconds)):g} s, expected times below 285 years")
    return np.where(known, np.round(np.where(known, scaled, 0.0)).astype(np.int64), NO_TIME)


class _Csv:
    def __init__(self, path: Path) -> None:
        self.name = str(path)
        text = _text(path)
        if "\0" in text:  # refused by csv on Python 3.10 alone
            raise RecordingError(f"{path} is no CSV: it contains NUL")
        numbered = [(k, line) for k, line in enumerate(text.splitlines(), 1) if _has_cells(line)]
        if not numbered:
            raise RecordingError(f"{path} is empty, expected a line of column names and lines of numbers")
        separator = max(SEPARATORS, key=numbered[0][1].count)
        try:
            rows = list(csv.reader((line for _, line in numbered), delimiter=separator, strict=True))
        except csv.Error as error:
            raise RecordingError(f"{path} is no CSV: {one_line(error)}") from error
        if len(rows) != len(numbered):
            raise RecordingError(f"{path}: a quoted cell runs over several lines, expected one line a row")
        self._lines = [line for line, _ in numbered[1:]]
        self.names = tuple(cell.strip() for cell in rows[0])
        self._rows = rows[1:]
        self._decimal_comma = separator != ","
        for line, row in zip(self._lines, self._rows, strict=True):
            if len(row) > len(self.names) and any(cell.strip() for cell in row[len(self.names) :]):
                raise RecordingError(
                    f"{path}, line {line}: got {len(row)} cells, expected {len(self.names)}: one for each column name "
                    f"of line {numbered[0][0]}; begin lines above the names with #"
                )

    def column(self, name: str) -> np.ndarray:
        return np.array(self._cells(name, self._number), dtype=float)

    def times(self, name: str, scale: float) -> np.ndarray:
        index = find(self, name)
        cells = (row[index].strip() if index < len(row) else "" for row in self._rows)
        line, first = next(
            ((line, cell) for line, cell in zip(self._lines, cells, strict=True) if cell), (0, "")
        )
        if self._number(first) is None and _date(first) is None:
            raise RecordingError(
                f"{self.name}, line {line}, column {name!r}: got {first[:40]!r}, expected a number, or a date such as "
                f"2024-05-01 10:00:00.25 or 01.05.2024 10:00:00,25{_LEFT_OUT}"
            )
        if self._number(first) is not None:
            return nanoseconds(scale * self.column(name), f"column {name!r} of {self.name}")
        return np.array(
            self._cells(name, lambda text: NO_TIME if _is_nothing(text) else _date(text)), dtype=np.int64
        )

    def _cells(self, name: str, convert: Callable[[str], float | int | None]) -> list[float | int]:
        index = find(self, name)
        found: list[float | int] = []
        for line, row in zip(self._lines, self._rows, strict=True):
            text = row[index].strip() if index < len(row) else ""
            value = convert(text)
            if value is None:
                raise RecordingError(
                    f"{self.name}, line {line}, column {name!r}: got {text[:40]!r}, expected a number{_LEFT_OUT}"
                )
            found.append(value)
        return found

    def _number(self, text: str) -> float | None:
        try:
            return float(text.replace(",", ".") if self._decimal_comma else text)
        except ValueError:
            return math.nan if _is_nothing(text) else None


class _Parquet:
    def __init__(self, path: Path) -> None:
        self.name = str(path)
        parquet = extras.load("pyarrow.parquet", extra="data", purpose=f"{path.name} (Parquet)")
        try:
            self._table: Table = parquet.read_table(path)
        except (OSError, ValueError) as error:  # an error of Arrow is one of these
            raise RecordingError(f"{path} is no Parquet file: {one_line(error)}") from error
        self.names: tuple[str, ...] = tuple(self._table.column_names)

    def column(self, name: str) -> np.ndarray:
        values = self._values(name)
        if values.dtype.kind not in "fiub":
            raise RecordingError(f"column {name!r} of {self.name} holds {values.dtype}, expected numbers")
        return values.astype(float)

    def times(self, name: str, scale: float) -> np.ndarray:
        values = self._values(name)
        if values.dtype.kind == "M":
            # NumPy's NaT is the least int64.
            return values.astype("datetime64[ns]").astype(np.int64)
        return nanoseconds(scale * self.column(name), f"column {name!r} of {self.name}")

    def _values(self, name: str) -> np.ndarray:
        return np.asarray(self._table.column(find(self, name)).to_numpy())


def find(table: TableFile, name: str) -> int:
    """Return the index of a column.

    Raises:
        RecordingError: There is none of this name, or more than one.
    """
    count = table.names.count(name)
    if count == 1:
        return table.names.index(name)
    if count:
        raise RecordingError(f"{table.name} has {count} columns {name!r}, expected one")
    hint = did_you_mean(name, table.names)
    raise RecordingError(f"{table.name} has no column {name!r}, only {_shown(table.names)}.{hint}")


def _shown(names: Sequence[str]) -> str:
    left = len(names) - _MOST_SHOWN
    return str(list(names[:_MOST_SHOWN])) + (f" and {left} more" if left > 0 else "")


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {one_line(error)}") from error
    # Spreadsheets write UTF-16 with a mark, or the Western code page, in which a degree or a micro sign is one byte.
    encodings = (
        ("utf-16",) if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else ("utf-8-sig", "cp1252")
    )
    for encoding in encodings:
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise RecordingError(f"{path} is no text in UTF-8, UTF-16 or Windows-1252; save it as CSV UTF-8")


def _has_cells(line: str) -> bool:
    stripped = line.strip()
    return bool(stripped) and not stripped.startswith("#")


def _is_nothing(text: str) -> bool:
    return text.lower() in _NOTHING


def _date(text: str) -> int | None:
    # Python 3.10 reads no Z for UTC, and three or six digits of a second alone.
    text = _DOTTED.sub(lambda date: f"{date[3]}-{date[2]:0>2}-{date[1]:0>2}", text, count=1)
    text = _FRACTION.sub(lambda digits: f".{digits[1][:6]:0<6}", text).replace("Z", "+00:00")
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    since = moment - datetime(1970, 1, 1, tzinfo=timezone.utc)
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1000

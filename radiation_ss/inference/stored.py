"""Values of many columns that are taken rows by rows: side by side without a copy, each record's own, or in a file."""

import tempfile
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import IO, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError

PIECE = 16384  # rows that are taken at a time


class Values(ABC):
    """A matrix of which rows can be had, shape (N, K): `values[first:last]` is an array, as is `values @ x`."""

    shape: tuple[int, int]

    @abstractmethod
    def __getitem__(self, rows: slice) -> FloatArray:
        """Return the rows of a slice."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        return np.asarray(self[0:self.shape[0]], dtype=dtype)

    def __matmul__(self, unknowns: FloatArray) -> FloatArray:
        pieces = range(0, self.shape[0], PIECE)
        return np.concatenate([self[first:min(first + PIECE, self.shape[0])] @ unknowns for first in pieces])


class Beside(Values):
    """Matrices side by side."""

    def __init__(self, parts: Sequence[FloatArray | Values]) -> None:
        self.parts: list[FloatArray | Values] = []
        for part in parts:
            self.parts += part.parts if isinstance(part, Beside) else [part]
        self.shape = self.parts[0].shape[0], sum(part.shape[1] for part in self.parts)

    def __getitem__(self, rows: slice) -> FloatArray:
        return np.concatenate([part[rows] for part in self.parts], axis=1)


class ByRecord(Values):
    """One column (N,) as one for each record that it has values in; `record` (N,) are their positions, -1 for none."""

    def __init__(self, column: FloatArray, record: np.ndarray, count: int) -> None:
        self.column, self.record, self.shape = column, record, (column.size, count)

    def __getitem__(self, rows: slice) -> FloatArray:
        return np.where(self.record[rows, None] == np.arange(self.shape[1]), self.column[rows, None], 0.0)


class Shelf:
    """A temporary file for what would be more than `held` numbers in memory; it goes with the last that reads it."""

    def __init__(self, held: int) -> None:
        self.left, self.end = held, 0

    @cached_property
    def file(self) -> IO[bytes]:
        """The file, which has no name."""
        return tempfile.TemporaryFile(prefix="radiation_ss", buffering=0)

    def __del__(self) -> None:
        if "file" in self.__dict__:
            self.file.close()

    def put(self, values: FloatArray | Values) -> FloatArray | Values:
        """Return values as they are while there is room, then as they stand in the file."""
        if isinstance(values, Values) or values.size <= self.left:
            self.left -= 0 if isinstance(values, Values) else values.size
            return values
        return Shelved(self, values)


class Shelved(Values):
    """A matrix in the file of a shelf."""

    def __init__(self, shelf: Shelf, values: FloatArray) -> None:
        self.shelf, self.shape, self.first = shelf, values.shape, shelf.end
        try:
            shelf.file.seek(self.first)
            left = np.ascontiguousarray(values).data.cast("B")
            while left:
                left = left[shelf.file.write(left):]
        except OSError:
            raise InputError(f"{tempfile.gettempdir()}: no room for {values.nbytes / 1e6:.3g} MB that do not fit into "
                             "memory; free some there, or name another folder by TMPDIR") from None
        shelf.end += values.nbytes

    def __getitem__(self, rows: slice) -> FloatArray:
        first, last, _ = rows.indices(self.shape[0])
        count, columns = max(last - first, 0), self.shape[1]
        self.shelf.file.seek(self.first + 8 * first * columns)
        return np.fromfile(self.shelf.file, count=count * columns).reshape(count, columns)

"""Parquet files as numpy arrays; all that is known of pyarrow stands here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SetupError
from .layout import DatasetError, Feature

try:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq
except ImportError as error:
    raise SetupError(f"Datasets are read with pyarrow ({error}): pip install 'maniagent[data]'") from error

_UNREADABLE = (pa.ArrowException, OSError, ValueError)
_AGAIN = "Copy the file again from where the dataset was made."


def parquet_files(folder: Path) -> list[Path]:
    """The Parquet files of a chunked folder, in the order in which LeRobot reads them."""
    return sorted(folder.glob("*/*.parquet"))


def read_rows(path: Path, where: str, without: str = "") -> list[dict[str, Any]]:
    """All rows of a small file as dictionaries; columns whose name begins with `without` are left out."""
    return list(DataFile(path, where).rows(without))


class DataFile:
    """One Parquet file, read in pieces. Everything raises DatasetError where the file is broken."""

    def __init__(self, path: Path, where: str) -> None:
        self.where = where
        try:
            self._file = pq.ParquetFile(path)
            self.columns: dict[str, pa.DataType] = {field.name: field.type for field in self._file.schema_arrow}
            metadata = self._file.metadata
            sizes = [metadata.row_group(i).num_rows for i in range(metadata.num_row_groups)]
        except FileNotFoundError:
            raise DatasetError(where, "is missing", _AGAIN) from None
        except _UNREADABLE as error:
            raise self._broken(error) from error
        self._starts = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])
        self._cached: dict[tuple[str, ...], tuple[int, int, pa.Table]] = {}

    @property
    def length(self) -> int:
        """Number of rows."""
        return int(self._starts[-1])

    def rows(self, without: str = "") -> Iterator[dict[str, Any]]:
        """All rows as dictionaries."""
        names = tuple(name for name in self.columns if not (without and name.startswith(without)))
        try:
            yield from self.table(0, self.length, names).to_pylist()
        except _UNREADABLE as error:
            raise self._broken(error) from error

    def table(self, start: int, stop: int, columns: Sequence[str]) -> Any:
        """Rows `start` to `stop` as a table.

        The row groups read last are kept, for each choice of columns: the next episode mostly shares them.
        """
        first = max(0, int(np.searchsorted(self._starts, start, "right")) - 1)
        last = max(first + 1, int(np.searchsorted(self._starts, stop, "left")))
        key = tuple(columns)
        if key not in self._cached or self._cached[key][:2] != (first, last):
            try:
                groups = list(range(first, min(last, len(self._starts) - 1)))
                table = self._file.read_row_groups(groups, columns=list(columns))
                table.validate(full=True)
            except _UNREADABLE as error:
                raise self._broken(error) from error
            self._cached[key] = (first, last, table)
        return self._cached[key][2].slice(start - int(self._starts[first]), stop - start)

    def column(self, name: str) -> NDArray[Any]:
        """A whole column of single numbers."""
        if name not in self.columns:
            raise DatasetError(self.where, f"has no column {name!r}")
        try:
            return values(self.table(0, self.length, (name,))[name], (1,))
        except ValueError as error:
            raise DatasetError(self.where, f"{name} {error}") from error

    def _broken(self, error: Exception) -> DatasetError:
        return DatasetError(self.where, f"can't be read ({_first_line(error)})", _AGAIN)


def values(column: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """A column as an array (rows, *shape), (rows,) where the shape is (1,); ValueError where a row is of another."""
    array = column.combine_chunks()
    rows = len(array)
    for size in shape if shape != (1,) or _is_list(array.type) else ():
        if not _is_list(array.type):
            raise ValueError(f"holds {array.type} where lists of {size} are wanted")
        if array.null_count:
            raise ValueError("has empty cells")
        lengths = np.asarray(pc.list_value_length(array))
        if (wrong := np.flatnonzero(lengths != size)).size:
            raise ValueError(f"has {lengths[wrong[0]]} values in row {wrong[0] * rows // len(lengths)}, not {size}")
        array = array.flatten()
    if _is_list(array.type):
        raise ValueError(f"holds lists of {array.type.value_type} where single values are wanted")
    if array.null_count:
        raise ValueError("has empty cells")
    out: NDArray[Any] = array.to_numpy(zero_copy_only=False)
    return out if shape == (1,) else out.reshape(rows, *shape)


def texts(column: Any) -> tuple[str, ...]:
    """A column of texts, empty ones where there is none."""
    return tuple("" if text is None else str(text) for text in column.to_pylist())


def type_fits(feature: Feature, stored: Any) -> bool:
    """Whether a column of Arrow type `stored` holds what the feature promises."""
    while _is_list(stored):
        stored = stored.value_type
    if feature.dtype == "image":
        return bool(pa.types.is_struct(stored))
    if feature.dtype == "string":
        return bool(pa.types.is_string(stored) or pa.types.is_large_string(stored))
    try:
        return bool(np.dtype(stored.to_pandas_dtype()) == np.dtype(feature.dtype))
    except (TypeError, NotImplementedError):
        return False


def _is_list(kind: Any) -> bool:
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]

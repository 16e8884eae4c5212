"""Store of a sweep: a folder of immutable Parquet files, one per batch of finished cells.

A file is written beside and renamed, so it is complete or absent, whenever the process dies. Several
processes may append at the same time. Small files are merged when the store is opened alone.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from touchstone.reports.results import COLUMNS, Row, write_beside, write_text
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.content_hash import FORMAT, hash_of
from touchstone.scenarios.files.safe_paths import json_of, regular

MOST_FILES = 64
NUMBERS = ("dt", "value", "low", "high", "limit")
INTEGERS = ("seed", "repeat")
SCHEMA = pa.schema(
    [
        ("cell", pa.string()),  # content hash
        ("measure", pa.string()),  # what was measured, and from which scene: names of functions
        ("source", pa.string()),
        ("settings", pa.string()),  # "key=value ...", what differs from the profile
        ("effects", pa.bool_()),
        ("options", pa.string()),
        ("outcome", pa.string()),  # done, or why not
        ("machine", pa.string()),
        *(
            (name, pa.float64() if name in NUMBERS else pa.int64() if name in INTEGERS else pa.string())
            for name in COLUMNS
        ),
        ("series", pa.list_(pa.float64())),  # of some rows: all values, of which `value` is the number
    ]
)


class StoreError(Exception):
    """The store cannot be used; the message names the file and the remedy."""


@dataclass(frozen=True, slots=True)
class Done:
    """A finished cell: its rows, the series of some of them by metric, `outcome` "done" or why it failed."""

    cell: Cell
    rows: tuple[Row, ...]
    outcome: str = "done"
    series: Mapping[str, Sequence[float]] = field(default_factory=dict)
    machine: str = ""


class Store:
    """A folder of results; it may hold cells of several sweeps."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._parts = folder / "cells"

    @contextmanager
    def opened(self) -> Iterator[Store]:
        """Create or check the folder and hold it while cells are appended.

        Raises:
            StoreError: it is no store, or of another version, or not writable.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._check_version()
            self._parts.mkdir(exist_ok=True)
            with open(self.folder / "lock", "a") as lock:
                with contextlib.suppress(BlockingIOError):  # another process has the store open
                    if len(self._files()) > MOST_FILES:
                        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        self.merge()
                fcntl.flock(lock, fcntl.LOCK_SH)
                yield self
        except OSError as error:
            raise StoreError(f"{self.folder}: {error.strerror or error}; what is there is kept") from error

    def _check_version(self) -> None:
        path = self.folder / "store.json"
        if not path.exists():
            others = {entry.name for entry in self.folder.iterdir()} - {"cells", "lock", "output"}
            if others:
                raise StoreError(f"{self.folder}: is no store of a sweep (it holds {min(others)})")
            write_text(path, json.dumps({"format": FORMAT}))
        try:
            found = json_of(path)["format"]
        except (ValueError, KeyError, TypeError) as error:
            raise StoreError(f"{path}: not the description of a store; choose another folder") from error
        if found != FORMAT:
            raise StoreError(f"{self.folder}: store of version {found}, this program writes {FORMAT}")

    def _files(self) -> list[Path]:
        return sorted(self._parts.glob("*.parquet"))

    def merge(self) -> None:
        """Write all files as one; a cell that is in two, after an interrupted merge, counts once."""
        files = self._files()
        merged = self._table(files)
        self._write(merged)
        for path in files:
            path.unlink()

    def append(self, finished: Sequence[Done]) -> None:
        """Write a batch of finished cells as a new file."""
        if finished:
            self._write(pa.Table.from_pylist([row for one in finished for row in _records(one)], SCHEMA))

    def _write(self, table: pa.Table) -> None:
        path = self._parts / f"{time.time_ns():020d}-{os.getpid()}-{uuid.uuid4().hex[:8]}.parquet"
        write_beside(path, lambda part: pq.write_table(table, part, compression="zstd"))

    def finished(self) -> set[str]:
        """Hashes of all finished cells."""
        found = self._table(self._files(), ["cell"])
        return set(found.column("cell").unique().to_pylist())

    def table(self, *, series: bool = False) -> pd.DataFrame:
        """All rows, in the order in which they were measured; `series`: with the column of series."""
        names = [name for name in SCHEMA.names if series or name != "series"]
        found = self._table(self._files(), names).to_pandas()
        return found.fillna({name: "" for name in names if SCHEMA.field(name).type == pa.string()})

    def _table(self, files: list[Path], columns: list[str] | None = None) -> pa.Table:
        """Rows of all files; a cell that two files hold, after an interrupted merge, is taken from the first.

        Raises:
            StoreError: a file is incomplete; the message names it.
        """
        wanted = columns or SCHEMA.names
        tables, seen, names = [SCHEMA.empty_table()], set[str](), list(dict.fromkeys([*wanted, "cell"]))
        for path in files:
            try:
                table = pq.read_table(regular(path), columns=names, schema=SCHEMA)
                table.validate(full=True)  # texts are UTF-8
            except (pa.ArrowException, OSError) as error:
                reason = f"not a complete Parquet file ({str(error).partition(chr(10))[0][:80]})"
                raise StoreError(f"{path}: {reason}; move it away, and its cells are played again") from error
            cells = set(table.column("cell").unique().to_pylist())
            if cells & seen:
                new = pc.is_in(table.column("cell"), pa.array(sorted(cells - seen), pa.string()))
                table = table.filter(new)
            seen |= cells
            tables.append(table)
        return pa.concat_tables([table.select(wanted) for table in tables])


def _records(done: Done) -> Iterator[dict[str, object]]:
    cell = done.cell
    fixed = {
        "cell": hash_of(cell),
        "measure": cell.measure,
        "source": cell.source,
        "settings": " ".join(cell.changes),
        "effects": cell.effects,
        "options": " ".join(cell.options),
        "outcome": done.outcome,
        "machine": done.machine,
    }
    for row in done.rows:
        yield {**asdict(row), **fixed, "series": done.series.get(row.metric)}

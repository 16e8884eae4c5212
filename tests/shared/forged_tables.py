"""Tables of results that someone has forged, each in one way: their columns, their metadata, or the file."""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

TEXTS, NUMBERS = ("scenario", "metric", "verdict", "reason"), ("value", "limit", "dt")


def _column(name: str, values: Callable[[int], pa.Array]) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.set_column(table.column_names.index(name), name, values(len(table)))


TABLES: Mapping[str, Callable[[pa.Table], pa.Table]] = {
    "no rows and columns": lambda table: table.select([]),
    "one foreign column": lambda table: pa.table({"a": [1]}, metadata=table.schema.metadata),
    **{f"no {name}": lambda table, name=name: table.drop_columns([name]) for name in (*TEXTS, *NUMBERS)},
    **{f"{name}: texts": _column(name, lambda n: pa.array(["a"] * n)) for name in NUMBERS},
    **{f"{name}: lists": _column(name, lambda n: pa.array([[1.0]] * n)) for name in (*TEXTS, *NUMBERS)},
    **{f"{name}: numbers": _column(name, lambda n: pa.array([1.5] * n)) for name in TEXTS},
    **{f"{name}: bytes": _column(name, lambda n: pa.array([b"\xff"] * n)) for name in TEXTS},
    **{f"{name}: nothing": _column(name, lambda n: pa.nulls(n)) for name in (*TEXTS, *NUMBERS)},
    **{f"{name}: [/x] words": _column(name, lambda n: pa.array(["[/x] a"] * n)) for name in TEXTS},
    "value: infinite": _column("value", lambda n: pa.array([float("inf")] * n)),
    "value: huge": _column("value", lambda n: pa.array([1e308] * n)),
    "twice the same rows": lambda table: pa.concat_tables([table, table]),
    "a column twice": lambda table: table.append_column("value", table["value"]),
}
"""Way to forge the table of a file -> change of the table."""


def _middle(path: Path) -> None:
    data = bytearray(path.read_bytes())
    for place in range(4, len(data) // 2, 7):
        data[place] ^= 0x5A
    path.write_bytes(data)


def _replaced(path: Path, make: Callable[[Path], object]) -> None:
    path.unlink()
    make(path)


FILES: Mapping[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "random": lambda path: path.write_bytes(bytes(range(256)) * 9),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "damaged pages": _middle,
    "only the magic": lambda path: path.write_bytes(b"PAR1PAR1"),
    "FIFO": lambda path: _replaced(path, os.mkfifo),
    "folder": lambda path: _replaced(path, Path.mkdir),
    "link to itself": lambda path: _replaced(path, lambda one: one.symlink_to(one)),
}
"""Way to forge a file -> change of the file."""
WAYS = (*TABLES, *FILES)


def forge(path: Path, way: str) -> None:
    """Forge a Parquet file in one way."""
    if way in FILES:
        FILES[way](path)
    else:
        pq.write_table(TABLES[way](pq.read_table(path)), path)


JSONS = {
    "empty": "",
    "a list": "[1]",
    "a number": "1e999",
    "nothing": "null",
    "deep": "[" * 100_000,
    "not closed": '{"format": 1',
    "an empty object": "{}",
    "half a character": '{"format": 1, "run": "\\ud800", "sequence": 1, "reason": "x"}',
    "a long number": '{"format": 1, "run": "a", "sequence": ' + "9" * 5000 + "}",
    "wrong kinds": json.dumps({"format": 1, "run": ["a"], "sequence": "one", "settings": 3, "versions": 1}),
    "a date that is none": json.dumps({"format": 1, "run": "a", "sequence": 1, "started": "yesterday"}),
}
"""Texts in place of a JSON document."""

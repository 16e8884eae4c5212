"""Store of nights: one immutable Parquet file per night, queried by DuckDB without a database file.

    STORE/touchstone-store.json     marks the folder
    STORE/runs/SEQUENCE-RUN.parquet rows of a night; its identity is in the file's metadata
    STORE/accepted/SEQUENCE.json    accepted nights, with reasons; the last one counts
    STORE/set-aside/                files that were damaged, foreign or of a future version
    STORE/pages/RUN/                pages of a night

Files are written beside and renamed. A store at an fsspec URL is mirrored in a folder of this machine: files
are immutable, so only new ones are copied.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from touchstone.reports.results import COLUMNS, write_beside
from touchstone.scenarios.files.safe_paths import regular

FORMAT = 1
"""Version of the files."""
KEY = b"touchstone.night"
"""Key of the identity in a file's metadata."""
MARK = "touchstone-store.json"
STORED = tuple(name for name in COLUMNS if name not in ("seed", "repeat", "low", "high"))


class StoreError(Exception):
    """The store cannot be used; one line with the place and the remedy."""


@dataclass(frozen=True, slots=True)
class Night:
    """A stored night: its file and its identity."""

    path: Path
    identity: Mapping[str, Any]

    @property
    def run(self) -> str:
        """Name of the night."""
        return str(self.identity["run"])

    @property
    def sequence(self) -> int:
        """Order of nights, which no clock can change."""
        return int(self.identity["sequence"])


class Store:
    """Nights of one folder or URL. `notes` are lines about files that were set aside."""

    def __init__(self, place: str) -> None:
        self.place = place
        self.notes: list[str] = []
        self._remote: Any = None
        if "://" in place:
            self._remote, self._root = _filesystem(place)
            self.folder = cache_folder() / "mirrors" / hashlib.sha256(place.encode()).hexdigest()[:16]
        else:
            self.folder = Path(place)

    @contextmanager
    def opened(self) -> Iterator[Store]:
        """Create or check the store, and hold it against a second night.

        Raises:
            StoreError: the folder holds something else, is of a future version, or another night writes it.
        """
        self.prepare()
        with open(self.folder / ".lock", "a+", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                lock.seek(0)
                raise StoreError(
                    f"{self.place}: another night is being measured ({lock.read().strip()})"
                ) from None
            lock.truncate(0)
            lock.write(f"process {os.getpid()} since {datetime.now():%Y-%m-%d %H:%M:%S}")
            lock.flush()
            yield self

    def prepare(self) -> None:
        """Create the folder with its mark, or check the mark."""
        mark = self.folder / MARK
        if mark.exists():
            self.check()
        elif self.folder.exists() and any(path.name != ".lock" for path in self.folder.iterdir()):
            raise StoreError(f"{self.place}: holds other files and no {MARK}; name an empty folder")
        else:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_beside(mark, lambda part: part.write_text(json.dumps({"format": FORMAT}), "utf-8"))
        for name in ("runs", "accepted", "set-aside", "pages"):
            (self.folder / name).mkdir(exist_ok=True)
        self._pull()

    def check(self) -> None:
        """Raise StoreError if the store vanished or has another version."""
        try:
            found = json.loads(regular(self.folder / MARK).read_text("utf-8"))["format"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StoreError(
                f"{self.place}: {MARK} cannot be read; the store vanished or is damaged"
            ) from error
        if found != FORMAT:
            raise StoreError(f"{self.place}: version {found}, this program reads {FORMAT}")

    def nights(self) -> list[Night]:
        """Nights in order; files that are none are set aside with a note."""
        found = []
        for path in sorted((self.folder / "runs").glob("*")):
            if path.suffix == ".part":
                continue  # another process writes it, or was killed while it did
            reason = ""
            try:
                facts = json.loads((pq.read_schema(regular(path)).metadata or {})[KEY])
                if facts["format"] != FORMAT:
                    reason = f"version {facts['format']}, this program reads {FORMAT}"
                else:
                    int(facts["sequence"]), str(facts["run"])
            except KeyError:
                reason = "not a night of touchstone"
            except (OSError, ValueError, TypeError, pa.ArrowInvalid) as error:
                reason = f"damaged: {str(error).splitlines()[0][:80]}"
            if reason:
                self._set_aside(path, reason)
            else:
                found.append(Night(path, facts))
        return sorted(found, key=lambda night: night.sequence)

    def add(self, frame: pd.DataFrame, facts: dict[str, Any]) -> Night:
        """Store a night; its place in the order follows from the stored ones, not from the clock."""
        self.check()
        before = self.nights()
        facts = {**facts, "format": FORMAT, "sequence": before[-1].sequence + 1 if before else 1}
        rows = frame[(frame.verdict != "skipped") | (frame.metric == "run")][list(STORED)]
        schema = pa.Table.from_pandas(rows, preserve_index=False)
        stamped = schema.replace_schema_metadata(
            {**(schema.schema.metadata or {}), KEY: json.dumps(facts).encode()}
        )
        path = self.folder / "runs" / f"{facts['sequence']:06d}-{facts['run']}.parquet"
        write_beside(
            path, lambda part: pq.write_table(stamped, part, compression="zstd", compression_level=12)
        )
        self.push(path)
        return Night(path, facts)

    def query(self, nights: Sequence[Night], sql: str, values: Sequence[object] = ()) -> pd.DataFrame:
        """Run SQL over `nights` of the store: table `rows`, with the column `sequence`."""
        duckdb = query_library()
        if not nights:
            return pd.DataFrame()
        with duckdb.connect(":memory:") as database:
            database.execute("set threads = 2")
            files = [str(night.path) for night in nights]
            database.execute(
                "create view rows as select * exclude (filename), "
                "cast(regexp_extract(filename, '(\\d{6,})-[^/]*$', 1) as bigint) as sequence "
                f"from read_parquet({files!r}, filename = true, union_by_name = true)"
            )
            return database.execute(sql, list(values)).df()

    def accept(self, night: Night, reason: str) -> None:
        """Make a night the one that others are compared with."""
        record = {"run": night.run, "sequence": night.sequence, "reason": reason}
        record["when"] = datetime.now(UTC).isoformat(timespec="seconds")
        path = self.folder / "accepted" / f"{len(self._accepted()) + 1:06d}.json"
        write_beside(path, lambda part: part.write_text(json.dumps(record, indent=1), "utf-8"))
        self.push(path)

    def accepted(self) -> Mapping[str, Any] | None:
        """The record of the last accepted night."""
        return next(reversed(self._accepted()), None)

    def _accepted(self) -> list[dict[str, Any]]:
        found = []
        for path in sorted((self.folder / "accepted").glob("*.json")):
            try:
                found.append(json.loads(regular(path).read_text("utf-8")))
            except (OSError, ValueError) as error:
                self._set_aside(path, f"damaged: {error}")
        return found

    def _set_aside(self, path: Path, reason: str) -> None:
        target = self.folder / "set-aside" / path.name
        os.replace(path, target)
        self.notes.append(f"set aside {path.name}: {reason}")

    def push(self, path: Path) -> None:
        """Copy a file to the URL of the store: beside, then renamed."""
        if self._remote is None:
            return
        name = f"{self._root}/{path.relative_to(self.folder).as_posix()}"
        self._remote.makedirs(name.rpartition("/")[0], exist_ok=True)
        self._remote.put_file(str(path), f"{name}.part")
        self._remote.mv(f"{name}.part", name)

    def _pull(self) -> None:
        """Copy files of the URL that are not here yet, and files of this machine that are not there."""
        if self._remote is None:
            return
        there = set()
        for kind in ("runs", "accepted"):
            root = f"{self._root}/{kind}"
            for name in self._remote.ls(root, detail=False) if self._remote.exists(root) else []:
                path = self.folder / kind / name.rpartition("/")[2]
                there.add(path)
                aside = self.folder / "set-aside" / path.name
                if not path.exists() and not aside.exists() and path.suffix != ".part":
                    remote = name
                    write_beside(path, lambda part, remote=remote: self._remote.get_file(remote, str(part)))  # type: ignore[misc]
            for path in sorted((self.folder / kind).iterdir()):
                if path not in there and path.suffix != ".part":
                    self.push(path)


def cache_folder() -> Path:
    """Folder of nights that are not finished, of mirrors, and of environments of other versions."""
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(home) / "touchstone" / "nightly"


def _filesystem(place: str) -> tuple[Any, str]:
    try:
        import fsspec
    except ImportError as error:
        raise StoreError(f"{place}: a URL needs fsspec (pip install fsspec)") from error
    try:
        found, root = fsspec.core.url_to_fs(place)
    except (ImportError, ValueError) as error:
        raise StoreError(f"{place}: {str(error).splitlines()[0]}") from error
    return found, str(root).rstrip("/")


def query_library() -> Any:
    """DuckDB; raises StoreError where it is not installed."""
    try:
        import duckdb
    except ImportError as error:
        raise StoreError("nights are queried by duckdb (pip install duckdb)") from error
    return duckdb

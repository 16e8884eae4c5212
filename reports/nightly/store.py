"""Store of nights: one immutable Parquet file per night.

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
import platform
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import AwareDatetime, BaseModel, Field

from touchstone.adapters.registry import ENGINES
from touchstone.reports.machine import machine, origin, package_version
from touchstone.reports.results import COLUMNS, NUMBERS, write_beside, write_text
from touchstone.scenarios.files.safe_paths import fault_line, json_of, json_value, regular

FORMAT = 1
KEY = b"touchstone.night"
"""Key of the identity in a file's metadata."""
MARK = "touchstone-store.json"
STORED = tuple(c for c in COLUMNS if c not in ("seed", "repeat", "low", "high", "body_a", "body_b"))
TEXTS = tuple(name for name in STORED if name not in NUMBERS)
SCHEMA = pa.schema([(name, pa.string() if name in TEXTS else pa.float64()) for name in STORED])
NEEDED = ("study", "scenario", "engine", "profile", "metric", "subject", "value", "verdict")
"""Columns without which a night cannot be compared."""


class Acceptance(BaseModel):
    """What is read of the record of an accepted night."""

    run: str
    sequence: Annotated[int, Field(gt=0, lt=2**31)]


class Identity(Acceptance):
    """What is read of a night's identity."""

    started: AwareDatetime | None = None
    fingerprint: str = ""
    versions: dict[str, str] = {}
    machine: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    studies: dict[str, float] = {}


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
        if not place:
            raise StoreError("--store: name a folder, or a URL")
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
            StoreError: the folder cannot be made, holds something else, is of a future version, or another
                night writes it.
        """
        try:
            self.prepare()
        except OSError as error:
            raise StoreError(f"{self.place}: {error.strerror or error}") from error
        with open(self.folder / ".lock", "a+", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                lock.seek(0)
                reason = f"another night is being measured ({lock.read().strip()})"
                raise StoreError(f"{self.place}: {reason}") from None
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
            write_text(mark, json.dumps({"format": FORMAT}))
        for name in ("runs", "accepted", "set-aside", "pages"):
            (self.folder / name).mkdir(exist_ok=True)
        self._pull()

    def check(self) -> None:
        """Raise StoreError if the store vanished or has another version."""
        try:
            found = json_of(self.folder / MARK)["format"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            reason = f"{MARK} cannot be read; the store vanished or is damaged"
            raise StoreError(f"{self.place}: {reason}") from error
        if found != FORMAT:
            raise StoreError(f"{self.place}: version {found}, this program reads {FORMAT}")

    def nights(self) -> list[Night]:
        """Nights in order; files that are none are set aside with a note."""
        found = []
        for path in sorted((self.folder / "runs").glob("*")):
            if path.suffix == ".part":
                continue  # another process writes it, or was killed while it did
            try:
                facts = _checked_facts(path)
            except (OSError, ValueError, pa.ArrowException) as error:
                self._set_aside(path, error)
            else:
                found.append(Night(path, facts))
        return sorted(found, key=lambda night: night.sequence)

    def add(self, frame: pd.DataFrame, facts: dict[str, Any]) -> Night:
        """Store a night; its place in the order follows from the stored ones, not from the clock."""
        self.check()
        before = self.nights()
        facts = {**facts, "format": FORMAT, "sequence": before[-1].sequence + 1 if before else 1}
        rows = frame[(frame.verdict != "skipped") | (frame.metric == "run")][list(STORED)]
        table = pa.Table.from_pandas(rows, preserve_index=False)
        stamp = {**(table.schema.metadata or {}), KEY: json.dumps(facts).encode()}
        table, packing = (
            table.replace_schema_metadata(stamp),
            {"compression": "zstd", "compression_level": 12},
        )
        path = self.folder / "runs" / f"{facts['sequence']:06d}-{facts['run']}.parquet"
        write_beside(path, lambda part: pq.write_table(table, part, **packing))
        self.push(path)
        return Night(path, facts)

    def rows(self, nights: Sequence[Night], metric: str = "") -> pd.DataFrame:
        """Rows of nights of the store, of one metric or of all, with the column `sequence`."""
        chosen = [("metric", "==", metric)] if metric else None
        found = [SCHEMA.empty_table().to_pandas().assign(sequence=0)]
        for night in nights:
            rows = pq.read_table(night.path, schema=SCHEMA, filters=chosen).to_pandas()
            found.append(rows.fillna(dict.fromkeys(TEXTS, "")).assign(sequence=night.sequence))
        return pd.concat(found[1:] or found, ignore_index=True)

    def accept(self, night: Night, reason: str) -> None:
        """Make a night the one that others are compared with."""
        record = {"run": night.run, "sequence": night.sequence, "reason": reason}
        record["when"] = datetime.now(UTC).isoformat(timespec="seconds")
        number = max(self._accepted(), default=0) + 1
        path = self.folder / "accepted" / f"{number:06d}.json"
        write_text(path, json.dumps(record, indent=1))
        self.push(path)

    def accepted(self) -> Mapping[str, Any] | None:
        """The record of the last accepted night."""
        return next(reversed(self._accepted().values()), None)

    def _accepted(self) -> dict[int, dict[str, Any]]:
        """Records of accepted nights by their number, in order."""
        found = {}
        for path in sorted((self.folder / "accepted").glob("*.json")):
            try:
                record = json_of(path)
                Acceptance.model_validate(record)
                found[int(path.stem)] = record
            except (OSError, ValueError) as error:
                self._set_aside(path, error)
        return dict(sorted(found.items()))

    def _set_aside(self, path: Path, error: Exception) -> None:
        target = self.folder / "set-aside" / path.name
        os.replace(path, target)
        self.notes.append(f"set aside {path.name}: {fault_line(error)}")

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


def _checked_facts(path: Path) -> dict[str, Any]:
    """Identity of a night whose file is complete.

    Raises:
        OSError, ValueError, pyarrow.ArrowException: it is damaged, foreign or of another version.
    """
    schema = pq.read_schema(regular(path))
    if KEY not in (schema.metadata or {}):
        raise ValueError("not a night of touchstone")
    facts = json_value(schema.metadata[KEY])
    version = facts.get("format") if isinstance(facts, dict) else None
    if version != FORMAT:
        raise ValueError(f"version {version}, this program reads {FORMAT}")
    Identity.model_validate(facts)
    if missing := [name for name in NEEDED if name not in schema.names]:
        raise ValueError(f"no columns {', '.join(missing)}")
    pq.read_table(path, schema=SCHEMA).validate(full=True)  # damaged pages and texts
    return facts


LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "coal", "python-fcl", "pin", "pandas", "pyarrow")
HARDWARE = ("processor", "flags", "cores", "system", "memory")
"""Facts of which the fingerprint of the hardware consists: times are compared within one fingerprint."""


def identity(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Identity of a night that starts now; all values are JSON."""
    facts = origin()
    memory = f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"
    hardware = {**machine(), "flags": _flags(), "memory": memory}
    mine, started = {name: hardware[name] for name in HARDWARE}, datetime.now(UTC)
    others = {"python": hardware["python"], "kernel": platform.release(), "host": platform.node()}
    packages = {name: entry.distribution or entry.package for name, entry in ENGINES.items()}
    packages |= {name: name for name in LIBRARIES}
    return {
        "run": f"{started:%Y%m%dT%H%M%S}-{secrets.token_hex(3)}",
        "started": started.isoformat(timespec="seconds"),
        "commit": facts["commit"].rstrip("+"),
        "dirty": facts["commit"].endswith("+"),
        "versions": {name: package_version(package, "-") for name, package in packages.items()},
        "machine": mine | others,
        "fingerprint": hashlib.sha256(repr(sorted(mine.items())).encode()).hexdigest()[:12],
        "load": os.getloadavg()[0],
        "settings": dict(settings),
    }


def same_night(one: object, two: Mapping[str, Any]) -> bool:
    """Whether a night that ended early may be continued: the same program, versions, machine and settings."""
    parts = ("commit", "dirty", "versions", "fingerprint", "settings")
    return isinstance(one, Mapping) and all(one.get(name) == two.get(name) for name in parts)


def identity_changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """What changed from one night to another: engines and libraries, our code, the machine."""
    found = []
    old, new = before.get("versions", {}), after.get("versions", {})
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            found.append(f"{name} {old.get(name, '-')} -> {new.get(name, '-')}")
    if (before.get("commit"), before.get("dirty")) != (after.get("commit"), after.get("dirty")):
        texts = [f"{one.get('commit') or '?'}{'+' if one.get('dirty') else ''}" for one in (before, after)]
        found.append(f"our code {texts[0]} -> {texts[1]}")
    old, new = before.get("machine", {}), after.get("machine", {})
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            found.append(f"machine: {name} {_short(old.get(name))} -> {_short(new.get(name))}")
    return found


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def _flags() -> str:
    """Hash of the processor's flags."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            flags = next((line for line in file if line.startswith(("flags", "Features"))), "")
    except OSError:
        flags = ""
    return hashlib.sha256(" ".join(sorted(flags.split())).encode()).hexdigest()[:12]

"""The store of nights: immutable, in order, readable whatever happens to it."""

import errno
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from touchstone.reports.nightly import store as module
from touchstone.reports.nightly import verdict
from touchstone.reports.nightly.store import FORMAT, KEY, Store, StoreError
from touchstone.reports.nightly.verdict import history_charts


def test_nights_come_back_in_order(store, nights):
    """Rows, identity and order survive, also when the clock jumps back."""
    store.add(nights.frame(1e-4), nights.facts(5))
    store.add(nights.frame(2e-4), nights.facts(3))
    found = store.nights()
    assert [night.run for night in found] == ["night0005", "night0003"]
    assert [night.sequence for night in found] == [1, 2]
    rows = store.rows(found, verdict.SERIES)
    assert rows[["sequence", "value"]].values.tolist() == [[1, 1e-4], [2, 2e-4]]
    # what does not apply to an engine is not stored
    assert set(store.rows(found).verdict) == {"", "pass"}


def test_damaged_foreign_and_future_files_are_set_aside(store, nights):
    """Each is moved away by name with a note; the other nights are read."""
    store.add(nights.frame(), nights.facts(1))
    runs = store.folder / "runs"
    (runs / "000002-damaged.parquet").write_bytes((runs / "000001-night0001.parquet").read_bytes()[:200])
    pq.write_table(pa.table({"a": [1]}), runs / "000003-foreign.parquet")
    table = pa.table({"a": [1]}).replace_schema_metadata({KEY: json.dumps({"format": FORMAT + 1}).encode()})
    pq.write_table(table, runs / "000004-future.parquet")
    assert [night.run for night in store.nights()] == ["night0001"]
    reported = sorted(store.notes)
    assert [note.split(":")[0] for note in reported] == [
        f"set aside 00000{k}-{name}.parquet" for k, name in ((2, "damaged"), (3, "foreign"), (4, "future"))
    ]
    assert "not a night of touchstone" in reported[1]
    assert f"version {FORMAT + 1}, this program reads {FORMAT}" in reported[2]
    assert len(list((store.folder / "set-aside").iterdir())) == 3
    assert store.add(nights.frame(), nights.facts(2)).sequence == 2


def test_two_nightlies_at_once_are_told(store):
    """A second process is refused in one line that names the first."""
    reported = f"another night is being measured .process {os.getpid()} since"
    with pytest.raises(StoreError, match=reported), Store(store.place).opened():
        pass


def test_other_folders_and_versions_are_refused(tmp_path):
    """A folder with other files, a store of a future version and an unknown URL are one line each."""
    (tmp_path / "thesis.txt").write_text("kept")
    with pytest.raises(StoreError, match="holds other files"), Store(str(tmp_path)).opened():
        pass
    future = tmp_path / "future"
    future.mkdir()
    (future / module.MARK).write_text(json.dumps({"format": FORMAT + 1}))
    reported = f"version {FORMAT + 1}, this program reads {FORMAT}"
    with pytest.raises(StoreError, match=reported), Store(str(future)).opened():
        pass
    pytest.importorskip("fsspec")
    with pytest.raises(StoreError, match="nowhere://"):
        Store("nowhere://x")


def test_a_vanished_store_and_a_full_disk_lose_nothing(store, nights, monkeypatch):
    """A night that cannot be stored leaves no half file, and those before it stay."""
    store.add(nights.frame(), nights.facts(1))

    def full(table, part, **options):
        part.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(module.pq, "write_table", full)
        with pytest.raises(OSError, match="No space left"):
            store.add(nights.frame(), nights.facts(2))
    assert [path.name for path in (store.folder / "runs").iterdir()] == ["000001-night0001.parquet"]
    (store.folder / module.MARK).unlink()
    with pytest.raises(StoreError, match="vanished"):
        store.add(nights.frame(), nights.facts(2))


def test_a_url_is_a_store(tmp_path, monkeypatch, nights):
    """Nights go to an fsspec URL and come back on another machine; acceptance too."""
    fsspec = pytest.importorskip("fsspec")
    place = "memory://nights"
    for number, machine in ((1, "a"), (2, "b")):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / machine))
        with Store(place).opened() as opened:
            assert len(opened.nights()) == number - 1
            opened.accept(opened.add(nights.frame(), nights.facts(number)), f"good {number}")
            assert opened.accepted()["run"] == f"night000{number}"
    assert len(fsspec.filesystem("memory").ls("/nights/runs", detail=False)) == 2


WRITER = """
import sys
sys.path[:0] = [{tests!r}]
from conftest import facts, frame
from touchstone.reports.nightly.store import Store
with Store(sys.argv[1]).opened() as store:
    print("held", flush=True)
    for number in range(10_000):
        store.add(frame(), facts(number))
"""


@pytest.mark.slow
def test_killed_writers_leave_a_store_that_reads(tmp_path):
    """Kill -9 at 50 random moments: every night that is there can be read, in order, without a gap."""
    place, generator = tmp_path / "store", np.random.default_rng(3)
    program = WRITER.format(tests=os.path.dirname(__file__))
    for _ in range(50):
        writer = subprocess.Popen([sys.executable, "-c", program, str(place)], stdout=subprocess.PIPE)
        assert writer.stdout.readline() == b"held\n"
        time.sleep(generator.uniform(0, 0.2))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        store = Store(str(place))
        found = store.nights()
        assert store.notes == []
        assert [night.sequence for night in found] == list(range(1, len(found) + 1))
    assert len(store.rows(found)) == 2 * len(found)


@pytest.mark.slow
def test_a_year_of_nights_is_small_and_fast(store, nights):
    """365 nights of a gallery's size take under 50 MB; histories and charts of one scene under 10 s."""
    generator = np.random.default_rng(4)
    scenes = [f"scene_{k}" for k in range(16)]
    one = pd.concat([nights.frame(scene=scene) for scene in scenes for _ in range(60)], ignore_index=True)
    one["metric"] = [f"{metric}{k % 60 or ''}" for k, metric in enumerate(one.metric)]
    one.loc[one.metric.str.startswith("time"), "metric"] = verdict.SERIES
    for number in range(365):
        one["value"] = generator.random(len(one))
        store.add(one, nights.facts(number))
    size = sum(path.stat().st_size for path in (store.folder / "runs").iterdir())
    assert size < 50e6
    start = time.monotonic()
    found = store.nights()
    history = verdict.histories(store, found, "one")
    findings = verdict.timing(history, {night.sequence: night for night in found})
    drawn = history_charts(history, {night.sequence: night for night in found})
    assert time.monotonic() - start < 10
    assert len(drawn) == len(scenes)
    assert isinstance(findings, list)

"""Nights that nobody measured."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reports.nightly.store import Store
from touchstone.reports.results import Row, table


def facts(number, **other):
    """Identity of the night with a number."""
    started = datetime(2026, 1, 1, 2, tzinfo=UTC) + timedelta(days=number)
    found = {
        "run": f"night{number:04d}",
        "started": started.isoformat(),
        "commit": "abc",
        "dirty": False,
        "versions": {"mujoco": "4.0.0"},
        "machine": {"processor": "one"},
        "fingerprint": "one",
        "load": 0.1,
        "settings": {"quick": True},
    }
    return found | other


def frame(time=1e-4, overlap=1e-3, verdict="pass", scene="fall"):
    """Table of a night with one engine."""
    base = ("run", scene, "mujoco", "recommended", 1 / 540)
    rows = [
        Row(*base, "time.frame.median", time, "s"),
        Row(*base, "overlap.max", overlap, "m", limit=2e-3, verdict=verdict, reason="a reason"),
        Row(*base, "friction.cone", float("nan"), "1", verdict="skipped", reason="no contact"),
        Row(*base, "published.error", 0.0, "1", subject="0° speed"),
    ]
    return table(rows)


@pytest.fixture(scope="session")
def nights():
    """Builders of this file."""
    return SimpleNamespace(facts=facts, frame=frame, noise=noise)


@pytest.fixture
def store(tmp_path):
    """An empty store that is held."""
    with Store(str(tmp_path / "store")).opened() as opened:
        yield opened


def noise(generator, count):
    """Times over their truth: right-tailed by 5 %, with spikes of 10 to 100 % in 8 % of the nights."""
    tail = 1 + generator.gamma(2.0, 0.05 / np.sqrt(2), count)
    spikes = generator.random(count) < 0.08
    return tail * np.where(spikes, 1 + generator.uniform(0.1, 1.0, count), 1.0)

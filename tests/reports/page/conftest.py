"""A scene that two made-up engines play, and its page."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reports.metrics.context import Context
from touchstone.reports.page.html import Content
from touchstone.reports.page.page import pack_text, page
from touchstone.reports.page.playback import packed
from touchstone.reports.results import Row, table
from touchstone.reports.views.matrix import verdict_of

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
EVIL = "<img src=x onerror=alert(1)>"
"""A name that a page must show as text."""
SINKS = 0.012
"""Depth to which the ball of `dart` sinks into the ground [m]."""
DEEPEST = 20
"""Frame of that depth."""


def _path(frames, floor):
    """Heights of a ball of 5 cm that falls onto a floor and stays there."""
    fall = np.maximum(0.2 - 9.81 / 2 * (np.arange(frames) / 60) ** 2, 0.05)
    return fall - floor


@pytest.fixture(scope="session")
def made(lab, recordings):
    """Content of a page: two engines, of which `dart` sinks in at frame DEEPEST, and one row per verdict."""
    scenario = lab.scene(lab.ball(position=(0.0, 0.0, 0.2)), lab.ground())
    frames = scenario.frame_count + 1
    sunk = np.zeros(frames)
    sunk[DEEPEST] = SINKS
    played = {}
    for engine, profile, floor in (("reference", "balanced", 0.0), ("dart", "recommended", sunk)):
        places = np.tile([body.position for body in scenario.bodies], (frames, 1, 1))
        places[:, 0, 2] = _path(frames, floor)
        hit = recordings.contacts(
            *(
                {
                    "time": k / 60,
                    "body_b": 1,
                    "position": (0, 0, 0),
                    "normal": (0, 0, -1),
                    "impulse": (0, 0, -0.1),
                }
                for k in range(DEEPEST, DEEPEST + 5)
            )
        )
        recording = recordings.recording(scenario, position=places, contacts=hit)
        played[engine, profile] = Context(recording, scenario)
    rows = []
    for (engine, profile), depth in zip(played, (0.0, SINKS)):
        base = ("run", "test", engine, profile, 1 / 60)
        rows.append(
            Row(
                *base, "overlap.max", depth, "m", limit=1e-3, verdict="fail" if depth else "pass", reason=EVIL
            )
        )
        rows.append(Row(*base, "time.frame.median", 1e-4 * (1 + bool(depth)), "s"))
    others = [replace(row, scenario=f"test_{k}", verdict="") for k in (1, 2) for row in rows]
    rows += [replace(row, reason="") for row in others]  # a chart has three scenes
    record = packed(scenario, played)
    content = Content(
        EVIL,
        *verdict_of(table(rows)),
        table(rows),
        command=f"touchstone run {EVIL}",
        identity=[(EVIL, EVIL)],
        playback={"test": pack_text(record)},
        settings={"test/reference/balanced": {"version": "1", "dt": 1 / 60, "settings": {EVIL: EVIL}}},
        summaries={"test": EVIL},
    )
    return SimpleNamespace(
        content=content,
        record=record,
        text=page(content),
        played=played,
        evil=EVIL,
        sinks=SINKS,
        deepest=DEEPEST,
    )


@pytest.fixture(scope="session")
def chromium():
    """A headless Chromium without a network; skips where none is installed."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no chromium is installed (apt install chromium)")
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_api.sync_playwright() as program:
        browser = program.chromium.launch(executable_path=str(Path(CHROMIUM)), args=options)
        yield browser
        browser.close()

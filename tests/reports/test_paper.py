"""The study paper: rules on curves with known answers, and a short run that judges every claim."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.contract import AdapterError
from touchstone.reports.docs.reference import page_of
from touchstone.reports.progress import quietly
from touchstone.reports.studies import paper
from touchstone.reports.studies.paper import (
    CLAIM,
    CLAIMS,
    NOT_REPRODUCED,
    PAIRS,
    PASSES,
    REPRODUCED,
    Series,
    plateaus,
    report,
    run,
)

RATE, COUNT = 60, 480
FREE, HIGH = 4e-6, 8e-6
"""Frame times of free motion and of a plateau [s]."""
TOLD = {claim.name: claim for claim in CLAIMS}


def judge(name: str, **scenes: Series) -> bool:
    """Whether a claim holds on synthetic series."""
    claim = TOLD[name]
    return claim.holds(claim.rule(scenes))


def series(frame: np.ndarray, contact: np.ndarray, **counts: np.ndarray) -> Series:
    """A scene of 60 frames per second from its frame time and its frames in contact."""
    time = (1 + np.arange(len(frame))) / RATE
    counters = {PAIRS: contact.astype(float), "events": np.zeros(len(frame)), **counts}
    return Series(SimpleNamespace(frame_rate=RATE), None, time, frame, {"removal": frame}, counters)


def slide(shape: str) -> Series:
    """A free first half; two contacts whose frame times are of a `shape`; impacts of a ball at the end."""
    rng = np.random.default_rng(0)
    frame = FREE * (1 + 0.03 * rng.standard_normal(COUNT))
    contact, events = np.zeros(COUNT, dtype=bool), np.zeros(COUNT)
    for first, end in ((230, 300), (330, 390)):
        contact[first:end] = True
        if shape == "plateau":
            frame[first:end] += HIGH - FREE
        elif shape == "spike":
            frame[first:end] += 10 * FREE * np.exp(-np.arange(end - first) / 6)
    for hit in (430, 460):
        events[hit], frame[hit] = 1, 3 * HIGH
    return series(frame, contact, events=events)


def pushes(peaks: tuple[int, ...], first: int = 200, decay: float = 5.0) -> Series:
    """Contacts of 24 frames, 60 apart from `first` on, whose passes decay from `peaks` to a tenth."""
    passes, contact = np.zeros(360), np.zeros(360, dtype=bool)
    for k, peak in enumerate(peaks):
        where = slice(first + 60 * k, first + 60 * k + 24)
        passes[where] = peak * (0.1 + 0.9 * np.exp(-np.arange(24) / decay))
        contact[where] = True
    return series(FREE + 5e-7 * passes, contact, **{PASSES: passes})


@pytest.mark.parametrize(("shape", "two"), [("plateau", True), ("spike", False), ("none", False)])
def test_plateaus_are_told_from_spikes(shape: str, two: bool) -> None:
    """Two plateaus and the break between them are found in plateaus, not in spikes or a level curve."""
    scene = slide(shape)
    assert (plateaus(scene.frame, scene.contacts, RATE) == [(230, 300), (330, 390)]) == two
    assert judge("plateaus", table_slide=scene) == two
    assert judge("break", table_slide=scene) == two
    assert judge("ball spikes", table_slide=scene) == two
    assert judge("idle", table_slide=scene)


def test_contact_that_comes_early_or_drifts_is_not_idle() -> None:
    """Idle motion lasts nearly half of the scene, at one level."""
    early = slide("plateau")
    early.counts[PAIRS][100] = 1
    assert not judge("idle", table_slide=early)
    drifting = slide("plateau")
    drifting.frame[:115] *= 1.5
    assert not judge("idle", table_slide=drifting)


@pytest.mark.parametrize(
    ("scene", "three", "fall"),
    [
        (pushes((80, 80, 80)), True, True),
        (pushes((80, 60, 80)), True, True),
        (pushes((80, 80)), False, True),
        (pushes((80, 30, 80)), False, True),
        (pushes((80, 80, 80), first=60), False, True),
        (pushes((80, 80, 80), decay=1e6), True, False),
        (pushes(()), False, False),
    ],
)
def test_three_spikes_fall_off(scene: Series, three: bool, fall: bool) -> None:
    """Count spikes of half the peak in the second half, and require that each loses half of its height."""
    assert judge("three spikes", two_arms=scene) == three
    assert judge("fall off", two_arms=scene) == fall


def test_coherence_is_a_tendency() -> None:
    """Three of four first contacts must fall off."""
    falling, lasting = pushes((80,)), pushes((80,), decay=1e6)
    names = paper.PERSONS
    assert judge("coherence", **dict(zip(names, (falling, falling, falling, lasting))))
    assert not judge("coherence", **dict(zip(names, (falling, falling, lasting, lasting))))


def test_claims_are_complete() -> None:
    """Every claim has a name of its own, scenes of the study, a known basis, and a rule that says itself."""
    assert len(TOLD) == len(CLAIMS) == 20
    for claim in CLAIMS:
        assert set(claim.scenes) <= set(paper.SCENES)
        assert set(claim.basis.split(", ")) <= {"counts", "times", "poses"}
        assert claim.rule.__doc__


def test_a_run_judges_every_claim(shown, tmp_path) -> None:
    """Store a row per claim with its evidence, the picture and a page; show scenes and verdicts."""
    frame = run(1, tmp_path / "paper", quietly)
    names = {"results.parquet", "results.csv", "manifest.json", "paper.png", "paper.svg"}
    assert {path.name for path in (tmp_path / "paper").iterdir()} == names
    assert json.loads((tmp_path / "paper" / "manifest.json").read_text())["repeats"] == 1
    judged = frame[frame.metric == CLAIM]
    assert list(judged.subject) == list(TOLD)
    assert set(judged.reason_code) <= {REPRODUCED, NOT_REPRODUCED}
    assert (judged.reason != "").all()
    assert not judged[["value", "limit"]].isna().any().any()
    # what rests on counts and poses repeats
    sure = judged[judged.basis.isin(["counts", "poses"])].set_index("subject").reason_code
    for name in ("hand", "self-collision", "wall"):
        assert sure[name] == REPRODUCED
    text = shown(report(frame))
    assert all(scene in text for scene in paper.SCENES)
    assert "of 20 claims are reproduced" in text
    assert "…" not in text
    name, page, pictures = page_of(tmp_path / "paper")
    assert (name, list(pictures)) == ("paper.md", ["paper-paper.png"])
    assert "touchstone study paper" in page


class Broken:
    """Engine that builds no world."""

    def build(self, scenario, settings):
        raise AdapterError("reference: broken")


def test_scenes_that_fail_are_told(shown, tmp_path) -> None:
    """A scene that cannot be played is an error with its reason; claims that need it are skipped."""
    frame = run(1, tmp_path / "paper", quietly, Broken())
    assert set(frame[frame.metric == "run"].verdict) == {"error"}
    assert set(frame[frame.metric == CLAIM].verdict) == {"skipped"}
    assert "error: reference paper, effects=all table_slide: reference: broken" in shown(report(frame))


def test_the_command_prints_rows(touchstone, monkeypatch) -> None:
    """The registered command passes its options on, and prints the long table."""

    asked = []

    def fake(repeats, out, progress):
        asked.append((repeats, str(out)))
        return pd.DataFrame({"metric": ["paper.claim"], "verdict": [""]})

    monkeypatch.setattr(paper, "run", fake)
    code, out, _ = touchstone("study paper --repeats 3 --out here --format csv --quiet")
    assert (code, asked) == (0, [(3, "here")])
    assert out.splitlines() == ["metric,verdict", "paper.claim,"]

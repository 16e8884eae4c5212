"""A page's text: self-contained, escaped, within its policy; and what a run packs into it."""

import base64
import hashlib
import json
import re
import zlib
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from touchstone.reports.page.matrix import broken_part
from touchstone.reports.page.page import MOST_PLAYBACK, within_budget
from touchstone.reports.page.playback import INT16
from touchstone.reports.results import Row, table
from touchstone.reports.views.matrix import verdict_of


class Elements(HTMLParser):
    """Start tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def test_nothing_is_fetched(made):
    """No element loads anything: no address but data, no style attribute, no handler."""
    for tag, attributes in Elements(made.text).found:
        assert tag not in ("img", "iframe", "object", "embed", "base", "video", "audio")
        for name, value in attributes.items():
            assert name != "style", (tag, value)
            assert not name.startswith("on"), (tag, name)
            if name in ("href", "src", "xlink:href"):
                assert value.startswith(("#", "data:")), (tag, value)
    assert "@import" not in made.text
    assert len(made.text) < 5_000_000


def test_the_policy_names_what_is_there(made):
    """The policy forbids everything but this style and this script, by their hashes."""
    policy = next(a["content"] for t, a in Elements(made.text).found if a.get("http-equiv"))
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    for tag in ("style", "script"):
        content = re.search(rf"<{tag}>(.*?)</{tag}>", made.text, re.S)[1]
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_data_are_text(made):
    """Names with HTML in them are shown, never interpreted, in the page and in its JSON."""
    assert made.evil not in made.text
    assert made.text.count("&lt;img src=x onerror=alert(1)&gt;") >= 5
    cells = json.loads(re.search(r'id="cells">(.*?)</script>', made.text, re.S)[1])
    reasons = [value for cell in cells["cells"].values() for name, value in cell["facts"] if name == "reason"]
    assert set(reasons) == {made.evil}


def test_recordings_survive_packing(made):
    """Positions to half a step, orientations to half of 1/32767, depths and contacts, as the player reads."""
    record = made.record
    for packed, context in zip(record["engines"], made.played.values()):
        block = zlib.decompress(base64.b64decode(packed["data"]))
        f, m, n = packed["frames"], len(record["moving"]), len(record["bodies"])
        pose = np.frombuffer(block, "<i2", 7 * m * f).reshape(7, m, f).astype(int).cumsum(axis=2)
        places = pose[:3].transpose(2, 1, 0) * record["step"] + record["middle"]
        kept = context.recording.position[:, record["moving"]]
        assert np.abs(places - kept).max() <= 0.51 * record["step"]
        turned = pose[3:].transpose(2, 1, 0) / INT16
        assert np.abs(turned - context.recording.orientation[:, record["moving"]]).max() <= 0.51 / INT16
        at = 7 * m * f * 2 + n * f
        deepest = np.frombuffer(block, "<f4", f, at)
        assert packed["worst"] == int(np.argmax(deepest))
        counts = np.frombuffer(block, "<u2", f, at + 4 * f)
        assert counts.sum() == packed["contacts"] == 5
        # a contact of the step from frame k is shown at its end
        assert np.flatnonzero(counts).tolist() == list(range(made.deepest + 1, made.deepest + 6))
        assert len(block) == at + 6 * f + 14 * packed["contacts"]
    dart = record["engines"][1]
    assert (dart["worst"], dart["worst_depth"]) == (made.deepest, pytest.approx(made.sinks, rel=1e-6))
    assert dart["worst_at"][2] == pytest.approx(-made.sinks / 2, abs=1e-4)
    assert (record["apart_frame"], record["apart_body"]) == (made.deepest, "ball")
    assert record["apart"][made.deepest] == pytest.approx(made.sinks, rel=1e-2)


def test_bodies_are_coloured_from_a_millimetre(made):
    """The page says the depth, and the player gets its code."""
    assert made.record["alarm"] == 1 + 40 * 4
    assert "overlaps by 1 mm or more" in made.text


def test_a_page_stays_small():
    """Playback is left out for scenes beyond the budget, not for those before."""
    big = {f"scene_{k}": "x" * (MOST_PLAYBACK // 3 + 1) for k in range(4)}
    assert list(within_budget(big)) == ["scene_0", "scene_1"]


@pytest.mark.parametrize(
    ("verdicts", "level", "start"),
    [
        (["pass", "pass", "known"], "good", "All 2 limits met (1 known failing)."),
        (["pass", "fail", "error"], "bad", "1 limit broken and 1 run failed: dart 2; 1 limit met."),
        (["", "skipped"], "warn", "Nothing was judged."),
        (["pass", "unjudged"], "warn", "All 1 limits met (1 not judged)."),
    ],
)
def test_the_sentence_is_never_green_unseen(verdicts, level, start):
    """A run is good only where limits were judged and all of them met."""
    rows = [Row("run", "s", "dart", "p", 0.1, "overlap.max", verdict=verdict) for verdict in verdicts]
    assert verdict_of(table(rows)) == (level, start)


def test_a_slow_reference_is_listed_among_the_failings():
    """Show a broken limit of a ratio of times, which is no metric of a recording."""
    row = Row("run", "ball_snip", "reference", "balanced", 1 / 60, "ratio.time.p99", 3.0, "1")
    text = broken_part([replace(row, limit=0.3, verdict="fail", reason="slower than before")], ())
    assert "99th percentile of frame times" in text
    assert "<td>3.00</td><td>0.300</td>" in text


def test_studies_are_shown_as_text(made):
    """Hard cases as a table of classes with what each means; of other studies, counts and what is broken."""
    from touchstone.reports.page.sections import studies_part

    hard = ("stability", "hard_mass_1e6", "mujoco", "recommended", 1 / 540, "stability.outcome")
    other = ("relations", "fall", "dart", "recommended", 1 / 1020, "relations.turned")
    rows = [
        Row(*hard, 5.0, verdict="", reason="exploded: 3 m/s"),
        Row(*other, 0.5, verdict="fail", reason=made.evil),
        Row(*other, 0.1, verdict="pass", subject="b"),
    ]
    text = studies_part(table(rows))
    assert "0 of 1 hard cases survived" in text
    assert "exploded: more energy or speed than the scene has" in text
    assert "auto-reset" not in text
    assert "2 figures; 1 fail, 1 pass." in text
    assert made.evil not in text
    assert "&lt;img" in text

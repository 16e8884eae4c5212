"""A page's text: self-contained, escaped, within its policy; links lead somewhere; forces over time."""

import base64
import hashlib
import json
import re
import zlib
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reports.metrics.motion.time_series import FORCE, Course
from touchstone.reports.page import charts as forces
from touchstone.reports.page import page as module
from touchstone.reports.page.charts import force_chart, force_charts
from touchstone.reports.page.html import Change
from touchstone.reports.page.page import MOST_PLAYBACK, broken_part, page, studies_part, within_budget
from touchstone.reports.page.playback import INT16
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.views.comparison import FORCE_PICTURE, draw_forces, force_panels
from touchstone.reports.views.markdown import report
from touchstone.reports.views.matrix import verdict_of
from touchstone.scenarios.catalogue import catalogue


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


SCENES = 40


def links(text):
    """Addresses of links."""
    return [
        attributes["href"]
        for tag, attributes in Elements(text).found
        if tag != "link" and "href" in attributes
    ]


def dead_links(text, folder):
    """Links whose target is neither on the page nor beside it."""
    ids = [attributes["id"] for _, attributes in Elements(text).found if "id" in attributes]
    assert len(set(ids)) == len(ids)
    return [
        link
        for link in links(text)
        if not (link[1:] in ids if link.startswith("#") else (Path(folder) / link).exists())
    ]


@pytest.fixture(scope="module")
def many(made):
    """Content of a page with SCENES scenes, of which the last breaks two limits of its own metrics."""
    rows = []
    for k in range(SCENES):
        for engine, profile in (("reference", "balanced"), ("dart", "recommended")):
            base = ("run", f"scene_{k}", engine, profile, 1 / 60)
            rows.append(Row(*base, "overlap.max", 1e-4, "m", limit=1e-3, verdict="pass"))
            rows.append(Row(*base, "time.frame.median", 1e-4, "s"))
    last = ("run", f"scene_{SCENES - 1}", "reference", "balanced", 1 / 60)
    rows.append(Row(*last, "ratio.time", 0.45, "1", limit=0.15, verdict="fail", reason="slow"))
    rows.append(Row(*last, "rest.drift", 2e-2, "m", limit=1e-3, verdict="fail", reason="it moves"))
    changes = [
        Change("regression", "scene_3", "dart p", "overlap.max", "a-b", "0.100 → 3.00 mm", "pass → fail"),
        Change("regression", "gone_scene", "dart p", "overlap.max", "", "", "no longer measured"),
        Change("change", "scene_4", "dart p", "overlap.max", "", "1.00 → 1.10 mm", ""),
    ]
    return replace(made.content, frame=table(rows), changes=changes, playback={})


def test_no_link_is_dead(many, made, tmp_path):
    """Every link has its target; every scene shown has one, whose fold names its command."""
    text = page(many)
    found = links(text)
    assert len([link for link in found if link.startswith("#scene-")]) >= SCENES + 2
    assert dead_links(text, tmp_path) == []
    assert dead_links(made.text, tmp_path) == []
    assert "#scene-gone_scene" not in found
    for k in range(SCENES):
        assert f"<code>touchstone run scene_{k}</code>" in text


def test_scenes_beyond_the_budget_keep_their_target(many, monkeypatch):
    """Of scenes whose tables do not fit, the figures that miss a limit stay."""
    monkeypatch.setattr(module, "MOST_TABLES", 5000)
    text = page(many)
    assert dead_links(text, ".") == []
    parts = re.split(r'<details id="scene-', text)[1:]
    assert len(parts) == SCENES
    assert "median frame time" in parts[0]
    assert "Figures that miss a limit" in parts[-1]
    assert "drift at rest" in parts[-1]
    assert "median frame time" not in parts[-1]


def test_broken_limits_come_before_the_matrix(many):
    """They are open, the worst first, in units of readers, with the scene as a link."""
    text = page(many)
    part = text[text.index('<details id="broken" open>') : text.index('<table class="matrix">')]
    assert "2 broken limits" in part
    assert part.index("drift at rest") < part.index("mean frame time")
    assert "<td>20.0\xa0mm</td><td>1.00\xa0mm</td>" in part
    assert f'<a href="#scene-scene_{SCENES - 1}">' in part


def test_changes_are_a_table_of_readable_figures(many):
    """Names for readers, before and after with their unit, the scene as a link; only regressions are open."""
    text = page(many)
    part = text[text.index('<div class="changes">') : text.index("</header>")]
    assert '<details id="changes-regression" open><summary><h3>2 regressions</h3>' in part
    assert '<details id="changes-change"><summary><h3>1 change</h3>' in part
    assert '<a href="#scene-scene_3">scene_3</a>' in part
    assert ">deepest overlap a-b</span>" in part
    assert "<td>0.100 → 3.00 mm</td>" in part


def test_long_tables_are_folded(many):
    """Beyond the first lines a table is folded, and none is without an end."""
    base = many.changes[0]
    text = page(replace(many, changes=[replace(base, subject=f"s{k}") for k in range(300)]))
    part = text[text.index('<div class="changes">') : text.index("</header>")]
    assert "<h3>192 more</h3>" in part
    assert "100 more are stored" in part


@pytest.mark.parametrize(("scenes", "drawn"), [(2, False), (3, True)])
def test_a_chart_has_enough_points(many, scenes, drawn):
    """Of two scenes the matrix says it all."""
    kept = many.frame[many.frame.scenario.isin([f"scene_{k}" for k in range(scenes)])]
    assert ('<figure class="chart">' in page(replace(many, frame=kept))) == drawn


TIME = np.arange(121) / 60
COLUMNS = (("reference", "balanced"), ("mujoco", "recommended"))


def courses(*pairs: str) -> dict[tuple[str, str], Course]:
    """Forces of pairs, the later the larger: nothing for a second, then a load; twice as much on `mujoco`."""
    load = np.where(TIME > 1, 10.0, 0.0)
    load[0] = np.nan
    return {
        column: Course(TIME, {(FORCE, pair): (i + 1) * (k + 1) * load for k, pair in enumerate(pairs)})
        for i, column in enumerate(COLUMNS)
    }


def test_a_chart_has_the_heaviest_pairs_and_the_truth() -> None:
    """A panel per pair, a line per engine, a dashed rule per window; heaps and scenes without have none."""
    scene = catalogue()["platform_lift"]
    svg = force_chart(scene, courses("a", "b", "c", "platform-load"))
    assert [f">{pair}<" in svg for pair in ("a", "b", "c", "platform-load")] == [False, True, True, True]
    assert svg.count("stroke-dasharray") == len(scene.forces)
    assert svg.count("var(--engine-mujoco)") >= 3
    assert force_chart(scene, courses()) == ""
    assert force_chart(replace(scene, tags=("heap",)), courses("a")) == ""
    assert force_chart(replace(scene, forces=()), courses("platform-load")).count("stroke-dasharray") == 0


def test_a_page_has_charts_within_its_budget(made, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first scenes that fit have a chart, in the part of their scene."""
    scenes = {name: (catalogue()[name], courses("a")) for name in ("stack", "slide", "fall")}
    found = force_charts(scenes)
    assert list(found) == list(scenes)
    monkeypatch.setattr(forces, "MOST_CHARACTERS", len(found["stack"]) + len(found["slide"]))
    assert list(force_charts(scenes)) == ["stack", "slide"]
    scene = made.content.frame.scenario[0]
    text = page(replace(made.content, forces={scene: found["stack"]}))
    assert found["stack"] in text[text.index(f'id="scene-{scene}"') :]


def test_the_report_has_a_table_and_a_picture(tmp_path) -> None:
    """Pairs with their figures on every engine; of many scenes, the gallery and those with a truth."""
    names = ("platform_lift", "slide")
    figures = (("mean", "N", 9.81), ("peak", "N", 12.8), ("impulse", "N s", 19.6))
    rows = [
        Row("run", name, *COLUMNS[0], 1 / 60, f"force.contact.{figure}", value, unit, subject="platform-load")
        for name in names
        for figure, unit, value in figures
    ]
    rows.append(Row("run", names[0], *COLUMNS[1], 1 / 540, "overlap.max", 0.0, "m"))
    results = Results(table(rows))
    request = Request(tuple(catalogue()[name] for name in names), COLUMNS, tmp_path)
    for name in names:
        for column, course in courses("platform-load").items():
            results.courses[name, *column] = course
    assert [panel.scenario.name for panel in force_panels(request, results)] == list(names)
    draw_forces(request, results, tmp_path)
    assert (tmp_path / FORCE_PICTURE).read_bytes().startswith(b"\x89PNG")
    text = report(request, results)
    assert "| platform_lift | platform-load | 9.81, 12.8, 19.6 | - |" in text
    assert f"]({FORCE_PICTURE})" in text
    many = replace(
        request, scenarios=(*request.scenarios, *(catalogue()[f"bounce_e0{k}"] for k in "358")) * 2
    )
    assert {panel.scenario.name for panel in force_panels(many, results)} == {"platform_lift"}
    nothing = SimpleNamespace(frame=results.frame, courses={}, recordings={})
    draw_forces(request, nothing, tmp_path / "none")
    assert not (tmp_path / "none").exists()

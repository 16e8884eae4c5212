"""Links of a page lead somewhere; what changed and what is broken is on the first screen, worst first."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from touchstone.reports.page import sections
from touchstone.reports.page.html import Change
from touchstone.reports.page.page import page
from touchstone.reports.results import Row, table

SCENES = 40


class Links(HTMLParser):
    """Names of elements, and addresses of links."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        if "id" in attributes:
            self.ids.append(attributes["id"])
        if tag != "link" and "href" in attributes:
            self.links.append(attributes["href"])


def dead_links(text, folder):
    """Links whose target is neither on the page nor beside it."""
    found = Links(text)
    assert len(set(found.ids)) == len(found.ids)
    return [
        link
        for link in found.links
        if not (link[1:] in found.ids if link.startswith("#") else (Path(folder) / link).exists())
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
    links = Links(text).links
    assert len([link for link in links if link.startswith("#scene-")]) >= SCENES + 2
    assert dead_links(text, tmp_path) == []
    assert dead_links(made.text, tmp_path) == []
    assert "#scene-gone_scene" not in links
    for k in range(SCENES):
        assert f"<code>touchstone run scene_{k}</code>" in text


def test_scenes_beyond_the_budget_keep_their_target(many, monkeypatch):
    """Of scenes whose tables do not fit, the figures that miss a limit stay."""
    monkeypatch.setattr(sections, "MOST_TABLES", 5000)
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
    pytest.importorskip("altair")
    kept = many.frame[many.frame.scenario.isin([f"scene_{k}" for k in range(scenes)])]
    assert ('<figure class="chart">' in page(replace(many, frame=kept))) == drawn

"""Page of the engines: what each can represent, its profiles, and the causes of its known failings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from touchstone.adapters.conformance.abilities import ABILITIES
from touchstone.adapters.engines.entry import DEFAULT, Entry
from touchstone.adapters.registry import DEFAULT_ENGINES, OPTIONAL_ENGINES, entry_of_ours, settings_of
from touchstone.reports.docs.reference import NOTICE, table_text
from touchstone.reports.runner.request import step_text
from touchstone.reports.verdict.failings import causes, known
from touchstone.scenarios.catalogue import tagged

MOST, FEWEST = 3, 3
"""Number of causes of failings that are shown, and of probes of a tag that is."""
DAY = "2026-11-28"
"""Day of the versions, and of the known failings of engines in environments of their own."""
PROBED = (*DEFAULT_ENGINES, "drake", "newton", "physx", "rapier")
"""Engines whose known failings are those of all probes."""
CONSTRAINTS = Path("constraints.txt")
"""Versions that `make` installs, in a checkout."""


def engines_page(checkout: Path) -> str:
    """The page, from the entries of the engines and the known failings."""
    entries = {name: entry_of_ours(name) for name in (*DEFAULT_ENGINES, *OPTIONAL_ENGINES)}
    pinned = dict(
        line.split("==")[:2]
        for line in (checkout / CONSTRAINTS).read_text("utf-8").splitlines()
        if "==" in line and not line.startswith("#")
    )
    abilities = [
        {
            "ability": ability,
            **{name: "-" if ability in one.lacks else "yes" for name, one in entries.items()},
        }
        for ability in ABILITIES
    ]
    profiles = [
        {
            "engine": name,
            "version": _version(name, one, pinned),
            "profiles and steps [s]": ", ".join(
                f"`{profile}` {step_text(dt)}" for profile, dt in one.profiles.items()
            ),
            "the first differs from `default` in": ", ".join(_changed(name, one)) or "-",
            "rounding": one.rounding or "-",
        }
        for name, one in entries.items()
    ]
    parts = [
        NOTICE,
        "# Engines",
        "All have spheres, boxes and Coulomb's law of friction. What an engine lacks is refused with "
        "the reason; a test builds a scene for each ability. An optional engine with an environment of its "
        "own is added by `touchstone env add` ([environments.md](environments.md)).",
        "## What each can represent",
        table_text(abilities),
        "## Profiles",
        f"Versions are those that `make` installs, or that an engine's own environment pins, on {DAY}.",
        table_text(profiles),
        "Newton's Featherstone and semi-implicit solvers have no profile: neither has the observable "
        "`CONTACT_F`, the force of each contact, and the kernel that evaluates it adds up forces per body.",
        "## Where each fails",
        "Known failings of the first profile in the probes, the tags of scenes (CONTRIBUTING.md) in which it "
        f"does best and worst, and the {MOST} causes that show in the most probes; "
        "`reports/verdict/causes.toml` has each with its mechanism. Where none is known, a probe meets all "
        "its limits, or is refused. Only these engines have been judged on all probes.",
        table_text([row for name in PROBED for row in _failing_rows(name, entries[name])]),
    ]
    return "\n\n".join(parts) + "\n"


def _version(name: str, entry: Entry, pinned: dict[str, str]) -> str:
    wanted = entry.distribution or entry.package
    own = dict(pin.split("==") for pin in entry.pins)
    return own.get(wanted) or pinned.get(wanted) or ("of this program" if name == DEFAULT_ENGINES[0] else "-")


def _changed(name: str, entry: Entry) -> Iterator[str]:
    """Settings of the first profile that differ from those of `default`."""
    if DEFAULT not in entry.profiles or not entry.settings:
        return
    table = settings_of(name)
    first, plain = table.column(next(iter(entry.profiles))), table.column(DEFAULT)
    for key, setting in table.items():
        values = setting.profiles[first], setting.profiles[plain]
        if values[0] != values[1]:
            yield f"`{key}` {values[0] or 'by scene'} for {values[1] or 'by scene'}"


def _failing_rows(name: str, entry: Entry) -> Iterator[dict[str, object]]:
    probes = {scene.name: set(scene.tags) for scene in tagged("probe")}
    first = next(iter(entry.profiles))
    found: dict[str, set[str]] = {}
    for one in known().values():
        if one.engine == name and one.profile == first and one.scenario in probes:
            found.setdefault(one.cause, set()).add(one.scenario)
    failing = set().union(*found.values()) if found else set()
    counts = Counter(tag for tags in probes.values() for tag in tags - {"probe"})
    shares = {tag: sum(tag in probes[one] for one in failing) / n for tag, n in counts.items() if n >= FEWEST}
    best = min(shares, key=lambda tag: (shares[tag], -counts[tag], tag))
    worst = max(shares, key=lambda tag: (shares[tag], counts[tag], tag))
    ranked = sorted(found, key=lambda cause: (-len(found[cause]), cause))[:MOST]
    yield {
        "engine": name,
        "probes with a known failing": f"{len(failing)} of {len(probes)}",
        "least of a tag": f"`{best}`: {round(shares[best] * counts[best])} of {counts[best]}",
        "most of a tag": f"`{worst}`: {round(shares[worst] * counts[worst])} of {counts[worst]}",
        "causes in the most scenes": "<br>".join(
            f"{len(found[cause])}: {' '.join(causes()[cause].split()).partition(':')[0]}" for cause in ranked
        ),
    }

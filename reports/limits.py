"""Limits as data: what a metric may be, where, and why. Known failings are listed here too, and strict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isnan

from adapters.registry import ENGINES
from reports.results import Row


@dataclass(frozen=True, slots=True)
class Limit:
    """Largest allowed size [SI unit of the metric] of a metric, for an engine, scenario or tag, profile and
    subject ("" = every one). The most specific row wins; among equals the last."""

    metric: str
    largest: float
    reason: str
    engine: str = ""
    scenario: str = ""
    profile: str = ""
    subject: str = ""


@dataclass(frozen=True, slots=True)
class Known:
    """A documented failing of an engine. Strict: where the limit is met after all, the row fails."""

    metric: str
    engine: str
    reason: str
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    never: bool = False  # the failing is that an event never happens


LIMITS: tuple[Limit, ...] = (
    Limit("overlap.max", 1e-3, "a twentieth of the ball's radius: what a viewer does not see"),
    Limit("overlap.max", 1e-6, "method, section 3: removal ends at 1e-6 m", engine="reference"),
    Limit("overlap.tunnelled", 0, "nothing passes through a fixed body"),
    Limit("contact.gap", 1e-4, "a body at rest neither hovers nor sinks visibly"),
    Limit("contact.gap", 1e-6, "contacts are found within 1e-6 m", engine="reference"),
    Limit("contact.impulse_balance", 0.01, "above 1 % the engine's impulses are not believed"),
    Limit("restitution.error", 0.05, "a sixth of the coefficient asked for"),
    Limit(
        "restitution.error", 0.005, "0.1 mm of touch gap over the arcs of a 1 m/s bounce", engine="reference"
    ),
    Limit(
        "restitution.bias.max", 2e-4, "1e-6 m of touch gap over a hop of 5 mm, at 0.3 m/s", engine="reference"
    ),
    Limit(
        "restitution.bias.max",
        0.05,
        "semi-implicit flight: g h a step, at 1 m/s",
        engine="reference",
        profile="paper",
    ),
    Limit("friction.bias.max", 1e-3, "a patch that lands with one more point in a frame", engine="reference"),
    Limit("friction.cone", 1e-6, "Coulomb's inequality, to a solver's tolerance"),
    Limit("friction.cone", 1e-12, "Coulomb's inequality, to rounding", engine="reference"),
    Limit("friction.deficit", 0.05, "sliding friction within 5 % of mu", subject="table-ball"),
    Limit("friction.deficit", 1e-9, "Coulomb's law, to rounding", engine="reference"),
    Limit("friction.direction", 0.02, "about one degree", subject="table-ball"),
    Limit("energy.injected", 1e-4, "0.1 % of the energy with which the ball lands"),
    Limit("energy.injected", 1e-9, "nothing but rounding", engine="reference"),
    Limit("ik.missed", 0.02, "goals of a chain, from within 0.1 rad", "reference", "arm, near"),
    Limit("ik.missed", 0.005, "and from the hanging arm with restarts", "reference", profile="accurate"),
    Limit(
        "ratio.time", 0.1, "over a damped least-squares loop in Python", "reference", "arm, near", "balanced"
    ),
    Limit(
        "ratio.time", 0.1, "over a damped least-squares loop in Python", "reference", "arm, rest", "balanced"
    ),
    Limit("events.touch.spread", 1 / 60, "one frame: all engines follow the same glove"),
    Limit("events.roll.spread", 2 / 60, "two frames: sliding ends at 2/7 v0 / (mu g), v0 within 20 %"),
    Limit("events.leave.spread", 0.1, "a servo gives way and a posed finger does not: v0 differs by 15 %"),
    Limit("events.land.spread", 0.1, "the same, the fall itself takes equally long"),
    Limit("events.land.place.spread", 0.05, "0.4 s of fall at velocities that differ by 15 %"),
    Limit(
        "ratio.time",
        0.3,
        "three exact depths in the time of one: nobody need do with less",
        engine="reference.exact",
        scenario="hulls overlapping",
        subject="coal",
    ),
    Limit("certificate.open", 0.01, "99 of 100 answers are vouched for", scenario="hand sliding"),
    Limit("certificate.false", 0, "an answer that is vouched for is right", scenario="hand sliding"),
    Limit("scaling.exponent", 1.1, "work linear in the pieces, and a cache to spare", scenario="broad phase"),
)
LANDING = "touchstone run ball_snip --engine {} --metric overlap.max"
DISCRETE = (
    "the ball meets the floor at 3.8 m/s, 16 mm a native step, and contact is found only once it overlaps: "
    + LANDING
)
SINKS = (
    "a body at rest sinks by about g h^2 = 0.17 mm before contact is found: "
    "touchstone run ball_snip --engine dart --profile equal-step --metric contact.gap"
)
COMPLIANT = "contact is a damped spring with a time constant of 20 ms, into which 3.8 m/s sink: " + LANDING
BOXED = (
    "the boxed LCP bounds friction by normal impulses found without it, as when the finger lifts the ball "
    "off the table: touchstone run ball_snip --engine dart --metric friction.cone"
)
LETS_GO = (
    "a damped spring that may not pull lets go while compressed: 0.397 for 0.3 in closed form (Schwager and "
    "Poeschel 2007): touchstone run ball_snip --engine mujoco --metric restitution.error"
)
ALWAYS_MU = (
    "Eq. 10 as printed applies mu j to any sliding, however slow: a rolling ball is reversed every frame: "
    "touchstone run ball_snip --engine reference --profile paper --metric events.roll"
)
KNOWN: tuple[Known, ...] = (
    Known("events.roll", "reference", ALWAYS_MU, profile="paper", never=True),
    Known("energy.injected", "reference", ALWAYS_MU, profile="paper"),
    Known("overlap.max", "bullet", DISCRETE.format("bullet"), scenario="ball_snip"),
    Known("overlap.max", "dart", DISCRETE.format("dart"), scenario="ball_snip", profile="equal-step"),
    Known("contact.gap", "dart", SINKS, scenario="ball_snip", profile="equal-step"),
    *(
        known
        # the tuned profiles mend these
        for profile in ("recommended", "equal-step")
        for known in (
            Known("overlap.max", "mujoco", COMPLIANT.format("mujoco"), "ball_snip", profile),
            Known("friction.cone", "dart", BOXED, "ball_snip", profile),
            Known("friction.deficit", "dart", BOXED, "ball_snip", profile, "table-ball"),
        )
    ),
    Known("restitution.error", "mujoco", LETS_GO, scenario="ball_snip"),
)


def judged(row: Row, tags: tuple[str, ...]) -> Row:
    """The row with its limit and verdict. One that passed or failed already (an expected event) is looked up
    among the known failings alone; skipped rows and errors stay as they are."""
    if row.verdict not in ("", "pass", "fail"):
        return row
    reason, largest, met = row.reason, row.limit, row.verdict == "pass"
    if not row.verdict:
        candidates = [limit for limit in LIMITS if limit.metric == row.metric and _covers(limit, row, tags)]
        if not candidates:
            return row
        limit = max(reversed(candidates), key=_specificity)
        reason, largest, met = limit.reason, limit.largest, abs(row.value) <= limit.largest
    known = next((k for k in KNOWN if k.metric == row.metric and _covers(k, row, tags)), None)
    verdict = "pass" if met else "fail"
    if known is not None and not met and (known.never or not isnan(row.value)):
        verdict, reason = "known", known.reason
    elif known is not None and met and _at_own_step(row):
        verdict, reason = "fail", f"a known failing is gone: take it out of limits.py ({known.reason})"
    remark = f"{row.reason}; {reason}" if row.reason and row.reason != reason else reason
    return replace(row, limit=largest, verdict=verdict, reason=remark)


def _at_own_step(row: Row) -> bool:
    """Whether the row was measured at its profile's own step: a known failing may be gone at another."""
    entry = ENGINES.get(row.engine)
    return entry is None or abs(entry.profiles.get(row.profile, row.dt) - row.dt) < 1e-9 * row.dt


def _specificity(limit: Limit) -> int:
    return sum(map(bool, (limit.engine, limit.scenario, limit.profile, limit.subject)))


def _covers(entry: Limit | Known, row: Row, tags: tuple[str, ...]) -> bool:
    return (
        entry.engine in ("", row.engine)
        and entry.scenario in ("", row.scenario, *tags)
        and entry.profile in ("", row.profile)
        and entry.subject in ("", row.subject)
    )

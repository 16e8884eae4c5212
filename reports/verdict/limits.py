"""Table of limits: the largest allowed value of a metric, where, and why. `failings.csv` has the
exceptions.

Limits that scenes bring along or a file gives, beside our own.

A scene without one of the catalogue's tags is foreign: our limits and known failings say nothing of it. A
limit of its own, or of a file, replaces ours in the rows that it covers.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated

from touchstone.adapters.registry import ENGINES
from touchstone.reports.bootstrap import RATIOS
from touchstone.reports.metrics import HORIZON, METRICS, SPREAD
from touchstone.reports.metrics.contacts.contact import DRIVEN_AUDIT_LIMIT
from touchstone.reports.results import Row
from touchstone.scenarios.catalogue import tags
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.files.read import SceneFileError, data_of_file, placed
from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Limit:
    """Largest allowed absolute value [SI unit] of a metric (inf: any), for an engine, scenario or tag,
    profile and subject ("" = every one). The most specific limit wins; among equals the last.
    `by_construction`: the method meets it whatever it simulates, so meeting it says little."""

    metric: str
    largest: float
    reason: str
    engine: str = ""
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    by_construction: bool = False


CCD = "ccd as printed"
"""The algorithm of the study `ik` whose time has a limit."""
PERSON_ENERGY = {
    "wall_push": 40.0,
    "corner_slide": 0.51,
    "two_arms": 2.7,
    "arms_cross": 0.37,
    "volley": 2.0,
    "push_box": 55.5,
}
"""Largest kinetic energy of a scene's tracked motion [J]."""
HINGE_SPEED = {
    "wall_push": 7.5,
    "corner_slide": 3.2,
    "two_arms": 6.2,
    "arms_cross": 2.2,
    "ball_snip": 11.8,
    "table_slide": 0.0,
}
"""Largest speed of a hinge of a scene's tracker [rad/s], where no body kicks a link. Attraction follows it;
only overlap removal that jerks a hinge is faster."""
GALLERY: tuple[Limit, ...] = (
    Limit("overlap.max", 1e-3, "a twentieth of the ball's radius: what a viewer does not see"),
    Limit("overlap.max", 1e-6, "method, Removal: it ends at 1e-6 m", "reference", by_construction=True),
    Limit("overlap.tunnelled", 0, "nothing passes through a body"),
    Limit("contact.gap", 1e-4, "a body at rest neither hovers nor sinks visibly"),
    Limit("contact.gap", 1e-6, "contacts are found within 1e-6 m", engine="reference"),
    Limit("contact.impulse_balance", 0.01, "above 1 % the engine's impulses are not believed"),
    Limit("contact.impulse_balance.driven", DRIVEN_AUDIT_LIMIT, "a tree's momentum in steps of first order"),
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
    *(
        Limit(
            f"{metric}.slow.max",
            largest,
            "as of fast bodies, from 0.02 and 0.001 m/s on",
            "reference",
            "",
            one,
        )
        for metric, largest in (("restitution", 2e-4), ("friction", 1e-3))
        for one in ("balanced", "accurate", "equal-step")
    ),
    Limit("friction.cone", 1e-6, "Coulomb's inequality, to a solver's tolerance"),
    Limit("friction.cone", 1e-12, "Coulomb's inequality, to rounding", engine="reference"),
    Limit("friction.cone.point", 1e-12, "Coulomb's inequality at every point, to rounding", "reference"),
    Limit("friction.deficit", 0.05, "sliding friction within 5 % of mu", subject="table-ball"),
    Limit("friction.deficit", 1e-9, "Coulomb's law, to rounding", engine="reference"),
    Limit("friction.deficit", 0.05, "sliding friction within 5 % of mu", subject="floor-box"),
    Limit("friction.direction", 0.02, "about one degree", subject="table-ball"),
    Limit("friction.coast", 0.05, "5 %, as of mu"),
    *(
        Limit("energy.injected", 1e-4, "0.1 % of the energy with which the ball lands", scenario=scene)
        for scene in ("ball_snip", "table_slide")
    ),
    *(
        Limit("energy.injected", joule / 100, f"1 % of the {joule} J of its motion", scenario=scene)
        for scene, joule in PERSON_ENERGY.items()
    ),
    Limit("joint.limit", 0.02, "about one degree", scenario="gallery"),
    Limit("joint.limit", 1e-9, "method, Posture QP: angles are clamped", "reference", by_construction=True),
    Limit("joint.cone", 1e-9, "`keep_in_cone`: bones are put back", "reference", by_construction=True),
    *(
        Limit("joint.speed", fastest, "no hinge outruns its scene's tracker", "reference", scene, profile)
        for scene, fastest in HINGE_SPEED.items()
        for profile in ("balanced", "accurate")
    ),
    *(
        Limit("posture.over_best", 1.3, "within 1.3 of the best known", "reference", "gallery", profile)
        for profile in ("balanced", "accurate")
    ),
    Limit("energy.injected", 1e-9, "nothing but rounding", engine="reference"),
    Limit("ik.missed", 0.1, "64 passes: CCD creeps where an arm is stretched", "reference", "arm, near", CCD),
    *(
        Limit("ratio.time", ratio, "over damped least squares in Python", "reference", start, CCD)
        for start, ratio in (("arm, near", 0.4), ("arm, rest", 0.35))
    ),
    Limit("events.touch.spread", 1 / 60, "one frame: all engines follow the same glove"),
    Limit("events.roll.spread", 2 / 60, "two frames: sliding ends at 2/7 v0 / (mu g), v0 within 20 %"),
    Limit("events.leave.spread", 0.1, "a servo gives way and a posed finger does not: v0 differs by 15 %"),
    Limit("events.land.spread", 0.1, "the same, the fall itself takes equally long"),
    Limit("events.land.place.spread", 0.05, "0.4 s of fall at velocities that differ by 15 %"),
    Limit("predictability.error", 1e-4, "normals good to 1e-5, and what ten times grows of it", "reference"),
    Limit(
        "ratio.time",
        0.3,
        "three exact depths in the time of one: nobody need do with less",
        engine="reference.exact",
        scenario="hulls overlapping",
        subject="coal",
    ),
    Limit(
        "ratio.time",
        0.05,
        "coherent depth next to free beside the best library, from its cached guess",
        engine="reference.walk",
        scenario="hand sliding",
        subject="coal.warm",
    ),
    Limit(
        "scaling.exponent",
        0.5,
        "finer hulls at little more than the price of coarse ones",
        engine="reference.walk",
        scenario="hull vertices",
    ),
    Limit("certificate.open", 0.01, "99 of 100 answers are vouched for", scenario="hand sliding"),
    Limit("certificate.false", 0, "an answer that is vouched for is right", scenario="hand sliding"),
    Limit("scaling.exponent", 1.1, "work linear in the pieces, and a cache to spare", scenario="broad phase"),
)
RESOLVED: tuple[Limit, ...] = (
    # Limits in every scene. `paper` resolves contacts in sequence up to a cap, as printed, and separates
    # bodies that sink under semi-implicit Euler: neither has a limit.
    *(
        Limit(metric, largest, reason, "reference", profile=profile)
        for profile in ("balanced", "accurate")
        for metric, largest, reason in (
            ("solver.residual", 1e-7, "contacts sink by 2e-9 m a frame: nothing that any limit would see"),
            ("solver.parted_energy", 0, "bodies are kept apart by contacts, not moved apart"),
        )
    ),
    Limit(
        "solver.residual",
        1e-4,
        "contacts hold one after the other, each down to an approach of 1e-4 m/s",
        "reference",
        profile="paper",
    ),
    Limit("solver.dropped_time", 0, "every part of a frame is simulated", "reference"),
)
EFFECTS: tuple[Limit, ...] = (
    Limit(
        "effects.changed", 0, "a plan leaves out nothing that matters, to the bit", "reference", subject="all"
    ),
    *(
        Limit(
            "effects.changed", 0, "what a plan leaves out changes nothing", "reference", subject=f"+{effect}"
        )
        for effect in PLANNED
    ),
    Limit("time.left", 0.75, "a plan saves a quarter of the time with all effects", "reference"),
    *(
        Limit("time.left", 1.0, "a plan costs an engine nothing", engine)
        for engine in ("dart", "bullet", "mujoco")
    ),
    Limit("time.slower", 0.02, "a plan costs nothing, whatever it saves", "reference"),
    Limit("time.plan", 0.05, "a plan is made before anybody waits for it", "reference"),
)
ROBUSTNESS: tuple[Limit, ...] = tuple(
    Limit(f"robustness.{metric}", largest, reason, "reference", "all", profile)
    for profile in ("balanced", "accurate")
    for metric, largest, reason in (
        ("error", 0, "every random scene can be played to its end"),
        ("hang", 0, "every frame ends"),
        ("non-finite", 0, "contacts do no positive work: velocities are bounded"),
        ("exploded", 0, "contacts do no positive work: energy cannot double"),
        ("tunnelled", 0, "nothing passes through a body"),
        ("work", 0, "bodies gain no more energy than drivers give them"),
        ("solves.open", 0.005, "all but named cases are solved"),
        ("overlap.max", 1.02e-6, "method, Removal: 1e-6 m, by an oracle good to 1e-8 m"),
        ("momentum.max", 1e-9, "impulses act on both sides, to rounding"),
        ("rise.max", 1e-6, "contacts do no positive work, corrections hardly any"),
        ("rise.p99", 1e-9, "contacts do no positive work, to rounding"),
        ("residual.p995", 1e-7, "all but named cases are solved: bodies sink by 2e-9 m a frame"),
    )
)
FIRST_ORDER = "5 %: an integrator of first order at a fitting step is off by h / T, below 1 %"
BOUNCES = tuple(f"bounce_{e}" for e in ("e0", "e03", "e05", "e08", "e1"))
OF_A_LAW = ("truth.velocity", "momentum.withheld", "rest.settled", "rest.drift")
"""Metrics that tell laws of impact apart where several bodies touch."""
PROBES: tuple[Limit, ...] = (
    # Limits that a correct first-order engine meets.
    Limit("overlap.max", 1e-2, "met at 2.4 m/s, v h at 1/240 s: found once it overlaps", scenario="impact"),
    Limit("contact.gap", 2e-4, "a body at rest falls by g h^2 = 0.17 mm in 1/240 s", scenario="probe"),
    Limit("contact.at_distance", 4e-4, "known to g dt h / 2: 0.34 mm at 1/240 s", scenario="probe"),
    Limit(
        "contact.at_distance",
        1.4e-3,
        "known to g h^2 / 2 on an Euler path of 1/60 s",
        engine="reference",
        scenario="probe",
        profile="paper",
    ),
    Limit("force.error", 0.01, "a hundredth of the closed form"),
    Limit("force.error", 0.05, FIRST_ORDER, scenario="impact"),
    Limit("published.error", 1.0, "within the tolerance of the published value"),
    Limit("truth.position", 0.05, FIRST_ORDER, scenario="fall"),
    Limit("truth.position", 0.05, FIRST_ORDER, scenario="spring"),
    Limit("truth.velocity", 0.05, "5 % of the outcome, as of the coefficients", scenario="isolated"),
    Limit("rotation.flip", 0.05, "5 % of a second; flips are seconds apart", scenario="probe"),
    Limit("rolling.time", 0.05, "5 %, as of mu", scenario="probe"),
    Limit("friction.stop", 0.05, "5 %, as of mu", scenario="probe"),
    Limit("friction.lift", 1e-3, "a hundredth of the cube: what a viewer does not see", scenario="probe"),
    Limit("friction.tilt", 0.02, "about one degree", scenario="probe"),
    Limit("friction.creep", 1e-3, "a millimetre a second is not seen", scenario="probe"),
    Limit("momentum.linear", 1e-9, "impulses act on both sides, to a solver's rounding", scenario="probe"),
    Limit("momentum.angular", 1e-9, "impulses act on both sides, to a solver's rounding", scenario="probe"),
    *(Limit("momentum.angular", 0.05, FIRST_ORDER, scenario=f"tumble_{s}") for s in ("stable", "unstable")),
    Limit("momentum.withheld", 0.05, "the last ball takes all but 5 %", scenario="probe"),
    Limit("energy.gain", 0.05, FIRST_ORDER, scenario="probe"),
    Limit("energy.loss", 0.05, FIRST_ORDER, scenario="probe"),
    Limit("energy.injected", 0.1, "5 % of 2 J, with which bodies of 1 kg meet", scenario="probe"),
    Limit("energy.injected", 10.0, "5 % of the 190 J over the floor", scenario="arch_slides"),
    Limit("energy.injected", 3.0, "5 % of the 58 J over the floor", scenario="arch_thin"),
    Limit("energy.injected", 15.0, "5 % of the 300 J and more of the fall", scenario="heap"),
    Limit("overlap.max", 1e-2, "met at 2.4 m/s, v h at 1/240 s: found once it overlaps", scenario="heap"),
    Limit("rest.speed", 0.05, "a ball's radius a second: nothing rolls on", scenario="settles"),
    Limit("rest.lost", 0, "what falls into a box stays in it", scenario="settles"),
    Limit("rest.settled", 5e-3, "soft contacts give, by a twentieth of a cube at most", scenario="probe"),
    Limit("rest.drift", 5e-4, "a hundredth of a cube in both halves: not seen", scenario="probe"),
    *(
        Limit(one, inf, "a choice of law: `impact.law`", scenario="cradle")
        for one in (*OF_A_LAW, "published.error")
    ),
    Limit("published.error", inf, "a choice of law: `impact.law`", scenario="rod_e1"),
    *(
        Limit(one, largest, "impacts come one after another", "reference", "cradle", "paper")
        for one, largest in zip(OF_A_LAW, (0.05, 0.05, 5e-3, 5e-4))
    ),
    Limit("symmetry.mirror", 0.02, "2 % of the speeds of 1 m/s", scenario="probe"),
    *(Limit("energy.injected", 0.15, "5 % of the 2.9 J of the fall", scenario=scene) for scene in BOUNCES),
    *(
        Limit("energy.injected", 0.4, "5 % of the 8 J with which the light ball leaves", scenario=scene)
        for scene in ("collide_ratio_1e3", "collide_ratio_1e6")
    ),
)
FOUND = "touching points are found within 1e-6 m"
MET = "bodies meet within 1e-6 m: their normal is good to 1e-5 at 5 cm, and so are times and outcomes"
EXACT = "exact for constant forces: nothing but rounding over the frames"
ROUNDING = "the laws of Newton and Coulomb, to rounding"
HELD = "contacts are held over whole frames: what ends within one is off by mu g h^2 / 8"
CLOSED = "the closed form, to rounding"
EXACTING: tuple[Limit, ...] = (
    # Limits of the reference, in addition to those that apply everywhere.
    Limit("contact.at_distance", 1e-6, FOUND, scenario="probe"),
    Limit("contact.complementarity", 1e-12, ROUNDING, scenario="isolated"),
    Limit("contact.at_distance", 1e-4, "held for a part of a frame while bodies turn", scenario="collective"),
    Limit("energy.injected", 1e-5, "1e-9 of the 15 kJ over the floor", scenario="load_1e4"),
    Limit("energy.injected", 1e-3, "1e-9 of the 1.5 MJ over the floor", scenario="load_1e6"),
    Limit("truth.position", 1e-4, HELD, scenario="probe"),
    Limit("truth.position", 1e-9, EXACT, scenario="conservative"),
    Limit("truth.position", 5e-3, "of second order in the step", scenario="curved"),
    *(Limit(f"energy.{one}", 1e-4, "of second order", scenario="curved") for one in ("gain", "loss")),
    *(Limit("truth.position", 1e-12, EXACT, scenario=scene) for scene in ("isolated", "fall")),
    Limit("truth.position", 1e-6, FOUND, scenario="belt"),
    Limit("truth.position", 1e-12, "Eq. 6 is solved in closed form", scenario="spring"),
    Limit("truth.position", 1e-5, MET, scenario="impact"),
    Limit("truth.velocity", 1e-6, FOUND, scenario="probe"),
    Limit("truth.velocity", 1e-5, MET, scenario="impact"),
    Limit("truth.velocity", 1e-9, "the last ball takes all", scenario="cradle"),
    Limit("truth.spin", 1e-9, EXACT, scenario="probe"),
    Limit("truth.spin", 1e-5, MET, scenario="impact"),
    Limit("truth.orientation", 1e-6, FOUND, scenario="probe"),
    Limit("truth.orientation", 1e-9, CLOSED, scenario="isolated"),
    Limit("truth.orientation", 1e-4, MET, scenario="impact"),
    *(
        Limit("truth.orientation", 1e-2, "contacts are held: off by 5/2 mu g h^2 / 8 r", scenario=scene)
        for scene in ("slip", "slip_seed0", "slip_seed1", "slip_seed2")
    ),
    *(Limit("force.error", 1e-6, FOUND, scenario=tag) for tag in ("probe", "prescribed", "driven", "belt")),
    Limit("bounce.height", 1e-6, "an impact is found where it happens", scenario="probe"),
    Limit("restitution.error", 1e-6, "an impact is found where it happens", scenario="probe"),
    Limit("restitution.error", 1e-12, ROUNDING, scenario="isolated"),
    Limit("rotation.flip", 1e-6, "the closed form; between frames by cubics", scenario="probe"),
    Limit("rolling.time", 1e-9, EXACT, scenario="probe"),
    Limit("friction.stop", 1e-4, HELD, scenario="probe"),
    Limit("friction.direction", 1e-9, ROUNDING, scenario="probe"),
    Limit("friction.lift", 1e-6, FOUND, scenario="probe"),
    Limit("friction.tilt", 1e-5, "1e-6 m over the edge of the cube", scenario="probe"),
    Limit("friction.creep", 1e-9, "what is held sticks, to rounding", scenario="probe"),
    Limit("friction.heading", 1e-9, "nothing knows a direction", scenario="probe"),
    *(Limit(one, 1e-6, FOUND, scenario="probe") for one in ("rest.settled", "rest.drift")),
    Limit("symmetry.mirror", 1e-9, "nothing knows left from right, to rounding that grows", scenario="probe"),
    Limit("symmetry.mirror", 1e-12, ROUNDING, scenario="isolated"),
    Limit("symmetry.mirror", 1e-3, "a row that falls leaves its line by 1 mm/s at most", scenario="dominoes"),
    Limit("symmetry.offset", 2e-3, "a row that falls leaves its line by 1 mm at most", scenario="dominoes"),
    *(Limit(name, 1e-12, CLOSED, scenario="probe") for name in ("momentum.linear", "momentum.angular")),
    Limit("momentum.withheld", 1e-9, "the last ball takes all", scenario="probe"),
    Limit("energy.gain", 1e-9, "over ten seconds of tumbling", scenario="probe"),
    Limit("energy.loss", 1e-9, "over ten seconds of tumbling", scenario="probe"),
)
BALANCED: tuple[Limit, ...] = tuple(
    # The reference handles an impact at a gap of 5e-7 m, which is 2e-4 of a bounce of 2.4 mm.
    Limit(metric, largest, FOUND, scenario=scene)
    for metric, largest in (("truth.position", 1e-4), ("bounce.height", 1e-3), ("restitution.error", 1e-5))
    for scene in BOUNCES
)
LIMITS = (
    *PROBES,
    *GALLERY,
    *RESOLVED,
    *EFFECTS,
    *ROBUSTNESS,
    *(
        replace(limit, engine="reference", profile=profile, scenario=tag)
        for limit in EXACTING
        for profile in ("balanced", "accurate")
        for tag in (("probe", "seeded") if limit.scenario == "probe" else (limit.scenario,))
    ),
    *(replace(limit, engine="reference", profile="balanced") for limit in BALANCED),
)
"""All limits; the later of equally specific ones wins."""


def limit_of(row: Row, tags: tuple[str, ...], among: Iterable[Limit] | None = None) -> Limit | None:
    """The most specific limit of a row among LIMITS or others, the last of equals; None if there is none."""
    among = LIMITS if among is None else among
    candidates = [limit for limit in among if limit.metric == row.metric and _covers(limit, row, tags)]
    return max(reversed(candidates), key=_specificity, default=None)


def _specificity(limit: Limit) -> int:
    return sum(map(bool, (limit.engine, limit.scenario, limit.profile, limit.subject)))


def _covers(limit: Limit, row: Row, tags: tuple[str, ...]) -> bool:
    return (
        limit.engine in ("", row.engine)
        and limit.scenario in ("", row.scenario, *tags)
        and limit.profile in ("", row.profile)
        and limit.subject in ("", row.subject)
    )


OWN, OF_FILE = "the scene's own limit", "limit of the file"


def is_foreign(scenario: Scenario) -> bool:
    """Whether a scene has none of the catalogue's tags."""
    return not scenario.tags or not set(scenario.tags) & set(tags())


def own_limits(scenario: Scenario, of_file: Iterable[Limit] = ()) -> tuple[Limit, ...]:
    """Limits of a scene and of a file, whose later ones win among equals."""
    own = (
        Limit(one.metric, one.largest, one.reason or OWN, one.engine, "", one.profile, one.subject)
        for one in scenario.limits
    )
    return (*own, *of_file)


def valid_metrics() -> tuple[str, ...]:
    """Names of all metrics of a run, those that compare engines included."""
    spreads = (f"{name}.spread" for name in METRICS if name.startswith("events."))
    return (*METRICS, *spreads, SPREAD, HORIZON, *RATIOS)


def check_limits(scenarios: Iterable[Scenario]) -> None:
    """Raise SceneFileError with a line per limit of a scene that names no metric, engine or profile."""
    faults = [
        f"{scenario.name}: limits[{i}].{field}: {text}"
        for scenario in scenarios
        for i, limit in enumerate(scenario.limits)
        for field, text in _unknown(limit.metric, limit.engine, limit.profile)
    ]
    if faults:
        raise SceneFileError("\n".join(faults))


def _unknown(metric: str, engine: str, profile: str) -> Iterable[tuple[str, str]]:
    profiles = dict.fromkeys(name for entry in ENGINES.values() for name in entry.profiles)
    asked = (("metric", metric, valid_metrics()), ("engine", engine, ENGINES), ("profile", profile, profiles))
    for field, name, valid in asked:
        of_others = field == "engine" and ":" in name  # a class that is not registered
        if name not in valid and (name or field == "metric") and not of_others:
            near = difflib.get_close_matches(name, list(valid), n=3, cutoff=0.5)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            yield field, f"unknown {field} {name!r}{hint}"


def limits_of_file(path: Path) -> tuple[Limit, ...]:
    """Limits of a TOML or JSON file: an array `limits` with the fields of `Limit`.

    Raises:
        SceneFileError: the file is not valid; one line per fault.
    """
    from pydantic import Strict, create_model  # import on demand: runs without such a file need none

    number = Annotated[float, Strict()]
    names = dict.fromkeys(("reason", "engine", "scenario", "profile", "subject"), (str, ""))
    forbid = {"extra": "forbid"}
    one = create_model("Limit", __config__=forbid, metric=(str, ...), largest=(number, ...), **names)  # type: ignore
    model = create_model("Limits", __config__=forbid, limits=(tuple[one, ...], ...))  # type: ignore
    data, faults, message_of = data_of_file(path, model)
    found = data.get("limits", ())
    for i, entry in enumerate(found):
        unknown = _unknown(entry["metric"], entry.get("engine", ""), entry.get("profile", ""))
        faults += [(placed(f"limits[{i}].{field}"), text) for field, text in unknown]
    if faults:
        raise SceneFileError(message_of(faults))
    return tuple(Limit(**{"reason": OF_FILE, **entry}) for entry in found)

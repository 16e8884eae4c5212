"""Documented failings of the reference where its contact solver does not converge."""

from __future__ import annotations

from reports.known_record import Cause

SLIDING = (
    "several contacts slide at once between bodies that lean on each other: neither Newton's method nor "
    "sweeps converge, impulses are scaled down until they do no work, and bodies sink until they are parted"
)
LOADED = "1e6 kg come to rest on 1 kg: what parting adds, 1e-12 of the energy, finds no motion to pay it"
TIPPING = (
    "solves end at a residual of 1e-9 m/s: some 1e-8 of the friction of a face that slides while it tips"
)
CREEPING = "solves of twenty and more boxes stall near a residual of 1e-9 m/s, which counts as converged"
ROLLING = "a coin that turns sinks over a substep, by up to 1.5e-6 m at the displayed frame"
HEAP = (
    "islands hold more bodies than Newton's method takes, and 40 sweeps a dense substep leave wedged balls "
    "a residual; what sinks by it is parted"
)

SOLVER: tuple[Cause, ...] = (
    Cause(
        "reference",
        HEAP,
        dict.fromkeys(("solver.residual", "solver.caps", "solver.parted_energy"), "balls_box"),
        "balanced accurate",
    ),
    Cause("reference", HEAP, {"overlap.max": "balls_box"}, "accurate"),
    Cause(
        "reference",
        SLIDING,
        {
            "solver.residual": "arch_thin arch_slides dominoes",
            "solver.caps": "arch_thin arch_slides dominoes",
            "solver.parted_energy": "arch_slides",
            "symmetry.mirror": "dominoes",
        },
        "balanced",
    ),
    Cause(
        "reference",
        SLIDING,
        {
            "solver.residual": "arch_slides dominoes",
            "solver.caps": "arch_thin arch_slides dominoes tip_falls",
            "solver.parted_energy": "arch_thin arch_slides",
            "overlap.max": "arch_thin arch_slides dominoes",
            "symmetry.mirror": "dominoes",
        },
        "accurate",
    ),
    Cause("reference", CREEPING, {"friction.creep": "tower_40", "solver.caps": "tower_20"}, "accurate"),
    Cause("reference", ROLLING, {"overlap.max": "coin_spins"}, "accurate"),
    Cause("reference", LOADED, {"solver.parted_energy": "load_1e6"}, "accurate"),
    Cause("reference", TIPPING, {"friction.deficit": "tip_falls:slope-box"}, "balanced accurate"),
)

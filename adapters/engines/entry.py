"""Entry of an engine in the registry, and the engines that this process knows.

An engine is registered under the entry-point group `touchstone.engines`, ours as well as those of others. The
entry point names an `Entry`, or a class that meets `Engine` in `adapters/contract.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

GROUP = "touchstone.engines"
"""Entry-point group of engines."""
EQUAL_STEP = 1 / 240
RECOMMENDED, DEFAULT, ACCURATE, MAXIMAL = "recommended", "default", "accurate", "maximal"
SLEEPING = "sleeping"


@dataclass(frozen=True, slots=True)
class Entry:
    """What the project needs to know of an engine; no other table names engines.

    Attributes:
        implementation: "module:Class".
        package: what must be importable.
        profiles: native step [s] of each profile.
        distribution: what is installed, where it is not called like the package.
        color, marker: of the engine in pictures, as Vega names them.
        rounding: what the engine stores in lower precision; "" if nothing.
        requirement: what pip installs to get the engine; "" for an engine that is not of this project.
        last_wheel: last version of Python for which a package index has a wheel of it; beyond, pip compiles.
        compiles: "module:function" that says in words how far a compiler is for which the engine's first
            scene waits; "" if it has none.
        settings: "module:table" of the settings that `--set` changes (`knobs.py`); "" if it has none.
        script: module whose `parts` and `settings_lines` say a scene in the engine's own API
            (`adapters/scripts`); "" if it has none.
        pins: "name==version" of all packages of an environment of its own (`workers/own_environment.py`), for
            requirements that conflict with this program's; () if it needs none.
        lacks: abilities of `conformance/abilities.py` that its first profile has not.
        keeps: what plans leave it although a scene does not need it, because its steps take no less time
            without (`touchstone study effects`): pieces that nothing can meet, namely `fixed` those of fixed
            bodies, where there is contact, `met` those of bodies of which something can meet a piece, and
            `moving` those of bodies that are not fixed; `gravity`.
        backend_of: engine of which this is another implementation, with its profiles; "" if of none.

    Profiles: `recommended` is what the engine's documentation and maintainers recommend for such scenes, at
    the engine's default step, rounded down to a divisor of a frame of 1/60 s; `equal-step` is the same at
    one step for all engines, the reference (`balanced`) included; `default` keeps all defaults; `accurate`
    uses options of its documentation that improve Newton's and Coulomb's laws, as `touchstone study
    calibration` measures. Adapters cite the sources of their settings. `maximal` is Bullet with free balls
    and boxes in maximal coordinates: faster, with different results.
    """

    implementation: str
    package: str
    profiles: Mapping[str, float]
    distribution: str = ""
    color: str = "#666666"
    marker: str = "cross"
    rounding: str = ""
    requirement: str = ""
    last_wheel: tuple[int, int] | None = None
    compiles: str = ""
    settings: str = ""
    script: str = ""
    pins: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    keeps: tuple[Literal["fixed", "met", "moving", "gravity"], ...] = ()
    backend_of: str = ""


ENGINES: dict[str, Entry] = {}
"""Engines that play by default, then those that were asked for by name in this process or its parent."""

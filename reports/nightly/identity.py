"""Identity of a night: program, engines, libraries, machine, settings."""

from __future__ import annotations

import hashlib
import os
import platform
import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from touchstone.adapters.registry import ENGINES
from touchstone.reports.machine import machine, origin

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "coal", "python-fcl", "pin", "pandas", "pyarrow")
"""Libraries on which results depend."""
HARDWARE = ("processor", "flags", "cores", "system", "memory")
"""Facts of which the fingerprint of the hardware consists: times are compared within one fingerprint."""


def identity(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Identity of a night that starts now; all values are JSON."""
    facts = origin()
    hardware = {**machine(), "flags": _flags(), "memory": _memory()}
    mine = {name: hardware[name] for name in HARDWARE}
    started = datetime.now(UTC)
    return {
        "run": f"{started:%Y%m%dT%H%M%S}-{secrets.token_hex(3)}",
        "started": started.isoformat(timespec="seconds"),
        "commit": facts["commit"].rstrip("+"),
        "dirty": facts["commit"].endswith("+"),
        "versions": {**_engine_versions(), **{name: _version(name) for name in LIBRARIES}},
        "machine": {
            **mine,
            "python": hardware["python"],
            "kernel": platform.release(),
            "host": platform.node(),
        },
        "fingerprint": hashlib.sha256(repr(sorted(mine.items())).encode()).hexdigest()[:12],
        "load": os.getloadavg()[0],
        "settings": dict(settings),
    }


def same_night(one: object, two: Mapping[str, Any]) -> bool:
    """Whether a night that ended early may be continued: the same program, versions, machine and settings."""
    parts = ("commit", "dirty", "versions", "fingerprint", "settings")
    return isinstance(one, Mapping) and all(one.get(name) == two.get(name) for name in parts)


def identity_changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """What changed from one night to another: engines and libraries, our code, the machine."""
    found = []
    old, new = before.get("versions", {}), after.get("versions", {})
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            found.append(f"{name} {old.get(name, '-')} -> {new.get(name, '-')}")
    if (before.get("commit"), before.get("dirty")) != (after.get("commit"), after.get("dirty")):
        texts = [f"{one.get('commit') or '?'}{'+' if one.get('dirty') else ''}" for one in (before, after)]
        found.append(f"our code {texts[0]} -> {texts[1]}")
    old, new = before.get("machine", {}), after.get("machine", {})
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            found.append(f"machine: {name} {_short(old.get(name))} -> {_short(new.get(name))}")
    return found


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def _engine_versions() -> dict[str, str]:
    return {name: _version(entry.distribution or entry.package) for name, entry in ENGINES.items()}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "-"


def _flags() -> str:
    """Hash of the processor's flags."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            flags = next((line for line in file if line.startswith(("flags", "Features"))), "")
    except OSError:
        flags = ""
    return hashlib.sha256(" ".join(sorted(flags.split())).encode()).hexdigest()[:12]


def _memory() -> str:
    """Memory in whole GiB."""
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"

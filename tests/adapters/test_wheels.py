"""An engine without wheels for this Python says what pip would do."""

import sys
from dataclasses import replace

from touchstone.adapters import registry
from touchstone.adapters.engines.entry import ENGINES


def test_a_missing_wheel_is_told(monkeypatch):
    """Beyond its last wheel the reason names both versions; up to it, pip alone."""
    entry = ENGINES["bullet"]
    monkeypatch.setitem(ENGINES, "bullet", replace(entry, last_wheel=(3, 8)))
    mine = ".".join(map(str, sys.version_info[:2]))
    assert registry.missing_reason("bullet") == (
        "not installed (pip install pybullet; wheels end with Python 3.8, "
        f"on {mine} pip compiles it for minutes in silence)"
    )
    monkeypatch.setitem(ENGINES, "bullet", replace(entry, last_wheel=sys.version_info[:2]))
    assert registry.missing_reason("bullet") == "not installed (pip install pybullet)"

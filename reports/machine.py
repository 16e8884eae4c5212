"""Facts of the machine and the program that accompany every measurement."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def origin() -> dict[str, str]:
    """Command, commit (of a checkout; empty elsewhere) and day of a measurement."""
    command = " ".join(["touchstone", *sys.argv[1:]]) if sys.argv[0].endswith("touchstone") else ""
    return {"command": command, "commit": _commit(), "day": date.today().isoformat()}


def _commit() -> str:
    """Abbreviated commit of this checkout, with a plus sign if files differ from it."""
    here = str(Path(__file__).resolve().parent)
    call = ["git", "-C", here, "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        return subprocess.run(call, capture_output=True, text=True, timeout=5, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def machine() -> dict[str, str]:
    """Facts of the machine that accompany every time."""
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": str(os.cpu_count()),
    }


def package_version(package: str, absent: str = "") -> str:
    """Version of an installed distribution; `absent` without it."""
    try:
        return version(package)
    except PackageNotFoundError:
        return absent


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
        return names[0] if names else platform.processor()
    except OSError:
        return platform.processor()

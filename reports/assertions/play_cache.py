"""Recordings of earlier test sessions, in a folder, by a hash of everything that decides them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from touchstone.adapters.recording import Recording, RecordingError, load

LARGEST = 10**9
"""Size of a cache that is kept [bytes]; beyond, what was not used for the longest time goes first."""
RECORDING, REFUSAL = ".npz", ".txt"
"""Suffixes of a recording and of the reason why an engine refuses a scene."""


class PlayCache:
    """Recordings and refusals by key. Without a folder it is empty and stays so."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    def get(self, key: str) -> tuple[str, str, Recording | None] | None:
        """Status, reason and recording of a run; None if it is not kept. A damaged recording is removed."""
        if self._folder is None:
            return None
        refusal, recording = self._folder / (key + REFUSAL), self._folder / (key + RECORDING)
        try:
            if refusal.exists():
                os.utime(refusal)
                return "skipped", refusal.read_text(encoding="utf-8"), None
            if recording.exists():
                os.utime(recording)
                return "done", "", load(recording)
        except (RecordingError, OSError):
            recording.unlink(missing_ok=True)
        return None

    def put(self, key: str, status: str, reason: str, recording: Path) -> None:
        """Keep a run that was played to its end, or refused; others are played again. A full disk keeps
        nothing."""
        if self._folder is None or status not in ("done", "skipped"):
            return
        path = self._folder / (key + (RECORDING if status == "done" else REFUSAL))
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            if status == "done":
                shutil.copyfile(recording, part)
            else:
                part.write_text(reason, encoding="utf-8")
            os.replace(part, path)
        except OSError:
            part.unlink(missing_ok=True)

    def trim(self, largest: int = LARGEST) -> None:
        """Remove what was not used for the longest time until at most `largest` bytes remain."""
        if self._folder is None:
            return
        kept = []
        for path in self._folder.iterdir():
            try:
                facts = path.stat()
            except OSError:  # another worker of this session removed it
                continue
            kept.append((facts.st_mtime, facts.st_size, path))
        size = 0
        for _, own, path in sorted(kept, reverse=True):
            size += own
            if size > largest:
                path.unlink(missing_ok=True)

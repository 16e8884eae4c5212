"""Files that a scene or a model names: read only from its own folder, unless the user allows others."""

from __future__ import annotations

from pathlib import Path


class PathRefused(ValueError):
    """The file lies outside the folder; the message says how to allow it."""


def allowed(folder: Path, name: str, allow_paths: bool) -> Path:
    """Path of a file that a document in `folder` names; symbolic links are followed first.

    Raises:
        PathRefused: the file lies outside `folder`, and `allow_paths` is not set.
    """
    path = (folder / name).resolve()
    if not allow_paths and not path.is_relative_to(folder.resolve()):
        raise PathRefused(f"{name!r} lies outside the folder {folder}; allow it by --allow-paths")
    return path

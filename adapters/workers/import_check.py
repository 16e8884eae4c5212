"""Import test of the engines, one child process each, so that a crash or a hang affects one engine only."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import MISSING, UNIMPORTABLE, AdapterError, Engine
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason, packages_of
from touchstone.adapters.workers.process import ChildProcess
from touchstone.adapters.workers.scratch import scratch_folder

Loader = Callable[[str], Engine]
PATIENCE = 60.0
"""Time after which an import counts as hung [s]; the slowest takes three."""


@dataclass(frozen=True, slots=True)
class Imported:
    """Result of an import: `done` with the engine's version, or `missing`, `unimportable` or `error` with the
    reason."""

    status: str
    text: str


def try_imports(
    names: Sequence[str] = tuple(ENGINES), loader: Loader = load, patience: float = PATIENCE
) -> dict[str, Imported]:
    """Import engines in parallel, each in a child process."""
    found, children = {}, {}
    with scratch_folder() as folder:
        for name in names:
            try:
                if loader is load and not installed(name):
                    found[name] = Imported(MISSING, missing_reason(name))
                    continue
            except AdapterError as error:  # a plug-in that cannot be loaded
                found[name] = Imported(UNIMPORTABLE, str(error))
                continue
            output = Path(folder, f"{name}.txt")
            children[name] = ChildProcess(_Importer, (loader,), output, patience, packages_of(name))
            children[name].send("import", name)
        for name, child in children.items():
            version = child.receive()
            found[name] = Imported(*child.failure) if child.failure else Imported("done", version)
            child.stop()
    return {name: found[name] for name in names}


class _Importer:
    """Child's end."""

    def __init__(self, loader: Loader) -> None:
        self._loader = loader

    def handle(self, command: str, argument: Any) -> str:
        return self._loader(argument).version()

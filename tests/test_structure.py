"""The structure that CONTRIBUTING promises: layers without circles."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("reference_impl", "adapters", "scenarios", "reports")
MODULES = sorted(path for layer in LAYERS for path in (ROOT / layer).rglob("*.py"))
TESTS = sorted(path for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__).resolve())
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


def name_of(path: Path) -> str:
    """Import name of a module: of a package, its folder's."""
    parts = ("touchstone", *path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def tree(path: Path) -> ast.Module:
    """Syntax tree of a module."""
    return ast.parse(path.read_text())


def imports() -> dict[str, set[str]]:
    """Modules that each module imports, at its top, in a function, or for types."""
    names = {name_of(path) for path in MODULES}
    found: dict[str, set[str]] = {}
    for path in MODULES:
        mine = found[name_of(path)] = set()
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.module:
                parts = (f"{node.module}.{alias.name}" for alias in node.names)
                mine |= {part if part in names else node.module for part in parts}
            elif isinstance(node, ast.Import):
                mine |= {alias.name for alias in node.names}
        mine &= names
    return found


def test_no_modules_import_each_other():
    """Take modules without imports away until none is left: what cannot be taken away is a circle."""
    left = imports()
    while free := {name for name, needs in left.items() if not needs & left.keys()}:
        left = {name: needs for name, needs in left.items() if name not in free}
    assert left == {}


PRIVATE_PHRASES = re.compile(
    r"\b(finds? no room|is told|looks? at|by turns|keeps? to|anew|alike|held against)\b"
)
"""Phrases that a reader has to read twice; CONTRIBUTING says what to write instead."""


def test_texts_use_plain_terms():
    """No docstring, comment, message or page uses one of PRIVATE_PHRASES."""
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in (*MODULES, *TESTS, *PAGES)
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if PRIVATE_PHRASES.search(line)
    ]
    assert found == []


MOST_PARAMETERS = 8


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Name and number of parameters of each function with more than MOST_PARAMETERS, but of commands."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef):
            given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            count = len([one for one in given if one.arg not in ("self", "cls")])
            if count > MOST_PARAMETERS and "typer.Option" not in ast.unparse(node.args):
                yield node.name, count


def test_functions_have_few_parameters():
    """A function has at most MOST_PARAMETERS parameters; those of a command are its options."""
    found = {
        f"{path.relative_to(ROOT)}: {name}": count for path in MODULES for name, count in functions(path)
    }
    assert found == {}

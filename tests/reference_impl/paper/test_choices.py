"""What the paper leaves open: each decision has its row in docs/method.md, with figures as measured."""

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from touchstone.reference_impl.paper import frame

ROOT = Path(__file__).resolve().parents[3]
PACKAGE, COMMAND = Path(frame.__file__).parent, ROOT / "tests" / "shared" / "paper_choices.py"
PAGE = (ROOT / "docs" / "method.md").read_text()
LEFT_OPEN = re.compile(r"The paper\s+(?:# )?leaves\s+(?:# )?open")


def decisions() -> Counter[str]:
    """Module, or module and function or constant, of every "The paper leaves open"."""
    found: Counter[str] = Counter()
    for path in PACKAGE.glob("*.py"):
        if path.stem == "__init__":
            continue
        source = path.read_text()
        tree = ast.parse(source)
        spans = [
            (node.lineno, node.end_lineno, node.name)
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
        ]
        # a constant and the string that describes it
        for node, text in zip(tree.body, tree.body[1:]):
            if isinstance(node, ast.Assign) and isinstance(text, ast.Expr):
                spans.append((node.lineno, text.end_lineno, ast.unparse(node.targets[0])))
        for match in LEFT_OPEN.finditer(source):
            line = source.count("\n", 0, match.start()) + 1
            inside = [f".{name}" for first, last, name in spans if first <= line <= last]
            found[path.stem + "".join(inside)] += 1
    return found


def rows() -> Counter[str]:
    """The same of the table's first column."""
    return Counter(re.findall(r"^\| [^|]*\(`([\w.]+)`\) \|", PAGE, re.MULTILINE))


def test_every_open_decision_has_its_row() -> None:
    """Find as many rows for a function as it has decisions, and none for others."""
    found, listed = decisions(), rows()
    assert found.total() >= 15
    assert found.keys() == listed.keys()
    assert found - listed == Counter()


def printed(*names: str) -> str:
    """What the command prints."""
    run = subprocess.run([sys.executable, COMMAND, *names], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_rows_say_what_is_measured() -> None:
    """Print two rows as they stand on the page."""
    found = printed("tracker", "spin").splitlines()
    assert len(found) == 2
    for row in found:
        assert row in PAGE


@pytest.mark.slow
def test_the_table_says_what_is_measured() -> None:
    """Print the whole table as it stands on the page."""
    assert printed() in PAGE

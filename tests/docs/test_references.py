"""What pages, docstrings and comments name exists, and constants have the values that pages quote."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import touchstone
from touchstone.adapters.detectors import DETECTORS
from touchstone.adapters.engines.reference.settings import SETTINGS
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.difficulty.family import families
from touchstone.scenarios.random_scenes import KINDS

ROOT = Path(__file__).parents[2]
FOLDERS = ("reference_impl", "adapters", "scenarios", "reports", "tests", "docs")
FILES = [
    path
    for path in (*ROOT.glob("*"), *(one for folder in FOLDERS for one in (ROOT / folder).rglob("*.*")))
    if path.is_file() and "__pycache__" not in path.parts and path.suffix not in (".png", ".npz")
]
NAMES = [f"/{path.relative_to(ROOT).as_posix()}" for path in FILES]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
MODULES = [path for path in FILES if path.suffix == ".py"]
OURS = (
    *FOLDERS[:5],
    "core",
    "geometry",
    "kinematics",
    "broad_phase",
    "continuous",
    "solver",
    "contact",
    "posture",
    "paper",
)
"""First folders of paths that are ours; others are of a reader's folder (`runs/a`)."""
ELSEWHERE = {
    "ConvexMeshShape": "DART",
    "SERVO": "DART",
    "to_xml": "MuJoCo",
    "nhat_BA": "Drake",
    "SolverOptions": "Siconos",
    "nohup": "the system",
    "PD_g": "the paper",
    "J_h": "a formula",
    "mu_s": "a formula",
}
"""Names that are not ours, and whose they are."""
NAME = re.compile(r"[A-Za-z_][\w.]*(?:\(\))?")
PLACEHOLDER = re.compile(r"\b(?:NAME|ENGINE|SCENE|STORE|RUN|TIME)\b|_STAGE\b")
FILE_THEN_NAMES = re.compile(r"`([\w/]+\.py)`((?:(?:,| \(|,? and) ?`\w+`\)?(?! in `))+)")
NAME_IN_FILE = re.compile(r"`(\w+)`(?: in |, )`([\w/]+\.py)`|`([\w/]+\.py)::(\w+)`")
COMMENT = re.compile(r"""((?:[^"'#]|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')*)(#.*)""")
HEADING = re.compile(r"(?:\]\(|`|docs/)?\b([\w/]+\.md)[)`]*,? \(?\"([^\"]+)\"")


@cache
def parts_of(path: Path) -> tuple[list[tuple[int, str]], set[str]]:
    """Docstrings and comments of a module with their lines, of a page its paragraphs; and all other words."""
    source, texts = path.read_text("utf-8"), []
    if path.suffix == ".py":
        lines = ["", *source.splitlines()]
        whole, in_texts = set(), set()  # lines of docstrings, and those of other texts but their first
        for node in ast.walk(ast.parse(source)):
            for one in getattr(node, "body", None) if isinstance(getattr(node, "body", None), list) else ():
                if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant):
                    texts.append((one.lineno, str(one.value.value)))
                    whole |= set(range(one.lineno, one.end_lineno + 1))
            if isinstance(node, (ast.Constant, ast.JoinedStr)) and '"""' in lines[node.lineno]:
                in_texts |= set(range(node.lineno + 1, node.end_lineno + 1))
        for k, line in enumerate(lines):
            if k in whole:
                lines[k] = ""
            elif k not in in_texts and (found := COMMENT.match(line)):
                lines[k] = found[1]
                texts.append((k, found[2]))
        source = "\n".join(lines)
    else:
        line = 1
        for paragraph in source.split("\n\n"):
            texts.append((line, paragraph))
            line += paragraph.count("\n") + 2
    return texts, set(re.findall(r"[A-Za-z_]\w*", source))


@cache
def all_words() -> set[str]:
    """Words of all sources and tables, and names of others."""
    kinds = (".py", ".toml", ".csv", ".js", ".json", ".yml")
    return set().union(*(parts_of(path)[1] for path in FILES if path.suffix in kinds), ELSEWHERE)


def held(path: str) -> list[Path]:
    """Files whose path ends so, or that are below a folder whose path ends so."""
    end = "/" + path.strip("/")
    return [file for file, name in zip(FILES, NAMES) if name.endswith(end) or f"{end}/" in name]


def faults(path: Path) -> Iterator[str]:
    """Lines about what a page or module names and nothing holds."""
    for line, text in parts_of(path)[0]:
        where = f"{path.relative_to(ROOT)}:{line}"
        for word in re.findall(r"`([^`\n]+)`", text):
            if PLACEHOLDER.search(word) or held(word):
                continue
            if NAME.fullmatch(word) and not set(re.findall(r"[A-Za-z_]\w*", word)) <= all_words():
                yield f"{where}: no {word}"
        pairs = [
            (file, name)
            for file, names in FILE_THEN_NAMES.findall(text)
            for name in re.findall(r"`(\w+)`", names)
        ]
        pairs += [(file or other, name or test) for name, file, other, test in NAME_IN_FILE.findall(text)]
        for file, name in pairs:
            if not PLACEHOLDER.search(file) and not any(name in parts_of(one)[1] for one in held(file)):
                yield f"{where}: no {name} in {file}"
        for file in re.findall(r"(?<![\w/.-])((?:[\w-]+/)+[\w-]+\.(?:py|md|csv|toml))\b", text):
            if file.startswith(tuple(f"{o}/" for o in OURS)) and not (PLACEHOLDER.search(file) or held(file)):
                yield f"{where}: no file {file}"
        for link in re.findall(r"\]\((?![a-z]+:|#)([^)#\s]+)", text if path.suffix == ".md" else ""):
            if not (path.parent / link).exists():
                yield f"{where}: no file {link}"
        for page, heading in HEADING.findall(" ".join(text.split())):
            lines = [line.strip("#* ") for one in held(page) for line in one.read_text("utf-8").splitlines()]
            if heading not in lines:
                yield f"{where}: no heading {heading!r} in {page}"


@pytest.mark.parametrize("folder", ["pages", *FOLDERS[:5]])
def test_what_is_named_exists(folder):
    """Files, symbols, and headings that pages, docstrings and comments name."""
    paths = PAGES if folder == "pages" else [one for one in MODULES if (ROOT / folder) in one.parents]
    assert [fault for path in paths for fault in faults(path)] == []


QUOTED = [
    ("method.md", "no stronger than at {:g} m (`COUPLING_REACH`)", "posture.virtual_coupling.COUPLING_REACH"),
    ("method.md", "at most {:g} rad of all its hinges", "posture.attraction.ATTRACTION_MOST"),
    ("method.md", "the depth stalls for {} rounds", "posture.overlap_removal.STALL_ROUNDS"),
    ("method.md", "or {} rounds pass", "core.conventions.REMOVAL_ROUNDS"),
    ("method.md", "pairs within {:g} m touch", "core.conventions.TOUCH_DISTANCE"),
    ("method.md", "contacts, {} events or", "contact.speculative_contacts.DENSE_EVENTS"),
    ("method.md", "at most {} times", "core.conventions.EVENT_CAP"),
    ("method.md", "by {} sweeps of", "solver.contact_solver.FIRST_SWEEPS"),
    ("method.md", "more than {} contact points beside faces", "contact.resting_contact.CURVED_ROWS"),
    ("method.md", "sank by more than {:g} m", "core.conventions.OVERLAP_TOLERANCE"),
    ("method.md", "after {} collision times", "paper.frame.COLLISION_TIMES"),
    ("method.md", "`q += (1 - exp(-h / {:g} s))", "paper.attraction.ATTRACTION_TIME"),
    ("glossary.md", "deeper than {:g} m", "core.conventions.OVERLAP_TOLERANCE"),
    (
        "fairness.md",
        "Beyond {:g} m from its tracker (`COUPLING_REACH`)",
        "posture.virtual_coupling.COUPLING_REACH",
    ),
    ("decisions.md", "kernels of more than {} lines of LLVM", "core.kernel_linking.LINES_COPIED"),
    ("decisions.md", "From {} rows on the interior", "solver.contact_solver.INTERIOR_ROWS"),
    ("decisions.md", "or {} events a few dense substeps", "contact.speculative_contacts.DENSE_EVENTS"),
    ("decisions.md", "over-relaxation of {:g} for", "contact.separation.OVER_RELAXATION"),
]
"""Page, its words, and the constant of the reference that they state."""


@pytest.mark.parametrize(("page", "words", "constant"), QUOTED)
def test_a_quoted_constant_has_its_value(page, words, constant):
    """A page states the value that the code has."""
    module, _, name = constant.rpartition(".")
    value = getattr(import_module(f"touchstone.reference_impl.{module}"), name)
    text = " ".join((ROOT / "docs" / page).read_text("utf-8").split())
    number = words.format(value).replace("e-0", "e-")
    assert number in text


COUNTED = [
    ("README.md", "all {} scenes with a closed form", lambda: len(tagged("probe"))),
    ("README.md", "plays {} kinds of difficulty", lambda: len(families())),
    (
        "README.md",
        "`touchstone.assert_no_overlap(run)` and eight more",
        lambda: sum(one.startswith("assert_") for one in touchstone.__all__) == 9,
    ),
    ("docs/stability.md", "plays {} families of hard scenes", lambda: len(families())),
    ("docs/studies.md", "random scenes of twelve kinds", lambda: len(KINDS) == 12),
    ("docs/studies.md", "through fourteen detectors", lambda: len(DETECTORS) == 14),
]
"""Page, its words, and the number in them, or whether the number that they spell is right."""


@pytest.mark.parametrize(("page", "words", "count"), COUNTED)
def test_a_quoted_count_is_right(page, words, count):
    """A page states how many there are."""
    assert count()
    assert words.format(count()) in " ".join((ROOT / page).read_text("utf-8").split())


def test_the_settings_of_the_method_are_those_of_the_profiles():
    """The table has every setting that differs between the profiles, with its values."""
    text = (ROOT / "docs" / "method.md").read_text("utf-8").partition("### Profiles")[2]
    shown = {}
    for row in re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \|", text, re.MULTILINE):
        shown[row[0]] = [SETTINGS[row[0]].number(cell.split()[0].strip("`")) for cell in row[1:]]
    assert shown == {
        name: [SETTINGS[name].number(one) for one in SETTINGS[name].profiles[:2]] for name in shown
    }
    assert {name for name, one in SETTINGS.items() if len(set(one.profiles[:2])) > 1} <= shown.keys()

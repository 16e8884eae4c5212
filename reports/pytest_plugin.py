"""pytest plug-in: play scenes on engines, and assert physical invariants on what they did.

    @pytest.mark.scenario("slide")
    @pytest.mark.engine("mujoco")
    def test_slide(play, scenario, engine):
        touchstone.assert_no_overlap(play(scenario, engine))

Fixtures: `play(scene, engine=None, profile=None, ...)` returns the recording of a run, played in a process of
its own and kept in pytest's cache until sources, versions, settings or the scene change; `scenario` and
`engine` are those of the markers, or of `--touchstone-engine`. With `--touchstone-tag TAG` our invariants run
over all scenes with the tag: `reports/assertions/suite.py`. Measured values become properties of the test,
which `--junit-xml` writes.

pytest imports this module in every session of an environment in which touchstone is installed: it imports
nothing heavy until a fixture is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pluggy
import pytest

from touchstone.reports.assertions.outcome import LISTENER, Finding, InvariantError

if TYPE_CHECKING:
    from touchstone.adapters.recording import Recording
    from touchstone.reports.assertions.player import Player
    from touchstone.scenarios.scenario import Scenario

MARKERS = (
    "scenario(name, ...): scenes of touchstone that the fixture `scenario` has, one test each",
    "engine(name, ...): engines of touchstone, or module:Class, that the fixture `engine` has, one test each",
)
CACHE = "touchstone"
COUNTS = pytest.StashKey[tuple[int, int]]()
"""Runs of a session that were played, and that were kept from earlier sessions."""
SUITE = Path(__file__).with_name("assertions") / "suite.py"
"""Module of the invariants that `--touchstone-tag` collects."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of this plug-in."""
    group = parser.getgroup("touchstone", "physical invariants of engines")
    group.addoption(
        "--touchstone-engine",
        action="append",
        default=[],
        metavar="ENGINE",
        help="Engine of the fixture `engine`: a name, or module:Class (repeatable; default: reference).",
    )
    group.addoption(
        "--touchstone-tag",
        action="append",
        default=[],
        metavar="TAG",
        help="Run touchstone's invariants over all scenes with this tag (repeatable).",
    )
    group.addoption(
        "--touchstone-no-cache",
        action="store_true",
        help="Play every run, and keep none for later sessions (--cache-clear removes the kept ones).",
    )
    group.addoption("--touchstone-profile", default="", help="Profile (default: the first of the engine).")


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers; add the suite of invariants where a tag is asked for."""
    for line in MARKERS:
        config.addinivalue_line("markers", line)
    tags = config.getoption("--touchstone-tag")
    if tags:
        from touchstone.scenarios.catalogue import tags as every_tag

        for tag in tags:
            if tag not in every_tag():
                raise pytest.UsageError(f"--touchstone-tag {tag}: unknown (valid: {', '.join(every_tag())})")
        if str(SUITE) not in config.args and not hasattr(config, "workerinput"):
            # Without paths, pytest would collect the tests of the current folder too.
            named = config.args_source is pytest.Config.ArgsSource.ARGS
            config.args[:] = [*(config.args if named else ()), str(SUITE)]
    for name in dict.fromkeys(config.getoption("--touchstone-engine")):
        _registered(name)


def _registered(name: str) -> str:
    from touchstone.adapters.contract import AdapterError
    from touchstone.adapters.registry import registered

    try:
        return registered(name)
    except AdapterError as error:
        raise pytest.UsageError(str(error)) from error


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for each scene and engine that markers or options name."""
    for fixture in ("scenario", "engine"):
        markers = list(metafunc.definition.iter_markers(fixture))
        if fixture not in metafunc.fixturenames or _is_parametrized(metafunc, fixture):
            continue
        names = list(dict.fromkeys(name for marker in markers for name in marker.args))
        if fixture == "engine" and not names:
            names = metafunc.config.getoption("--touchstone-engine") or ["reference"]
        if names and _is_ours(metafunc, fixture):
            metafunc.parametrize(fixture, names, indirect=True, scope="session")


def _is_parametrized(metafunc: pytest.Metafunc, fixture: str) -> bool:
    """Whether the test itself parametrizes an argument of this name."""
    for marker in metafunc.definition.iter_markers("parametrize"):
        names = marker.args[0] if marker.args else marker.kwargs.get("argnames", "")
        if fixture in (names.replace(",", " ").split() if isinstance(names, str) else names):
            return True
    return False


def _is_ours(metafunc: pytest.Metafunc, fixture: str) -> bool:
    """Whether the test takes the fixture of this module, not one of the same name."""
    found = metafunc._arg2fixturedefs.get(fixture, ())
    return bool(found) and getattr(found[-1].func, "__module__", "") == __name__


@pytest.fixture(scope="session")
def scenario(request: pytest.FixtureRequest) -> Scenario:
    """The scene of the test's marker `scenario`."""
    from touchstone.reports.assertions.player import scene_of

    given = getattr(request, "param", None)
    if given is None:
        pytest.fail('the fixture `scenario` needs a scene: @pytest.mark.scenario("slide")', pytrace=False)
    try:
        return scene_of(given)
    except ValueError as error:
        said = str(error)
    pytest.fail(said, pytrace=False)


@pytest.fixture(scope="session")
def engine(request: pytest.FixtureRequest) -> str:
    """Name of the engine of the test's marker `engine`, or of `--touchstone-engine`."""
    try:
        return _registered(request.param)
    except pytest.UsageError as error:
        said = str(error)
    pytest.fail(said, pytrace=False)


@pytest.fixture(scope="session")
def play(pytestconfig: pytest.Config) -> Iterator[Callable[..., Recording]]:
    """Function that plays a scene on an engine and returns the recording (`Player.play`)."""
    from touchstone.reports.assertions.player import PlayCache, Player

    keeps = pytestconfig.pluginmanager.hasplugin("cacheprovider")
    keeps &= not pytestconfig.getoption("--touchstone-no-cache")
    folder = pytestconfig.cache.mkdir(CACHE) if keeps and pytestconfig.cache is not None else None
    player: Player = Player(pytestconfig.getoption("--touchstone-profile"), PlayCache(folder))
    yield player.play
    player.close()
    pytestconfig.stash[COUNTS] = (player.played, player.found)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say how many runs were played, and how many an earlier session had played."""
    from touchstone.scenarios.plural import plural

    played, found = config.stash.get(COUNTS, (0, 0))
    if found:
        terminalreporter.write_line(
            f"touchstone: {plural(played, 'run')} played, {found} kept from earlier sessions"
        )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Write what assertions of a test and of its fixtures measure into the properties of the test."""

    def write(finding: Finding) -> None:
        unit = f" [{finding.unit}]" if finding.unit != "1" else ""
        item.user_properties.append((f"{finding.metric}{unit}", finding.value))
        item.user_properties.append((f"{finding.metric} limit{unit}", finding.limit))

    token = LISTENER.set(write)
    try:
        return (yield)
    finally:
        LISTENER.reset(token)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Iterator[None]:
    """A broken invariant is reported by its message and the line that asserts it."""
    report: Any = yield
    if call.excinfo is not None and isinstance(call.excinfo.value, InvariantError):
        inner = (SUITE.parent, Path(pytest.__file__).parents[1] / "_pytest", Path(pluggy.__file__).parent)
        frames = [f for f in call.excinfo.traceback if Path(str(f.path)).parent not in inner]
        at = frames[-1] if frames else None
        line = f"\n{at.path}:{at.lineno + 1}: {str(at.statement).strip()}" if at is not None else ""
        report.longrepr = f"{call.excinfo.value}{line}"  # pytest's summary has the first line
    return report

"""Numbers of things in messages."""

import pytest

from touchstone.scenarios.plural import plural


@pytest.mark.parametrize(
    ("word", "several"),
    [("scene", "scenes"), ("body", "bodies"), ("play", "plays"), ("mesh", "meshes"), ("vertex", "vertices")],
)
def test_one_thing_is_no_plural(word, several):
    """One thing is a singular; none and several are plurals."""
    assert plural(1, word) == f"1 {word}"
    assert [plural(count, word) for count in (0, 2)] == [f"0 {several}", f"2 {several}"]

"""Groups of pairs hold every pair once, with its facts; equal bodies are few groups."""

import json
from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from touchstone.adapters.contract import Manifest, PairFacts
from touchstone.adapters.recorder import manifest_json
from touchstone.scenarios.truths.pair_groups import grouped, ungrouped

NAMES = [f"body-{k}" for k in range(9)]


@given(st.lists(st.sampled_from([None, 0.1, 0.2]), min_size=36, max_size=36))
def test_groups_hold_each_pair_once(facts):
    """Any table of facts comes back, with pairs that have none."""
    pairs = {pair: own for pair, own in zip(combinations(NAMES, 2), facts) if own is not None}
    found = [(tuple(sorted(pair)), own) for own, a, b in grouped(pairs) for pair in ungrouped(a, b)]
    assert len(found) == len(pairs)
    assert dict(found) == pairs


def test_equal_bodies_are_few_groups():
    """60 balls and a floor: balls with balls, and balls with the floor."""
    balls = [f"ball {k}" for k in range(60)]
    pairs = dict.fromkeys(combinations(balls, 2), (0.5, 0.2))
    pairs |= {("floor", ball): (0.1, 0.3) for ball in balls}
    assert sorted((facts, *sorted((len(a), len(b)))) for facts, a, b in grouped(pairs)) == [
        ((0.1, 0.3), 1, 60),
        ((0.5, 0.2), 60, 60),
    ]


def test_a_manifest_of_a_thousand_bodies_is_small():
    """499,500 pairs took 45 MB a column; names and facts of two materials take 100 kB."""
    facts = tuple(
        PairFacts(f"a{i}", f"a{k}", 0.5 if (i + k) % 2 else 0.25, 0.3)
        for i, k in combinations(range(1000), 2)
    )
    text = manifest_json(Manifest("test", "1", "default", 0.01, {}, {}, facts))
    assert len(text) < 100_000
    assert len(json.loads(text)["pairs"]) == 3

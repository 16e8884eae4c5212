"""Depth of a pair that a chain resolves by `ccd_ik`, and the side of the pair that it moves."""

from touchstone.reference_impl.core.kernel import kernel


@kernel
def chain_depth(bodies, pair, driver, d, chain, rounds):
    """Side of a pair that chain `chain` of driver d moves, and the depth that it resolves.

    If both bodies are links of the chain, the outer one moves. Of overlap with a chain processed later, the
    chain resolves half, in its first round (`rounds` 0) only; the later chain resolves the rest.

    Returns:
        (side, depth): 1.0 for B, -1.0 for A or 0.0 for none, and the depth [m].
    """
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    at_a, at_b = a["driver"] == d and a["chain"] == chain, b["driver"] == d and b["chain"] == chain
    if not at_a and not at_b:
        return 0.0, 0.0
    if at_a and at_b:
        return 1.0 if b["hinge"] > a["hinge"] else -1.0, pair["depth"]
    side, other = (1.0, a) if at_b else (-1.0, b)
    share = 1.0
    if other["driver"] == d and other["chain"] >= 0:
        if driver["rank"][other["chain"]] > driver["rank"][chain]:
            if rounds > 0:
                return 0.0, 0.0
            share = 0.5
    return side, share * pair["depth"]

"""Numbers of things in messages."""

IRREGULAR = {"vertex": "vertices"}
ENDINGS = ("s", "x", "sh", "ch")
"""Ends of words whose plural ends in `es`."""


def plural(count: int, word: str) -> str:
    """A number of things, in the plural where it is due: "1 body", "2 bodies"."""
    if count == 1:
        return f"{count} {word}"
    if word in IRREGULAR:
        return f"{count} {IRREGULAR[word]}"
    if word.endswith("y") and word[-2:-1] not in "aeiou":
        return f"{count} {word[:-1]}ies"
    return f"{count} {word}{'es' if word.endswith(ENDINGS) else 's'}"

"""Faults in a robot's file, before MuJoCo reads it: masses that no body has, joints that make no tree."""

from collections.abc import Collection, Iterator, Mapping
from difflib import get_close_matches
from math import isfinite

from touchstone.adapters.robots.fused_inertia import WORLD_LINK, links_and_joints
from touchstone.adapters.robots.xml_source import Element
from touchstone.scenarios.avatar.number_checks import LARGEST

Numbers = Mapping[str, tuple[str, ...]]
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Numbers that may be negative here: of links that are fixed to each other the sum counts."""
URDF_NUMBERS: Numbers = {"mass": ("value",), "inertia": MOMENTS}
MJCF_NUMBERS: Numbers = {"geom": ("mass", "density"), "inertial": ("mass",), "mesh": ("density",)}
"""Attributes that are masses, densities or moments of inertia, by element."""
NAMED = ("link", "body", "geom", "mesh")
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def number_faults(root: Element, asked: Numbers, owner: Element | None = None) -> Iterator[str]:
    """A line per mass, density or moment that is negative, not finite, or larger than LARGEST, named by its
    link or body (`owner`); texts that are no numbers are left to MuJoCo."""
    owner = root if root.tag in NAMED and root.attributes.get("name") else owner
    for name in asked.get(root.tag, ()):
        text = root.attributes.get(name, "0")
        try:
            value = float(text)
        except ValueError:
            continue
        least = -LARGEST if name in MOMENTS else 0.0
        if not (isfinite(value) and least <= value <= LARGEST):
            what = root.tag if name == "value" else name
            reason = f"{what}: found {text}, expected a number from {least:g} to {LARGEST:g}"
            yield (owner or root).named(reason)
    for child in root.children:
        yield from number_faults(child, asked, owner)


def link_faults(root: Element) -> Iterator[str]:
    """A line per joint of a URDF that connects no two links of the file, or that makes no tree of them."""
    links, joints = links_and_joints(root)
    above: dict[str, tuple[Element, str]] = {}
    for joint, parent, child in joints:
        kind = joint.attributes.get("type", "")
        if kind not in JOINT_TYPES:
            yield joint.named(f"type: found {kind!r}, expected {', '.join(JOINT_TYPES)}")
        ends = {"parent": parent, "child": child}
        lacking = [end for end, link in ends.items() if link is None]
        unknown = [end for end, link in ends.items() if link not in links and link not in (None, WORLD_LINK)]
        for end in lacking:
            yield joint.named(f'it has no {end}; expected <{end} link="NAME"/>')
        for end in unknown:
            names = [str(link) for link in links]
            yield joint.named(f"its {end} {ends[end]!r} is no link of the file{_near(ends[end], names)}")
        if lacking or unknown:
            continue
        if parent == child:
            yield joint.named(f"it connects link {parent!r} to itself")
        elif child in above:
            other = above[child][0]
            yield joint.named(
                f"link {child!r} has a parent by joint {other.attributes.get('name')!r} (line {other.line}) "
                "too: a URDF has no closed loops; leave out one of the joints, and close the loop in the "
                "scene (body_joints)"
            )
        elif _reaches(above, parent, child):
            yield joint.named(f"link {child!r} is above its own parent {parent!r}: no link is the root")
        else:
            above[child] = joint, parent


def _reaches(above: Mapping[str, tuple[Element, str]], link: str, wanted: str) -> bool:
    """Whether a link is among those above another."""
    while link in above:
        link = above[link][1]
        if link == wanted:
            return True
    return False


def _near(text: str, names: Collection[str]) -> str:
    near = get_close_matches(text, names, n=1, cutoff=0.5)
    return f"; did you mean {near[0]!r}?" if near else ""

"""Which masses and inertias an arm can have, and the nearest possible ones where a file states others.

A body's inertia I about its centre of mass is possible where its second moment of mass, S = tr(I)/2 1 - I, has no
negative eigenvalue: each principal moment is at most the sum of the others (Wensing, Kim and Slotine, "Linear matrix
inequalities for physically consistent inertial parameter identification", IEEE RA-L 3, 2018, equations 9 and 15).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.robot.tree import Inertial, Joint, Link, Tree, moments_of

SLACK = 1e-6  # relative: what rounding in a file does to the moments of a thin rod or plate
ROUNDING = 1e-14  # relative: what Drake forgives
NOTHING = 1e-12  # [kg m^2] moments far below this are zeros with rounding


def check(tree: Tree, group: list[str], repair: bool) -> None:
    """Refuse what no body can have in a rigid group of links, the first of which carries the others.

    A link of it may state what no body alone has if all of them together are possible: their sum is what the joint
    feels. repair: put the nearest possible moments in the place of impossible ones. Both are noted.
    """
    for link in group:
        if tree.links[link].unknown:
            raise tree.fail(f"link '{link}': {tree.links[link].unknown}")
    wrong = {link: reason for link in group if (reason := _wrong(tree, link))}
    if repair:
        for link in wrong:
            _repair(tree, tree.links[link])
        wrong = {link: reason for link in wrong if (reason := _wrong(tree, link))}
    if not wrong:
        for link in group:
            inertial = tree.links[link].inertial
            if inertial is not None and _shortfall(inertial) > ROUNDING:
                tree.links[link].inertial = nearest(inertial)
        return
    together = combined(tree, group)
    if together.mass <= 0.0 or _shortfall(together) > SLACK:
        raise tree.fail(next(iter(wrong.values())))
    for link in group:
        tree.links[link].inertial = None
    tree.links[group[0]].inertial = nearest(together) if _shortfall(together) > ROUNDING else together
    tree.notes.append(f"{', '.join(wrong)}: no body alone has that inertia; {group[0]} has the sum of what it carries")


def drop(tree: Tree, group: list[str]) -> None:
    """Take away what no body can have, where it moves nothing: Drake would put something else in its place."""
    for link in (tree.links[name] for name in group):
        if link.inertial is not None and (link.mass <= 0.0 or _shortfall(link.inertial) > SLACK):
            link.inertial = Inertial(link.mass, link.inertial.com) if link.mass > 0.0 else None


def _wrong(tree: Tree, link: str) -> str:
    """Why no body has the inertia of a link; empty if one can."""
    inertial = tree.links[link].inertial
    if inertial is None:
        return ""
    if inertial.mass < 0.0:
        raise tree.fail(f"link '{link}' has the mass {inertial.mass:g} kg, expected none or more")
    if inertial.mass == 0.0 and any(inertial.moments):
        return f"link '{link}' has moments of inertia and no mass; state its mass, or neither"
    if _shortfall(inertial) <= SLACK:
        return ""
    return (
        f"link '{link}' has an inertia that no body has (principal moments {_listed(inertial)} kg m^2; each at most "
        "the sum of the others); mend it, or take the nearest possible with robot.repair_inertia=true"
    )


def _repair(tree: Tree, link: Link) -> None:
    if link.inertial is not None and link.inertial.mass > 0.0:
        stated, link.inertial = link.inertial, nearest(link.inertial)
        moments = f"{_listed(link.inertial)} kg m^2, not {_listed(stated)}"
        tree.notes.append(f"robot.repair_inertia: link {link.name} has the principal moments {moments}")


def _listed(inertial: Inertial) -> str:
    return ", ".join(f"{moment:.3g}" for moment in np.linalg.eigvalsh(inertial.matrix))


def _shortfall(inertial: Inertial) -> float:
    """By how much the worst principal moment misses what is possible, relative to the largest."""
    a, b, c = np.linalg.eigvalsh(inertial.matrix)
    return float(max(-a, c - a - b) / max(abs(a), abs(c), NOTHING))


def nearest(inertial: Inertial) -> Inertial:
    """The same mass with the nearest possible second moment of mass (in the Frobenius norm)."""
    matrix = inertial.matrix
    values, axes = np.linalg.eigh(np.trace(matrix) / 2 * np.eye(3) - matrix)
    second = (axes * np.maximum(values, 0.0)) @ axes.T
    return replace(inertial, moments=moments_of(np.trace(second) * np.eye(3) - second))


def combined(tree: Tree, group: list[str]) -> Inertial:
    """Mass, centre and moments of a rigid group of links, in the frame of its first."""
    carrier = tree.carriers()
    mass, first, about = 0.0, np.zeros(3), np.zeros((3, 3))
    for link in group:
        inertial = tree.links[link].inertial
        if inertial is None:
            continue
        center, turn = np.array(inertial.com), Rotation.from_euler("xyz", inertial.rpy)
        while link != group[0]:
            joint = carrier[link]
            place = Rotation.from_euler("xyz", joint.rpy)
            center, turn, link = place.apply(center) + joint.xyz, place * turn, joint.parent
        mass, first = mass + inertial.mass, first + inertial.mass * center
        about += turn.as_matrix() @ inertial.matrix @ turn.as_matrix().T + inertial.mass * _lever(center)
    com = first / mass if mass else first
    return Inertial(mass, tuple(com.tolist()), moments=moments_of(about - mass * _lever(com)))


def _lever(arm: Array) -> Array:
    """Moments (3, 3) [m^2] of a unit point mass at `arm`."""
    return float(arm @ arm) * np.eye(3) - np.outer(arm, arm)


def check_carried(tree: Tree, chain: list[Joint], moving: list[Joint]) -> None:
    """Every moving joint carries a mass of its own, or is one of several that stand for one with more freedoms."""
    names = {joint.name for joint in moving}
    massless, virtual = [], []
    for joint in moving:
        if sum(tree.links[link].mass for link in tree.group(joint.child, names)) > 0.0:
            continue
        after = chain[chain.index(joint) + 1 :]
        following = next((i for i, one in enumerate(after) if one.name in names), None)
        between = [] if following is None else after[: following + 1]
        if between and _is_virtual(tree.links[joint.child], joint, between):
            virtual.append(joint.child)
        else:
            massless.append(joint.child)
    if massless:
        raise tree.fail(
            f"no mass on link{'s' if len(massless) > 1 else ''} {', '.join(massless)}; every moving link needs an "
            "<inertial> with a mass"
        )
    if virtual:
        tree.notes.append(f"{', '.join(virtual)} without a mass: carried by what follows, as joints of one place")


def _is_virtual(link: Link, joint: Joint, between: list[Joint]) -> bool:
    """Nothing to see or to touch, and no length that a link would span: as in the x, y and yaw of a mobile base."""
    span = np.max(np.abs([one.xyz for one in between]))
    return not link.solid and (joint.kind == "prismatic" or span < 1e-9)

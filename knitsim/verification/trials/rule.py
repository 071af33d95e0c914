"""Which random cases can exist and be solved, from their inputs alone; knows nothing of the solver."""

import math

from knitsim.verification.judge.given import Barrier
from knitsim.verification.trials.law import JERSEY, PEIRCE

AT_REST = 0.8  # distance of yarns that touch in an unloaded fabric, in diameters
MUNDEN = {"course": 3.8, "wale": 5.0}  # l over the spacing at rest that is pulled, of a plain knit
WIDEST_PATTERN = 3.0  # l over the wale spacing at rest: no garter and no seed is wider
TIGHT_WALE, TIGHT_COURSE = 4.0, 2.0  # diameters: closest spacings

# Limits that the method states: of its resolution (contact points d/4.4 to d/96 apart, d/8 by the
# width of a contact), of the yarn and of how tightly a fabric of a thickness may be bent.
LEAST_POINTS, LEAST_BULK, LEAST_RIGIDITY, MOST_FRICTION = 24, 4.0, 1e-15, 1.0
CONTACT_SPACING, NARROWEST, WIDEST = 1.0 / 8.0, 1.0 / 96.0, 1.0 / 4.4
NARROW = (NARROWEST / CONTACT_SPACING) ** 4  # B/(K d^3) below which contacts are narrower than that
TIGHTEST = 0.5  # curvature times half the thickness
THICK = 2.5  # half the thickness of a fabric, in diameters, yarn included


def squeezed(case, load):
    """Distance (m) to which a load (N) presses two straight yarns that cross at a right angle.

    With an energy v(D) per length squared of both they repel with 2 pi D v(D).
    """
    low, high = case.contact.core, case.diameter
    for _ in range(60):
        middle = 0.5 * (low + high)
        force = 2.0 * math.pi * middle * case.contact.at(middle, case.diameter)[0]
        low, high = (middle, high) if force > load else (low, middle)
    return 0.5 * (low + high)


def squeezed_at_break(case):
    """The distance (m) to which a yarn about to break, turning round another one, presses it.

    It does so with twice its tension at most.
    """
    return squeezed(case, 2.0 * case.law_tension[-1])


def at_rest(case):
    """Distance (m) of yarns that touch in an unloaded fabric: 0.8 d, or to what B/core^2 presses a shell."""
    if isinstance(case.contact, Barrier):
        return AT_REST * case.diameter
    return squeezed(case, case.bending_rigidity / case.contact.core**2)


def slender(case):
    """Bending rigidity over what compression can bear, B/(K d^3); a core law is soft: 1."""
    if not isinstance(case.contact, Barrier):
        return 1.0
    return case.bending_rigidity / (case.contact.stiffness * case.diameter**3)


def contact_spacing(case):
    """Spacing of the contact points (m) that the method states for a yarn.

    Two crossing yarns touch along about d (B/(K d^3))^(1/4).
    """
    spacing = case.diameter * min(WIDEST, max(NARROWEST, CONTACT_SPACING * slender(case) ** 0.25))
    if isinstance(case.contact, Barrier):
        return spacing
    return min(spacing, 2.0 * WIDEST * (case.diameter - case.contact.core))


def impossible(case):
    """Why the case cannot be solved, from its inputs alone: reasons, one line each; none if it can.

    At the stated density a wale must have room for the four yarns that lie side by side in it and a
    course for two, and the loop must be long enough to go round its neighbours as Peirce's does
    (l = 2 c + w + 5.94 d), all with yarns as close as they are at rest.  Then the tests.
    """
    numbers = (
        case.wale_spacing, case.course_spacing, case.loop_length, case.diameter,
        case.contact.stiffness,
    )  # fmt: skip
    if not all(math.isfinite(x) and x > 0.0 for x in numbers):
        return ("a length or stiffness is no positive number",)
    if not case.bending_rigidity >= LEAST_RIGIDITY:
        return ("no bending rigidity",)
    if not case.contact.core < case.diameter:
        return ("a core thicker than the yarn",)
    reasons, length, close = [], case.loop_length, at_rest(case)
    if not (0.0 <= case.friction <= MOST_FRICTION and 0.0 <= case.set_fraction <= 1.0):
        reasons.append("friction or set out of range")
    if case.bending_hysteresis < 0.0:
        reasons.append("hysteresis below zero")
    if length < LEAST_BULK * case.diameter:
        reasons.append("yarn too thick for its loop")
    if length > 4.0 * (case.wale_spacing + 2.0 * case.course_spacing):
        reasons.append("loop too long to stay looped")
    if case.wale_spacing < TIGHT_WALE * close:
        reasons.append("stated wale spacing: no room for four yarns")
    if case.course_spacing < TIGHT_COURSE * close:
        reasons.append("stated course spacing: no room for two yarns")
    if length < 2.0 * case.course_spacing + case.wale_spacing + PEIRCE * close:
        reasons.append("loop too short to interlace at the stated density")
    if case.points < LEAST_POINTS or case.points % 4:
        reasons.append("control points: too few, or no multiple of 4")
    if case.contacts is not None and length / case.contacts > 2.0 * contact_spacing(case):
        reasons.append("contact points too far apart")
    if slender(case) < NARROW:
        reasons.append("contact narrower than contact points can be close")
    for test in case.tests:
        reasons += [r for r in impossible_test(case, test) if r not in reasons]
    return tuple(reasons)


def impossible_test(case, test):
    """Why a test cannot be gone through by the fabric.

    Under the asked strain the yarn must be unbroken.  For that the spacings at rest are taken from
    Munden's constants and the yarns as close as breaking them would press them (x): pulled along the
    course, a loop's two legs still span two courses of 2 x each, l (1 + e) >= w + 8 x; along the wale
    it is Peirce's loop at its narrowest, l (1 + e) >= 2 c + (4 + 5.94) x.  Held across, or pulled both
    ways, the other spacing is not at its narrowest: l (1 + e) >= w + 2 c + 5.94 x.
    """
    length, longest = case.loop_length, case.loop_length * (1.0 + case.breaking_strain)
    if test.kind == "bending":
        curvature = max(abs(x) for x in test.path)
        if curvature * THICK * case.diameter > TIGHTEST:
            yield "curvature too tight for the thickness"
    if test.kind not in ("tension", "biaxial"):
        return
    close = squeezed_at_break(case)
    if not case.contact.core and close < contact_spacing(case):
        yield "yarn so soft that a crossing is lost between contact points before it breaks"
    pulled = test.path[-1] if test.kind == "biaxial" else (test.path[-1],) * 2
    course = MUNDEN["course"] if case.pattern == JERSEY else WIDEST_PATTERN
    width = length / course * (1.0 + (pulled[0] if test.direction != "wale" else 0.0))
    height = length / MUNDEN["wale"] * (1.0 + (pulled[1] if test.direction != "course" else 0.0))
    if test.kind == "biaxial" or test.lateral == "held":
        needed = width + 2.0 * height + PEIRCE * close
    elif test.direction == "course":
        needed = width + 4.0 * TIGHT_COURSE * close
    else:
        needed = 2.0 * height + (TIGHT_WALE + PEIRCE) * close
    if longest < needed:
        yield f"{test.name}: the yarn breaks before"

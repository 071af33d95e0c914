"""Random and worst-case fabrics and tests for the equilibrium model: how drawn, which are possible.

Ranges reach well beyond :mod:`campaign`: bending rigidity over six decades and none, stiffness over
four, friction to 1, strain asked in one jump, coarse grids, loops that hardly close, tight and open
fabrics, each pulled or bent.  Law and rule stand here before the campaign is run, and neither knows
the solver.  A case is made from the seed and its own number:

>>> draw(7) == draw(7)
True
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from knitsim.verification import campaign

SEED = 20251  # of the campaign; trials before it used others
CASES = 5000
REFINED = 10  # one case in so many is solved again at twice the resolution

# Low, high; "log" where the logarithm is drawn uniformly.  Meaning and units: campaign.RANGES.
RANGES = {
    "diameter": (0.05e-3, 1e-3, "log"),
    "loop_over_diameter": (12.5, 60.0, "log"),
    "kw": (2.6, 4.8, ""),
    "kc": (4.0, 7.0, ""),
    "stiffness": (1e7, 1e11, "log"),
    "kink": (0.003, 0.02, ""),
    "second_slope": (1.0 / 3.0, 3.0, "log"),
    "breaking_strain": (0.04, 0.15, ""),
    "bending": (1e-6, 1.0, "log"),
    "compression": (1e-3, 1.0, "log"),
    "friction": (0.0, 1.0, ""),
    "course_strain": (0.05, 1.2, ""),
    "wale_strain": (0.05, 0.8, ""),
    "curvature": (25.0, 500.0, "log"),  # 1/m, either sign
}  # fmt: skip
FRICTIONLESS = 0.4  # part of the cases that have no friction at all
HELD = 0.2  # part whose other spacing is held
RECOVERING = 0.25  # part of the tests that go back
FINE = 0.1  # part solved more finely than by default

# Worst cases: what they set, drawn anew in these ranges.  The rest of a case is as of any other.
FAMILIES = {
    "any": {},
    "limp": {"bending": (1e-6, 1e-4, "log")},
    "rigid": {"bending": (0.3, 1.0, "log"), "compression": (1e-3, 1e-2, "log")},
    "stiff": {"stiffness": (1e10, 1e11, "log"), "compression": (0.1, 1.0, "log")},
    "rough": {"friction": (0.8, 1.0, "")},
    "jump": {"course_strain": (0.5, 0.8, ""), "wale_strain": (0.4, 0.6, "")},
    "coarse": {},
    "tight": {"loop_over_diameter": (12.0, 14.0, ""), "kw": (3.4, 4.0, ""), "kc": (5.0, 7.0, "")},
    "open": {"loop_over_diameter": (40.0, 80.0, "")},
    "degenerate": {},
    "bent": {"curvature": (500.0, 2000.0, "log")},
    "no input": {},
}  # fmt: skip
ANY = 0.4  # part of the cases of no family; the others share the rest equally
TESTS = ("course", "wale", "course bending", "wale bending")
TENSION = 0.6  # part of the cases that are pulled; the others are bent
LEVELS = (1, 2, 4)  # strains or curvatures asked
PAIR = 0.01  # of the largest: after each level another state so much further
INCREMENTS = (0.1, 0.5)  # of strain in one solved step, asked of rough jumps

# Limits that the method states: of its resolution (contact points d/8 to d/96 apart, d/11 by the
# width of a contact), of the yarn and of how tightly a fabric of a thickness may be bent.
LEAST_POINTS, LEAST_BULK, LEAST_RIGIDITY, MOST_FRICTION = 24, 12.0, 1e-15, 1.0
CONTACT_SPACING, NARROWEST = 1.0 / 11.0, 1.0 / 96.0
WIDEST = 1.0 / 8.0
NARROW = (NARROWEST / CONTACT_SPACING) ** 4  # B/(K d^3) below which contacts are narrower than that
SHORT = 0.3  # of the strains of such fabrics
TIGHTEST = 0.5  # curvature times half the thickness
THICK = 2.5  # half the thickness of a fabric, in diameters, yarn included


@dataclass(frozen=True)
class StressCase:
    """One random fabric, SI, and the one test asked of it.

    fabric: :class:`campaign.Case` with the strains asked (0 in the direction that is not pulled).
    family: name in FAMILIES; test: name in TESTS; held: whether the other spacing (in bending both) is
    held; recovers: whether the test goes back, in tension to zero force, in bending through zero to
    the opposite side; levels: how many strains or curvatures are asked; increment: of strain, of one
    solved step with friction, None for the default; curvature: largest (1/m), signed; points: control
    points per loop; contacts: contact points per loop, None for the default; refined: whether the
    case is solved again at twice the resolution.
    """

    number: int
    family: str
    test: str
    fabric: campaign.Case
    curvature: float
    held: bool
    recovers: bool
    levels: int
    increment: float | None
    points: int
    contacts: int | None
    refined: bool

    @property
    def kind(self):
        return "bending" if self.test.endswith("bending") else "tension"

    @property
    def direction(self):
        return self.test.partition(" ")[0]

    @property
    def largest(self):
        """Strain or curvature (1/m) asked in the end."""
        return self.curvature if self.kind == "bending" else self.fabric.asked(self.direction)

    @property
    def coordinates(self):
        """Strains or curvatures asked on the way out: pairs, the last at the largest.

        Except in a jump another state comes first, close to the start, where friction sets in.
        """
        ends = self.largest * np.arange(1, self.levels + 1) / self.levels
        pairs = np.stack([ends - PAIR * self.largest, ends], axis=1).ravel()
        return pairs if self.family == "jump" else np.concatenate([[PAIR * self.largest], pairs])

    @property
    def path(self):
        """Curvatures asked of a bending test, (n,), from the flat fabric on."""
        out = [0.0, *self.coordinates]
        if self.recovers:
            out += [(1.0 - PAIR) * self.curvature, 0.0, -self.curvature]
        return np.array(out)


def draw(number, seed=SEED):
    """Case ``number`` (0 on) of the campaign with this seed."""
    random = np.random.default_rng([seed, number])
    others = [name for name in FAMILIES if name != "any"]
    family = "any" if random.random() < ANY else others[random.integers(len(others))]
    pulled = random.random() < TENSION
    if family in ("jump", "bent"):
        pulled = family == "jump"
    test = TESTS[random.integers(2) + (0 if pulled else 2)]
    ranges = RANGES | FAMILIES[family]
    value = {name: _drawn(random, *ranges[name]) for name in RANGES}
    rubs = random.random() >= FRICTIONLESS or family == "rough"
    levels = 1 if family == "jump" else int(random.choice(LEVELS))
    sign = 1.0 if random.random() < 0.5 else -1.0
    held, recovers = random.random() < HELD, random.random() < RECOVERING
    increment = float(random.choice(INCREMENTS)) if family == "jump" and rubs else None
    # Back from a jump there is no state to go through.
    recovers = recovers and family != "jump"
    points = 96 if random.random() < FINE else 48
    contacts = None
    if family == "coarse":
        points = int(random.choice((12, 20, 24, 26, 28, 32, 40)))
    d = value["diameter"]
    length = value["loop_over_diameter"] * d
    width, height = length / value["kw"], length / value["kc"]
    if family == "degenerate":
        width, height = _hardly_closed(random, length, d)
    slope = value["stiffness"] * d**2
    kink, end = value["kink"], value["breaking_strain"]
    at_kink = slope * kink
    fabric = campaign.Case(
        number, width, height, length, d,
        value["bending"] * slope * d**2 / 16.0,
        (0.0, kink, end),
        (0.0, at_kink, at_kink + value["second_slope"] * slope * (end - kink)),
        value["compression"] * slope / d,
        value["friction"] if rubs else 0.0,
        value["course_strain"] if test == "course" else 0.0,
        value["wale_strain"] if test == "wale" else 0.0,
    )  # fmt: skip
    if family == "coarse" and random.random() < 0.5:
        # Contact points up to four times as far apart as the contact needs.
        spacing = contact_spacing(fabric) * random.uniform(1.0, 4.0)
        contacts = 4 * max(1, round(length / spacing / 4.0))
    refined = bool(random.integers(REFINED) == 0)
    if _slender(fabric) < NARROW:
        # Solved with thousands of contact points: a short test.
        levels, recovers, points, refined = 1, False, min(points, 48), False
        fabric = replace(
            fabric,
            course_strain=SHORT * fabric.course_strain,
            wale_strain=SHORT * fabric.wale_strain,
        )
    if family == "no input":
        fabric = replace(fabric, **_no_input(random, fabric))
    return StressCase(
        number, family, test, fabric, sign * value["curvature"], held, recovers, levels, increment,
        points, contacts, refined,
    )  # fmt: skip


def _drawn(random, low, high, scale):
    part = random.random()
    return low * (high / low) ** part if scale == "log" else low + (high - low) * part


def _hardly_closed(random, length, diameter):
    """Spacings at which the loop hardly reaches its neighbours, or has hardly room for its yarns.

    Peirce's loop, l = 2 c + w + 5.94 d, with the yarn pressed to 0.7 d .. d.
    """
    rest = length - campaign.PEIRCE * random.uniform(0.7, 1.0) * diameter
    share = random.uniform(0.2, 0.6)  # of the rest that is taken by the wale spacing
    return rest * share, 0.5 * rest * (1.0 - share)


def _no_input(random, fabric):
    """One input that no fabric has."""
    wrong = (
        {"bending_rigidity": 0.0},
        {"bending_rigidity": -fabric.bending_rigidity},
        {"friction": 1.0 + random.uniform(0.1, 2.0)},
        {"friction": -0.1},
        {"diameter": 0.0},
        {"diameter": fabric.loop_length / random.uniform(2.0, 11.0)},
        {"loop_length": math.nan},
        {"wale_spacing": math.inf},
        {"course_spacing": -fabric.course_spacing},
        {"contact_stiffness": 0.0},
        {"loop_length": 20.0 * fabric.loop_length},
    )
    return wrong[random.integers(len(wrong))]


def contact_spacing(fabric):
    """Spacing of the contact points (m) that the method states for a yarn.

    Two crossing yarns touch along about d (B/(K d^3))^(1/4).
    """
    spacing = CONTACT_SPACING * _slender(fabric) ** 0.25
    return fabric.diameter * min(WIDEST, max(NARROWEST, spacing))


def _slender(fabric):
    """Bending rigidity over what compression can bear, B/(K d^3)."""
    return fabric.bending_rigidity / (fabric.contact_stiffness * fabric.diameter**3)


def impossible(case):
    """Why the case cannot be solved, from its inputs alone: reasons, one line each; none if it can.

    The reasons of :func:`campaign.impossible`, for the direction that is pulled, and the limits that
    the method states.
    """
    fabric = case.fabric
    numbers = (
        fabric.wale_spacing, fabric.course_spacing, fabric.loop_length, fabric.diameter,
        fabric.contact_stiffness,
    )  # fmt: skip
    if not all(math.isfinite(x) and x > 0.0 for x in numbers):
        return ("a length or stiffness is no positive number",)
    reasons = []
    if not fabric.bending_rigidity >= LEAST_RIGIDITY:
        return ("no bending rigidity",)
    if not 0.0 <= fabric.friction <= MOST_FRICTION:
        reasons.append("friction out of range")
    if fabric.loop_length < LEAST_BULK * fabric.diameter:
        reasons.append("yarn too thick for its loop")
    if fabric.loop_length > 4.0 * (fabric.wale_spacing + 2.0 * fabric.course_spacing):
        reasons.append("loop too long to stay looped")
    if case.points < LEAST_POINTS or case.points % 4:
        reasons.append("control points: too few, or no multiple of 4")
    spacing = contact_spacing(fabric)
    if case.contacts is not None and fabric.loop_length / case.contacts > 2.0 * spacing:
        reasons.append("contact points too far apart")
    if _slender(fabric) < NARROW:
        reasons.append("contact narrower than contact points can be close")
    if case.kind == "tension" and campaign.squeeze_at_break(fabric) < spacing / fabric.diameter:
        reasons.append(
            "yarn so soft that a crossing is lost between contact points before it breaks"
        )
    if case.kind == "bending" and abs(case.curvature) * THICK * fabric.diameter > TIGHTEST:
        reasons.append("curvature too tight for the thickness")
    for reason in campaign.impossible(fabric):
        direction, _, rest = reason.partition(" strain: ")
        if not rest or direction == case.test:
            reasons.append(reason)
    return tuple(reasons)

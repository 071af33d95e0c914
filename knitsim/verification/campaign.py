"""Random plain knits for the equilibrium model: how they are drawn, and which of them can exist.

Both stand here before the campaign is run, and neither knows the solver.  A case is made from the
seed and its own number, so that any one can be made again alone:

>>> case = draw(7)
>>> case == draw(7)
True

The ranges are centred on the paper's cotton yarn where it has a value.
"""

import math
from dataclasses import dataclass

import numpy as np

SEED = 20250  # of the campaign; trials before it used others
CASES = 1000
POINTS = 48  # control points per loop, the solver's default

# Low, high; "log" where the logarithm is drawn uniformly.
RANGES = {
    "diameter": (0.1e-3, 0.5e-3, "log"),  # m
    "loop_over_diameter": (13.0, 40.0, ""),
    # Stated density: Munden's kw = l/w and kc = l/c, 3.8 and 5.0 in dry relaxed plain knits.
    "kw": (2.8, 4.6, ""),
    "kc": (4.4, 6.6, ""),
    # First slope of the tension law over the squared diameter (Pa); the cotton has 5.6e8.
    "stiffness": (1e8, 3e9, "log"),
    "kink": (0.003, 0.02, ""),  # strain at which the slope changes
    "second_slope": (1.0 / 3.0, 3.0, "log"),  # over the first: yielding or straightening yarns
    "breaking_strain": (0.04, 0.15, ""),
    # Bending rigidity over that of a solid rod of this stiffness, k1 d^2/16: from fibres that slide
    # over each other to nearly all locked.  Three decades; the cotton has 0.023.
    "bending": (7e-4, 0.7, "log"),
    # K d over the first slope; the cotton has 0.0064.
    "compression": (3e-3, 0.3, "log"),
    "friction": (0.0, 0.6, ""),
    "course_strain": (0.05, 1.0, ""),
    "wale_strain": (0.05, 0.6, ""),
}  # fmt: skip
FRICTIONLESS = 0.2  # part of the cases that have no friction at all

# The rule for possible.
AT_REST = 0.8  # distance of yarns that touch in an unloaded fabric, in diameters
MUNDEN = {"course": 3.8, "wale": 5.0}  # l over the spacing at rest that is pulled
PEIRCE = 5.94  # diameters: l = 2 c + w + 5.94 d
TIGHT_WALE, TIGHT_COURSE = 4.0, 2.0  # diameters: closest spacings


@dataclass(frozen=True)
class Case:
    """One random fabric, SI, and the strains asked of it.

    law_strain, law_tension: two linear pieces up to the breaking strain.  course_strain, wale_strain:
    asked of two tests, each from the fabric at rest, the other direction free.
    """

    number: int
    wale_spacing: float
    course_spacing: float
    loop_length: float
    diameter: float
    bending_rigidity: float
    law_strain: tuple
    law_tension: tuple
    contact_stiffness: float
    friction: float
    course_strain: float
    wale_strain: float

    @property
    def breaking_strain(self):
        return self.law_strain[-1]

    def asked(self, direction):
        """Strain asked along "course" or "wale"."""
        return self.course_strain if direction == "course" else self.wale_strain


def draw(number, seed=SEED):
    """Case ``number`` (0 on) of the campaign with this seed."""
    random = np.random.default_rng([seed, number])
    value = {}
    for name, (low, high, scale) in RANGES.items():
        part = random.random()
        value[name] = low * (high / low) ** part if scale == "log" else low + (high - low) * part
    if random.random() < FRICTIONLESS:
        value["friction"] = 0.0
    d = value["diameter"]
    length = value["loop_over_diameter"] * d
    slope = value["stiffness"] * d**2
    kink, end = value["kink"], value["breaking_strain"]
    at_kink = slope * kink
    return Case(
        number,
        length / value["kw"],
        length / value["kc"],
        length,
        d,
        value["bending"] * slope * d**2 / 16.0,
        (0.0, kink, end),
        (0.0, at_kink, at_kink + value["second_slope"] * slope * (end - kink)),
        value["compression"] * slope / d,
        value["friction"],
        value["course_strain"],
        value["wale_strain"],
    )


def squeeze_at_break(case):
    """Distance, in diameters, to which a crossing presses two yarns when they are about to break.

    A yarn that turns round another one presses on it with twice its tension at most.  Two straight
    yarns crossing at a right angle at x diameters repel, by the barrier K (1 - x^2)^2/x^2 per length
    squared integrated over both, with 2 pi K d (1 - x^2)^2/x.
    """
    load = 2.0 * case.law_tension[-1]
    capacity = 2.0 * math.pi * case.contact_stiffness * case.diameter
    low, high = 0.0, 1.0
    for _ in range(60):
        x = 0.5 * (low + high)
        low, high = (x, high) if capacity * (1.0 - x * x) ** 2 > load * x else (low, x)
    return 0.5 * (low + high)


def impossible(case):
    """Why the case cannot exist, from its inputs alone: reasons, one line each; none if it can.

    At the stated density a wale must have room for the four yarns that lie side by side in it and a
    course for two, and the loop must be long enough to go round its neighbours as Peirce's does
    (l = 2 c + w + 5.94 d), all with yarns pressed to 0.8 d.  Under the asked strain the yarn must be
    unbroken.  For that the spacings at rest are taken from Munden's constants and the yarns as close
    as breaking them would press them (x d): pulled along the course, a loop's two legs still span two
    courses of 2 x d each, l (1 + e) >= w + 8 x d; along the wale it is Peirce's loop at its
    narrowest, l (1 + e) >= 2 c + (4 + 5.94) x d.
    """
    d, length, reasons = case.diameter, case.loop_length, []
    if case.wale_spacing < TIGHT_WALE * AT_REST * d:
        reasons.append("stated wale spacing: no room for four yarns")
    if case.course_spacing < TIGHT_COURSE * AT_REST * d:
        reasons.append("stated course spacing: no room for two yarns")
    if length < 2.0 * case.course_spacing + case.wale_spacing + PEIRCE * AT_REST * d:
        reasons.append("loop too short to interlace at the stated density")
    longest = length * (1.0 + case.breaking_strain)
    close = squeeze_at_break(case) * d
    course = length / MUNDEN["course"] * (1.0 + case.course_strain)
    if longest < course + 4.0 * TIGHT_COURSE * close:
        reasons.append("course strain: the yarn breaks before")
    wale = length / MUNDEN["wale"] * (1.0 + case.wale_strain)
    if longest < 2.0 * wale + (TIGHT_WALE + PEIRCE) * close:
        reasons.append("wale strain: the yarn breaks before")
    return tuple(reasons)

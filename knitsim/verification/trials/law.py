"""Random knits and the tests asked of them: the law by which a campaign's cases are drawn.

A case is made from the seed and its own number, so that any one can be made again alone.  The ranges
are centred on the paper's cotton yarn where it has a value, those of the core law on the acrylic yarn of
Singal et al. 2024 (doi 10.1038/s41467-024-46498-z).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from knitsim.verification.judge.given import Barrier, Core

PEIRCE = 5.94  # diameters: l = 2 c + w + 5.94 d
NO_INPUT = "no input"  # the family of cases with an input that no fabric has

# Low, high; "log" where the logarithm is drawn uniformly.  With a core the diameter is that of the core.
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
    # Stiffness of a contact across over that along its normal, where friction has not yet slipped.
    "tangential": (0.3, 3.0, "log"),
    # Diameter over core; force of a crossing pressed half way to the core, over B/core^2; exponent.
    # The acrylic has 2.28, 0.014 and 2.4.
    "swell": (1.1, 2.4, ""),
    "shell": (1e-4, 3.0, "log"),
    "exponent": (1.4, 4.0, ""),
    "set": (0.05, 0.95, ""),
    # Couple by which the yarn's moment lags, over its moment at the mean curvature 2 pi/l.
    "hysteresis": (0.01, 0.2, "log"),
    "course_strain": (0.05, 1.0, ""),
    "wale_strain": (0.05, 0.6, ""),
    # Force per width across a pull or along the wale in shear, over B/(d l w): bends the loops as
    # much as the contacts of a loop at rest do.
    "load": (0.03, 3.0, "log"),
    "curvature": (25.0, 500.0, "log"),  # 1/m, either sign
    "angle": (2.0, 8.0, ""),  # degrees
}  # fmt: skip
# Part of the cases that have each of these.
SHARES = {
    "frictionless": 0.2, "core": 0.25, "set": 0.25, "hysteresis": 0.3, "full": 0.1, "several": 0.03,
    "held": 0.15, "loaded": 0.15, "recovers": 0.25, "biaxial": 0.25, "fine": 0.0,
}  # fmt: skip
CYCLES = (1, 1, 2, 3)  # of the tests that go back
JERSEY = ("k",)
# Rows of k and p from the bottom up: garter, 1x1 and 2x2 rib, seed, double seed, and one without a name.
PATTERNS = (
    ("k", "p"), ("kp",), ("kkpp",), ("kp", "pk"), ("kp", "kp", "pk", "pk"), ("kkp", "kpk"),
)  # fmt: skip
SEVERAL = ((2, 1), (1, 2), (2, 2))  # wales and courses of cells of several loops
POINTS = 48  # control points per loop, the solver's default
# Strains of stored states: close together where friction sets in, then this far apart at most.
FIRST, STORED = (0.0025, 0.005), 0.01
PAIR = 0.01  # of the largest: in pairs of states, how far apart


@dataclass(frozen=True)
class Asked:
    """One test of a fabric at rest.

    kind: tension, biaxial, shear or bending; direction: course or wale, where there is one; path:
    coordinates on the way out, in bending and shear on the whole way: strains (in a biaxial test
    pairs), angles (rad), curvatures (1/m).  lateral: "free", "held" or a force per width (N/m) across
    the pull; in shear of the wale spacing; in bending of both.  tension: along the wale in shear (N/m).
    cycles: of going out and back to zero force, 0 for no way back.  increment: of strain, of one solved
    step with friction, None for the default.
    """

    kind: str
    direction: str
    path: tuple
    lateral: str | float = "free"
    tension: float = 0.0
    cycles: int = 0
    increment: float | None = None

    @property
    def name(self):
        return " ".join(filter(None, (self.direction, self.kind)))


@dataclass(frozen=True)
class Case:
    """One random fabric, SI, and the tests asked of it.

    law_strain, law_tension: two linear pieces up to the breaking strain.  contact: the judge's Barrier
    or Core.  points, contacts: control and contact points per loop, contacts None for the default;
    cell: symmetric or full; wales, courses: periods of the pattern in it.  pattern: rows of k and p.
    family: name of a kind of worst case.  refined: whether the tests are solved again at twice the
    resolution.
    """

    number: int
    wale_spacing: float
    course_spacing: float
    loop_length: float
    diameter: float
    bending_rigidity: float
    law_strain: tuple
    law_tension: tuple
    contact: Barrier | Core
    friction: float = 0.0
    set_fraction: float = 0.0
    bending_hysteresis: float = 0.0
    tangential_ratio: float = 1.0
    points: int = POINTS
    contacts: int | None = None
    cell: str = "symmetric"
    wales: int = 1
    courses: int = 1
    pattern: tuple = JERSEY
    family: str = "any"
    refined: bool = False
    tests: tuple = ()

    @property
    def hard(self):
        """The diameter that yarns keep under load (m): that of a core."""
        return self.contact.core or self.diameter

    @property
    def breaking_strain(self):
        return self.law_strain[-1]

    @property
    def kinds(self):
        """Names of the kinds of case that it belongs to, for the summary."""
        has = {
            "core law": isinstance(self.contact, Core),
            "set": self.set_fraction > 0.0,
            "hysteresis of the yarn": self.bending_hysteresis > 0.0,
            "full cell": self.cell == "full" and self.wales * self.courses == 1,
            "several loops": self.wales * self.courses > 1,
            "no friction": self.friction == 0.0,
            f"pattern {'/'.join(self.pattern)}": self.pattern != JERSEY,
            "there and back": any(t.cycles for t in self.tests),
        }
        return [self.family, *(name for name, true in has.items() if true)]


@dataclass(frozen=True)
class Law:
    """How the cases of a campaign are drawn.

    ranges, shares: over RANGES and SHARES; families: of worst cases, what each sets, drawn anew in
    these ranges; any: part of the cases of no family, the others share the rest equally.  tests: a
    function of the case, its drawn values and the random generator, which returns the case with its
    tests.  cell: of all cases, None as drawn.  patterns: taken in turn.
    """

    tests: object
    ranges: dict = field(default_factory=dict)
    shares: dict = field(default_factory=dict)
    families: dict = field(default_factory=lambda: {"any": {}})
    any: float = 1.0
    cell: str | None = None
    patterns: tuple = (JERSEY,)

    def draw(self, number, seed):
        """Case ``number`` (0 on) of the campaign with this seed."""
        random = np.random.default_rng([seed, number])
        others = [name for name in self.families if name != "any"]
        family = "any" if random.random() < self.any else others[random.integers(len(others))]
        ranges = RANGES | self.ranges | self.families[family]
        value = {name: _drawn(random, *ranges[name]) for name in RANGES}
        has = {name: bool(random.random() < p) for name, p in (SHARES | self.shares).items()}
        value |= {"has": has, "family": family, "sign": 1.0 if random.random() < 0.5 else -1.0}
        case = _fabric(number, value, random, self.cell)
        case = replace(case, pattern=self.patterns[number % len(self.patterns)])
        return self.tests(case, value, random)


def _drawn(random, low, high, scale):
    part = random.random()
    return low * (high / low) ** part if scale == "log" else low + (high - low) * part


def _fabric(number, value, random, cell):
    """A Case without tests, from drawn values."""
    has, d = value["has"], value["diameter"]
    length = value["loop_over_diameter"] * d
    slope, kink, end = value["stiffness"] * d**2, value["kink"], value["breaking_strain"]
    at_kink = slope * kink
    rigidity = value["bending"] * slope * d**2 / 16.0
    contact, thick = Barrier(value["compression"] * slope / d), d
    if has["core"]:
        thick = value["swell"] * d
        contact = _shell(d, thick, value["shell"] * rigidity / d**2, value["exponent"])
    several = has["several"]
    wales, courses = SEVERAL[random.integers(len(SEVERAL))] if several else (1, 1)
    lag = value["hysteresis"] * rigidity * 2.0 * math.pi / length
    rubs = not has["frictionless"] or several  # without friction loops would exchange yarn
    return Case(
        number, length / value["kw"], length / value["kc"], length, thick, rigidity,
        (0.0, kink, end), (0.0, at_kink, at_kink + value["second_slope"] * slope * (end - kink)),
        contact, value["friction"] if rubs else 0.0, value["set"] if has["set"] else 0.0,
        lag if has["hysteresis"] else 0.0, value["tangential"], 96 if has["fine"] else POINTS, None,
        cell or ("full" if has["full"] or several else "symmetric"), wales, courses,
        family=value["family"],
    )  # fmt: skip


def _shell(core, diameter, force, exponent):
    """The Core law whose crossing takes this force (N) half way to the core: F = 2 pi D v(D)."""
    half = 0.5 * (core + diameter)
    unit, _ = Core(core, 1.0, exponent).at(half, diameter)
    return Core(core, float(force / (2.0 * math.pi * half * unit)), exponent)


def _lateral(case, value, width):
    """Free, held or loaded across, a force per width (N/m)."""
    if value["has"]["held"]:
        return "held"
    return _load(case, value, width) if value["has"]["loaded"] else "free"


def _load(case, value, width):
    return value["load"] * case.bending_rigidity / (case.hard * case.loop_length * width)


def dense(largest, recovers=False):
    """Strains up to the largest: close together where friction sets in, and before a way back."""
    steps = math.ceil(largest / STORED)
    path = [*FIRST, *(largest * np.arange(1, steps + 1) / steps)]
    if recovers:
        path += [largest - step for step in FIRST]
    return tuple(float(x) for x in np.unique(np.round(path, 9)))


def pulls(case, value, random):
    """Both directions, densely; some biaxial, some there and back, some held or loaded across."""
    tests, cycles = [], int(random.choice(CYCLES)) if value["has"]["recovers"] else 0
    for direction in ("course", "wale"):
        width = case.course_spacing if direction == "wale" else case.wale_spacing
        path = dense(value[f"{direction}_strain"], cycles > 0)
        tests.append(Asked("tension", direction, path, _lateral(case, value, width), 0.0, cycles))
    if value["has"]["biaxial"]:
        # Out to both strains at once, shrunk as the yarn would break, then on along the course.
        share = 0.25
        both = np.array([value["course_strain"], value["wale_strain"]]) * share
        steps = math.ceil(both.max() / STORED)
        way = np.arange(1, steps + 1) / steps
        start = np.array(FIRST) / both.max()
        out = np.concatenate([start[start < way[0]], way])[:, None] * both
        tests.append(Asked("biaxial", "", tuple(map(tuple, out.tolist()))))
    return replace(case, tests=tuple(tests))


def wears(case, value, random):
    """Both directions, there and back three times each."""
    case = pulls(case, value, random)
    return replace(case, tests=tuple(replace(test, cycles=3) for test in case.tests))


def cycle(largest, steps):
    """From 0 to the largest, through 0 to the opposite and back to 0, each way in so many steps.

    After the start and each turn another state comes first, where friction sets in or turns over.
    """
    near, out = PAIR * largest, largest * np.arange(1, steps + 1) / steps
    there = [near, *out, largest - near, *out[-2::-1], 0.0]
    return np.array([0.0, *there, -near, *(-x for x in there[1:])])


def bends(case, value, random):
    """Both directions, both ways to 250 1/m and back."""
    del random
    path, lateral = tuple(cycle(250.0, 10).tolist()), "held" if value["has"]["held"] else "free"
    tests = (Asked("bending", d, path, lateral) for d in ("course", "wale"))
    return replace(case, tests=tuple(tests))


def shears(case, value, random):
    """To both sides and back, some under tension along the wale."""
    del random
    path = tuple(cycle(math.radians(value["angle"]), 8).tolist()[1:])
    tension = _load(case, value, case.wale_spacing) if value["has"]["loaded"] else 0.0
    held = "held" if value["has"]["held"] else "free"
    return replace(case, tests=(Asked("shear", "", path, held, tension),))

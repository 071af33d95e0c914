"""What is known of a fabric's inputs before its curves are measured: a distribution of each.

An input that is stated has a tolerance: its logarithm is normal about that of the value, and the tolerance
is twice its standard deviation (coverage factor 2, JCGM 100:2008, 6.2).  An input that is assumed has a
range, evenly likely between the ends, or evenly in the logarithm where the ends lie far apart.  Each
is a function of one standard normal number z, so that bounds hold by themselves and all inputs together
are a standard normal vector.

>>> one = Input("loop_length", "tolerance", 11.28e-3, 0.02)
>>> [round(1e3 * float(one.at(z)), 2) for z in (-2.0, 0.0, 2.0)]
[11.06, 11.28, 11.51]
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from knitsim.errors import InputError
from knitsim.inference.continuation import check_input, value_of, varied

KINDS = ("tolerance", "range", "log_range")
COVERAGE = 2.0  # standard deviations in a tolerance
FURTHEST = 8.0  # standard deviations beyond which nothing is drawn
WIDE = 10.0  # ratio of the ends of a range from which it is even in the logarithm

# Tolerances of stated inputs (relative; 1.0 is a factor of 2), and where they are from; "assumed" is what
# no source gives a number for.
TOLERANCES = {
    "loop_length": (0.02, "unravelled yarn must be straightened by a load that also stretches it, EN 14970"),
    "diameter": (0.10, "assumed: a hairy yarn has no sharp edge"),
    "bending_rigidity": (0.40, "assumed: specimens of one spun yarn scatter by 20 %"),
    "core_diameter": (0.10, "assumed: as uncertain as the diameter of the same hairy yarn"),
    "core_stiffness": (1.0, "assumed: fitted with the exponent to a compression that begins at no force"),
    "core_exponent": (0.30, "assumed: fitted with the stiffness"),
    "compression_stiffness": (1.0, "assumed: the force where yarns first touch is hardly to be read"),
    "friction": (0.30, "precision between laboratories is known to be poor, ASTM D3412, 5.1; size assumed"),
    "set": (0.30, "assumed: hardly ever measured"),
    "bending_hysteresis": (0.40, "assumed: as the bending rigidity"),
    "stretch": (0.20, "assumed: specimens of one yarn"),
}  # fmt: skip
# Ranges of inputs that nobody states, where the study gives none.
RANGES = {
    # From Mindlin's 2 (1 - nu)/(2 - nu) (J. Appl. Mech. 16 (1949) 259) of the stiffness where yarns first
    # touch to that of yarns pressed to a fifth of the way to their core.
    "tangential_ratio": (0.5, 200.0, "stiffness of a contact along the yarn, after Mindlin (1949)"),
}  # fmt: skip


@dataclass(frozen=True)
class Input:
    """An uncertain input.

    name: as in :func:`knitsim.inference.continuation.inputs`, or ``stretch``, a factor on the yarn's
    tension; kind: one of KINDS; first, second: value and relative tolerance, or the ends of the
    range (SI); why: where this is from.  Raises InputError for what is no distribution.
    """

    name: str
    kind: str
    first: float
    second: float
    why: str = ""

    def __post_init__(self):
        if self.kind not in KINDS:
            raise InputError(f"{self.name}: distribution", self.kind, f"must be one of {KINDS}")
        pair = [self.first, self.second]
        if not all(map(math.isfinite, pair)):
            raise InputError(f"{self.name}: {self.kind}", pair, "must be finite")
        if self.kind == "tolerance" and not (self.first > 0 and self.second > 0):
            raise InputError(
                f"{self.name}: tolerance", self.second, "must be above 0, of a value above 0"
            )
        if self.kind != "tolerance" and not self.first < self.second:
            raise InputError(f"{self.name}: range", pair, "must be [lowest, highest]")
        if self.kind == "log_range" and not self.first > 0:
            raise InputError(f"{self.name}: range", pair, "must begin above 0")

    def at(self, z):
        """Value (SI) at a standard normal number z, any shape."""
        z = np.clip(z, -FURTHEST, FURTHEST)
        if self.kind == "tolerance":
            return self.first * np.exp(math.log1p(self.second) / COVERAGE * z)
        if self.kind == "range":
            return self.first + (self.second - self.first) * ndtr(z)
        return self.first * (self.second / self.first) ** ndtr(z)

    def feature(self, z):
        """A number of mean 0 and variance 1 in which the model is smooth: z, or the place in the range."""
        return np.asarray(z) if self.kind == "tolerance" else math.sqrt(3.0) * (2.0 * ndtr(z) - 1.0)

    def z_of(self, value):
        """The standard normal number of a value (SI), within the distribution."""
        if self.kind == "tolerance":
            return COVERAGE * np.log(value / self.first) / math.log1p(self.second)
        part = (value - self.first) / (self.second - self.first)
        if self.kind == "log_range":
            part = np.log(value / self.first) / math.log(self.second / self.first)
        return np.clip(ndtri(np.clip(part, 0.0, 1.0)), -FURTHEST, FURTHEST)


def inputs_of(fabric, ranges=None, tolerances=None, assumed=None):
    """The uncertain inputs (:class:`Input`, ...) of a Fabric.

    ranges: {name: (low, high)} and tolerances: {name: relative} stated for them; assumed: {name: (low,
    high, why)}, what the ledger says of those that nobody gave.  The first of them counts that names
    an input, then TOLERANCES and RANGES.  A tolerance or range of no width makes an input certain.
    """
    ranges, tolerances, assumed = ranges or {}, tolerances or {}, assumed or {}
    known = (*TOLERANCES, *RANGES)
    for name in (*ranges, *tolerances):
        if name not in known:
            raise InputError("uncertain input", name, f"must be one of {', '.join(known)}")
        if name in ranges and name in tolerances:
            raise InputError(name, "range and tolerance", "must have one of them")
    found = []
    for name in known:
        try:
            value = 1.0 if name == "stretch" else value_of(fabric, name)
            if name != "stretch":
                check_input(name, fabric)
        except (AttributeError, InputError):
            continue
        one = _input(name, value, ranges, tolerances, assumed)
        if one is not None:
            found.append(one)
    if any(i.name == "friction" for i in found) or fabric.friction > 0.0:
        return tuple(found)
    return tuple(i for i in found if i.name != "tangential_ratio")


def _input(name, value, ranges, tolerances, assumed):
    if name in tolerances:
        if tolerances[name] == 0.0 or value == 0.0:
            return None
        return Input(name, "tolerance", value, tolerances[name], "stated")
    for given in (ranges, assumed, RANGES):
        if name in given:
            low, high, *why = given[name]
            if low == high:
                return None
            kind = "log_range" if low > 0 and high / low >= WIDE else "range"
            return Input(name, kind, low, high, *(why or ["stated"]))
    tolerance, why = TOLERANCES[name]
    return Input(name, "tolerance", value, tolerance, why) if value > 0.0 else None


def fabric_at(fabric, inputs, z):
    """The Fabric with its uncertain inputs at z (inputs,).  Raises InputError where it cannot exist."""
    values = {one.name: float(one.at(number)) for one, number in zip(inputs, z, strict=True)}
    stretch = values.pop("stretch", None)
    moved = varied(fabric, values)
    if stretch is None:
        return moved
    return replace(moved, law=fabric.law.scaled(stretch))


def draws(inputs, count, seed):
    """(count, inputs) standard normal numbers that fill the distribution evenly (scrambled Sobol)."""
    from scipy.stats import qmc

    sobol = qmc.Sobol(len(inputs), rng=np.random.default_rng(seed))
    unit = sobol.random_base2(math.ceil(math.log2(count)))[:count]
    return ndtri(np.clip(unit, 1e-9, 1.0 - 1e-9))

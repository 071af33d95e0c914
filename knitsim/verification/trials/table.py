"""The campaigns of random cases, one row each.  Their limits were fixed before they were run."""

from dataclasses import dataclass

from knitsim.verification.trials.law import PATTERNS, Law, bends, pulls, shears, wears
from knitsim.verification.trials.worst import WORST


@dataclass(frozen=True)
class Campaign:
    """title; law: how its cases are drawn; seed, cases: which and how many; solved: least part of the
    possible cases that must be solved and verified; errors: whether each test is asked for its
    estimated error."""

    title: str
    law: Law
    seed: int
    cases: int
    solved: float
    errors: bool = True

    def draw(self, number, seed=None):
        """Case ``number`` (0 on), of another seed where it is given."""
        return self.law.draw(number, self.seed if seed is None else seed)


_FLAT = {"hysteresis": 0.15}
_PATTERNS = Law(
    pulls, {"course_strain": (0.05, 0.6, ""), "wale_strain": (0.05, 0.4, "")},
    shares=_FLAT | {"several": 0.0}, patterns=PATTERNS,
)  # fmt: skip
_WORN = _FLAT | {"frictionless": 0.0, "recovers": 1.0, "biaxial": 0.0}
# Trials before each campaign used other seeds.
CAMPAIGNS = {
    "campaign": Campaign("tension", Law(pulls, shares=_FLAT), 51250, 1000, 0.99),
    "bending_campaign": Campaign("bending", Law(bends, shares={"several": 0.02}), 51252, 300, 0.99),
    "shear_campaign": Campaign("shear", Law(shears, shares=_FLAT, cell="full"), 51253, 500, 0.99),
    "friction_campaign": Campaign("friction", Law(wears, shares=_WORN), 51255, 500, 0.99),
    "pattern_campaign": Campaign("patterns", _PATTERNS, 51254, 300, 0.95),
    "stress": Campaign("stress", WORST, 51251, 5000, 0.98, errors=False),
}

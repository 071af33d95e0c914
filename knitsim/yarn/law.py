"""Tension laws: the tension N (newton) of a yarn or fibre as a piecewise-linear function of strain.

>>> law = paper_k3(continuous=True)
>>> round(float(law.tension_at(0.05)), 5)
4.21083
"""

from dataclasses import dataclass, field

import numpy as np

from knitsim.errors import InputError
from knitsim.yarn import law_kernels


@dataclass(frozen=True, eq=False)
class TensionLaw:
    """Piecewise-linear N(strain) through given vertices.

    strain, tension: shape (m,), m >= 2, starting at (0, 0).  A strain that stands twice is a jump,
    and the value below it holds there.  Below 0 the first slope goes on, above the last vertex
    the last slope.  breaking_strain (1): states beyond it are marked, not refused.  plastic: after
    loading, unload along the first slope (post-yield strain stays); otherwise it is reversible.

    Raises InputError if the vertices are not a law (not finite, falling strain, no slope at 0).
    """

    strain: np.ndarray
    tension: np.ndarray
    breaking_strain: float = np.inf
    plastic: bool = False
    energy_at_vertices: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        strain = np.array(self.strain, dtype=float)
        tension = np.array(self.tension, dtype=float)
        if strain.ndim != 1 or strain.shape != tension.shape or strain.size < 2:
            raise InputError(
                "tension law",
                f"{strain.size} strains and {tension.size} tensions",
                "must be two or more pairs of strain and tension",
            )
        if not (np.isfinite(strain).all() and np.isfinite(tension).all()):
            raise InputError("tension law", "nan or inf", "every strain and tension must be finite")
        if strain[0] != 0.0 or tension[0] != 0.0:
            raise InputError(
                "tension law",
                f"({strain[0]:g}, {tension[0]:g} N)",
                "must start at strain 0, tension 0",
            )
        steps = np.diff(strain)
        if (steps < 0).any() or steps[0] == 0 or steps[-1] == 0:
            raise InputError(
                "tension law strain",
                strain.tolist(),
                "must rise; only a jump inside the law may repeat a strain",
            )
        if ((steps[1:] == 0) & (steps[:-1] == 0)).any():
            raise InputError("tension law strain", strain.tolist(), "may repeat a strain once only")
        if tension[1] <= 0 or (np.diff(tension) < 0).any():
            raise InputError(
                "tension law tension", tension.tolist(), "must rise from 0 and never fall (N)"
            )
        if not self.breaking_strain > 0:
            raise InputError("breaking strain", self.breaking_strain, "must be above 0")
        energy = np.concatenate([[0.0], np.cumsum(0.5 * (tension[1:] + tension[:-1]) * steps)])
        for name, value in (
            ("strain", strain),
            ("tension", tension),
            ("energy_at_vertices", energy),
        ):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def initial_stiffness(self):
        """Slope at zero strain (N)."""
        return self.tension[1] / self.strain[1]

    def tension_at(self, strain):
        """Tension (N) on loading; strain: any shape."""
        return _each(law_kernels.fill_tension, strain, self.strain, self.tension)

    def stiffness_at(self, strain):
        """Tangent stiffness dN/dstrain (N) on loading; at a vertex that of the segment below."""
        return _each(law_kernels.fill_stiffness, strain, self.strain, self.tension)

    def energy_at(self, strain):
        """Energy per reference length (N = J/m) stored on loading from 0; strain: any shape."""
        return _each(
            law_kernels.fill_energy, strain, self.strain, self.tension, self.energy_at_vertices
        )

    def scaled(self, factor):
        """The law of ``factor`` such yarns or fibres side by side."""
        return TensionLaw(self.strain, self.tension * factor, self.breaking_strain, self.plastic)


def _each(fill, strain, *law):
    strain = np.asarray(strain, dtype=float)
    values = np.empty(strain.size)
    fill(strain.ravel(), *law, values)
    return values.reshape(strain.shape)


def bilinear(k1, k2, yield_strain, breaking_strain, plastic=True):
    """Slope k1 (N) up to the yield strain, k2 (N) from there to the breaking strain."""
    if not 0 < yield_strain < breaking_strain:
        raise InputError(
            "yield strain",
            yield_strain,
            f"must lie between 0 and the breaking strain {breaking_strain}",
        )
    at_yield = k1 * yield_strain
    return TensionLaw(
        [0.0, yield_strain, breaking_strain],
        [0.0, at_yield, at_yield + k2 * (breaking_strain - yield_strain)],
        breaking_strain,
        plastic,
    )


def secant(low, high, offset, switch_strain, breaking_strain, continuous=True):
    """The paper's k3 kind: tension = low e up to the switch strain, high e - offset above (all N).

    As printed the tension jumps at the switch strain; ``continuous`` breaks where the lines meet,
    at offset/(high - low).  Reversible.
    """
    if not (high > low > 0 and offset > 0):
        raise InputError(
            "secant law",
            f"low {low:g} N, high {high:g} N, offset {offset:g} N",
            "must have high above low above 0 and a positive offset",
        )
    crossing = offset / (high - low)
    end = [breaking_strain], [high * breaking_strain - offset]
    if not max(crossing, switch_strain) < breaking_strain:
        raise InputError(
            "breaking strain", breaking_strain, f"must be above {max(crossing, switch_strain):g}"
        )
    if continuous:
        strain, tension = [0.0, crossing], [0.0, low * crossing]
    else:
        strain = [0.0, switch_strain, switch_strain]
        tension = [0.0, low * switch_strain, high * switch_strain - offset]
    return TensionLaw(strain + end[0], tension + end[1], breaking_strain, plastic=False)


# The paper, section 3: k3 as a secant stiffness of the cotton yarn, and where it switches.
PAPER_K3 = {"low": 43.805, "high": 94.005, "offset": 0.48942, "switch_strain": 0.01}


def paper_k3(continuous, breaking_strain=0.07):
    """The paper's cotton law k3, as printed or continuous; the breaking strain is an assumption."""
    return secant(**PAPER_K3, breaking_strain=breaking_strain, continuous=continuous)

"""Yarn curves rebuilt from the constants that the paper prints: its measured curves are lost.

``python -m knitsim.yarn.rebuilt config/curves`` writes both files.  They are inputs like any
measured curve, so that calibration can be run and must return the constants.
"""

import sys
from pathlib import Path

import numpy as np

from knitsim.units import from_si
from knitsim.yarn import law

# Section 3 of the paper: spring constants of one polyester filament (N), number of filaments.
PAPER_FILAMENT = {"k1": 6.34, "k2": 2.41}
PAPER_FILAMENTS = 72
# Assumptions, as the paper gives neither.
POLYESTER_YIELD_STRAIN = 0.02
POLYESTER_BREAKING_STRAIN = 0.08
COTTON_BREAKING_STRAIN = 0.07
# 89 steps to the break put no point on a change of slope, so that the fit has to find it.
_STEPS = 89
_GAUGE_LENGTH = 0.5  # m

_NOT_MEASURED = "# Rebuilt from the constants printed in the paper, NOT measured."


def polyester_law():
    """Law of the paper's polyester yarn: 72 filaments side by side, without twist."""
    filament = law.bilinear(
        **PAPER_FILAMENT,
        yield_strain=POLYESTER_YIELD_STRAIN,
        breaking_strain=POLYESTER_BREAKING_STRAIN,
    )
    return filament.scaled(PAPER_FILAMENTS)


def cotton_law():
    """Law of the paper's cotton yarn: k3, its jump closed where the two lines meet."""
    return law.paper_k3(continuous=True, breaking_strain=COTTON_BREAKING_STRAIN)


def _points(tension_law):
    """Strain and force (N) up to the break and at two points beyond, at 5 % of the force and 0."""
    strain = tension_law.breaking_strain * np.arange(_STEPS + 3) / _STEPS
    force = tension_law.tension_at(strain)
    force[-2:] = 0.05 * force[-3], 0.0
    return strain, force


def _text(header, columns):
    rows = [",".join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([*header, *rows]) + "\n"


def polyester_text():
    """Content of polyester_rebuilt.csv."""
    strain, force = _points(polyester_law())
    header = [
        _NOT_MEASURED,
        "# Polyester yarn, 333.33 dtex, 72 filaments in parallel, of k1 = 6.34 N up to the yield",
        "# strain and k2 = 2.41 N above it each.",
        "# Yield strain 0.02 and breaking strain 0.08 are assumed.",
        "# Written by knitsim.yarn.rebuilt.",
        "# linear_density_dtex: 333.33",
        "strain_percent,force_cN",
    ]
    return _text(header, (from_si(strain, "percent"), from_si(force, "cN")))


def cotton_text():
    """Content of cotton_rebuilt.csv."""
    strain, force = _points(cotton_law())
    header = [
        _NOT_MEASURED,
        "# Cotton yarn, 559.86 dtex, of k3 = 43.805 N at small strain, 94.005 N - 0.48942 N/strain",
        "# above; the jump is closed where the two lines meet.  Breaking strain 0.07 is assumed.",
        "# Written by knitsim.yarn.rebuilt.",
        "# linear_density_dtex: 559.86",
        f"# gauge_length_mm: {from_si(_GAUGE_LENGTH, 'mm'):g}",
        "extension_mm,force_cN",
    ]
    return _text(header, (from_si(strain * _GAUGE_LENGTH, "mm"), from_si(force, "cN")))


def write(directory):
    """Write both files into ``directory``, which must exist; the paths written."""
    paths = []
    for name, text in (
        ("polyester_rebuilt.csv", polyester_text()),
        ("cotton_rebuilt.csv", cotton_text()),
    ):
        path = Path(directory) / name
        path.write_bytes(text.encode("utf-8"))
        paths.append(path)
    return paths


if __name__ == "__main__":
    for written in write(sys.argv[1] if len(sys.argv) > 1 else "config/curves"):
        print(written)

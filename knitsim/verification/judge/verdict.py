"""Is a result of the equilibrium model right?  What the judge reads, and what is wrong with it.

The judge knows no more of a test than what was prescribed: tension, biaxial, shear and bending,
recoveries, cycles and any other sequence of states are judged by the same rules.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from knitsim.verification.judge.given import controls_of, design
from knitsim.verification.judge.loads import GAUSS, SAME, Finding, Loads, above, noise_of
from knitsim.verification.judge.measure import Energy
from knitsim.verification.judge.taut import not_interlooped

DRIVEN = {"course": 0, "wale": 3, "shear": 2, "course bending": 0, "wale bending": 3}
_NEED_NOT_BE = ("load", "moment", "min_distance", "numerical_error")  # finite


@dataclass(frozen=True, eq=False)
class States:
    """States of a test in the order visited; (n,) unless said.

    centreline (n, yarns, m + 1, 3), m: of each course of the cell, two samples per span from the
    sinker arc of its first loop on, the last is the first one cell further; lattice (n, 4), m: steps to
    the next wale and to the next course (course, wale direction each); both in the mean plane, before
    it is rolled up; curvature (1/m).  coordinate (n, k): what the test prescribes, as it says: strain,
    angle of shear (rad) or curvature.  load (n, 4): force on each entry of the lattice (N per loop), NaN
    where it is not told; moment: per width at rest (N).  energy (n, 3): stretch, bending, contact, and
    sprung: in friction that gives way elastically; work, dissipated: cumulative; all J per loop.
    increments: solved steps since the state before.
    min_distance: in diameters, NaN where nothing is near.  numerical_error: what the solver says that
    the load may be off by, over max(|load|, 1 % of the largest), NaN where it does not say.
    """

    centreline: np.ndarray
    lattice: np.ndarray
    curvature: np.ndarray
    coordinate: np.ndarray
    load: np.ndarray
    moment: np.ndarray
    energy: np.ndarray
    sprung: np.ndarray
    work: np.ndarray
    dissipated: np.ndarray
    increments: np.ndarray
    min_distance: np.ndarray
    numerical_error: np.ndarray


@dataclass(frozen=True, eq=False)
class Test:
    """What was asked of a fabric.

    driven: what is prescribed, names in DRIVEN, one for each column of the coordinate; none: a fabric
    at rest.  held: entries of the lattice that were kept besides.  dead_load (4,): on the entries that
    are free, N per loop.  asked (m, k): coordinates that the first m states have, NaN where not asked.
    rest (4,): the lattice from which strains count, where it is not that of the first state, which then
    is not at rest.  unloaded: numbers of states that are said to be without load.  fine_steps: whether
    the steps were those of the method, so that its work is exact.
    """

    __test__ = False  # no test of pytest

    driven: tuple = ()
    held: tuple = (1, 2)
    dead_load: np.ndarray = field(default_factory=lambda: np.zeros(4))
    asked: np.ndarray | None = None
    rest: np.ndarray | None = None
    unloaded: tuple = ()
    fine_steps: bool = True

    @property
    def bent(self):
        """The axis that becomes curved: 0 course, 1 wale, None where the fabric stays flat."""
        return {("course bending",): 0, ("wale bending",): 1}.get(self.driven)

    @property
    def entries(self):
        """Entries of the lattice that are prescribed and do work; in bending the angle does."""
        return [DRIVEN[name] for name in self.driven] if self.bent is None else []

    @property
    def free(self):
        return [e for e in range(4) if e not in (*self.held, *self.entries)]


def judge(given, states, test):
    """Findings (a list, empty for right) about the states of one test, one for each kind.

    given: :class:`.given.Given`; states: States; test: Test.  States that are not numbers, or whose
    shape is not what it should be, are not judged further.
    """
    found = [*_not_finite(states)] or [*_no_splines(given, states), *_not_as_asked(states, test)]
    if not found:
        controls = [
            controls_of(*one, given.wales)
            for one in zip(states.centreline, states.lattice, strict=True)
        ]
        lost = not_interlooped(given, controls, states.lattice)
        if lost is not None:
            found = [Finding("crossings are not those of the pattern", lost, 0.0, 0.0)]
    if not found:
        found = [*_held_cell(given), *Loads(given, states, test, controls).findings()]
    return list({finding.check: finding for finding in reversed(found)}.values())[::-1]


def _not_finite(states):
    """Findings about numbers that are none, where they must be."""
    for name, values in vars(states).items():
        bad = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(1))
        if len(bad) and name not in _NEED_NOT_BE:
            yield Finding(f"{name} is not finite", int(bad[0]), np.nan, 0.0)


def _no_splines(given, states):
    """Findings about centre lines that are no periodic cubic splines."""
    n = given.points * given.wales
    middle, turns = design(n, np.arange(n) + 0.5)
    off = []
    for lines, lattice in zip(states.centreline, states.lattice, strict=True):
        step = given.wales * np.append(lattice[:2], 0.0)
        spline = middle @ controls_of(lines, lattice, given.wales) + turns[:, None] * step
        ends = lines[:, -1] - lines[:, 0] - step
        off.append(max(np.abs(spline - lines[:, 1::2]).max(), np.abs(ends).max()))
    yield from above("centre line is no periodic cubic spline", off, SAME * given.diameter)


def _not_as_asked(states, test):
    """Findings about states that are not where they say, or not where they were asked to be."""
    lattice, rest = states.lattice, states.lattice[0] if test.rest is None else test.rest
    for name, said in zip(test.driven, states.coordinate.T, strict=True):
        if test.bent is not None:
            true = states.curvature
        elif name == "shear":
            true = np.arctan(lattice[:, 2] / rest[3])
        else:
            true = lattice[:, DRIVEN[name]] / rest[DRIVEN[name]] - 1.0
        limit = SAME * max(1.0, np.abs(said).max())
        yield from above("coordinate is not that of the shape", np.abs(true - said), limit)
    if test.bent is None:
        yield from above("a flat test is curved", np.abs(states.curvature), 0.0)
    else:
        # The plane to which spacings and curvature belong is the mean of the centre lines.
        middle = np.abs(states.centreline[:, :, :-1, 2].mean((1, 2)))
        yield from above("mean plane is not at zero thickness", middle, SAME * lattice[0, 3])
    for entry in test.held:
        off = np.abs(lattice[:, entry] - lattice[0, entry]) / lattice[0, 3]
        yield from above("a held spacing has changed", off, SAME)
    if test.asked is None:
        return
    asked = np.atleast_2d(test.asked)
    if len(asked) > len(lattice):
        yield Finding("asked states are missing", len(lattice) - 1, len(lattice), len(asked))
    else:
        off = np.nan_to_num(np.abs(states.coordinate[: len(asked)] - asked)).max(1, initial=0.0)
        limit = SAME * max(np.nanmax(np.abs(asked), initial=0.0), 1e-3)
        yield from above("asked state not reached", off, limit)


def _held_cell(given):
    """Findings about the held cell, of whose curvature the yarn has taken a part."""
    if given.set_fraction > 0.0:
        lines, lattice = given.held
        control = controls_of(lines, lattice, given.wales)
        energy = Energy(replace(given, set_fraction=0.0), GAUSS, given.contacts, True)
        left = np.abs(energy.gradient(energy.shape(control, lattice))[0]).max()
        if left > noise_of(given) or not_interlooped(given, [control], [lattice]) is not None:
            yield Finding("the held cell is not in equilibrium", 0, left, noise_of(given))

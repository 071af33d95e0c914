"""From measured curves of a fabric to what they teach of its inputs and to predictions whose band holds.

>>> # solved = Solved(fabric, inputs, forces_of([curve]))                # minutes: some 200 fabrics
>>> # solved.refine([curve], ("strain", "rest"))
>>> # predicted(learned(solved, [curve]).posterior, "course", "strain", [100.0, 300.0])
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from knitsim.errors import ComputationError, InputError
from knitsim.inference.emulator import RUBBING, Emulator
from knitsim.inference.forward import QUANTITIES, Forward
from knitsim.inference.inputs import draws
from knitsim.inference.posterior import (
    DISCREPANCY,
    TRUSTED,
    Posterior,
    blocks_of,
    error_of,
    fitted,
    predicted,
    reading,
    rest_blocks,
    together,
)
from knitsim.inference.scores import score

FABRICS = 128  # solved for the emulator
RUBBED, LEAST_RUBBED = 0.4, 30  # part of them solved with friction as well
REFINED, AT_ONCE = 2, 12  # times that fabrics are solved where a fit is, and how many each time
SEED = 20
STATES = 14  # forces of a row
LEAST_FORCE = 0.02  # of the largest: below it no strain is told
LEARNED, UNKNOWN = (
    0.7,
    0.9,
)  # posterior over prior deviation: below and above it an input or combination is
EXACTLY = 0.1  # part of its prior deviation that an input has once it is measured well
# Error of a further test, and its discrepancy over that of strain along the pull.
NEXT_ERROR = {"strain": (0.03, 1.0), "lateral_strain": (0.01, 0.2)}
USES = ("strain", "lateral_strain", "rest")


@dataclass(frozen=True, eq=False)
class Inferred:
    """What was learned.  inputs; emulator; prior, posterior: :class:`.posterior.Posterior`; forces:
    {direction: (n,)}; failed: fabrics drawn that had no equilibrium, with the reasons; k: of the weights."""

    inputs: tuple
    emulator: Emulator
    prior: Posterior
    posterior: Posterior
    forces: dict
    failed: tuple
    solved: int
    k: float

    @property
    def trusted(self):
        return self.posterior.converged and self.k <= TRUSTED


def forces_of(measured, top=None):
    """{direction: (n,) N/m}, evenly in the logarithm: up to the largest measured force, or ``top``."""
    found = {}
    for direction in ("course", "wale"):
        own = [m for m in measured if m.kind == "tension" and m.direction == direction]
        high = max(
            [m["force_per_width"].max() for m in own] + ([top] if top else []), default=100.0
        )
        low = min(
            [m["force_per_width"][m.loading & (m["strain"] > 0)].min() for m in own], default=high
        )
        found[direction] = np.geomspace(max(min(low, 0.1 * high), LEAST_FORCE * high), high, STATES)
    return found


class Solved:
    """Solved fabrics of which an emulator is made.

    count of them are drawn from the distribution of the inputs.  With uncertain friction they are solved
    without it, and a part of them again with it.  Draws without an equilibrium are left out, with the
    reasons in ``failed``: the distribution is that of fabrics which can be.  stated: spacings at rest (wale,
    course) (m) that somebody stated, None else; without it those of the fabric.
    """

    def __init__(
        self, fabric, inputs, forces, *, count=FABRICS, seed=SEED, resolution=None, pretension=None,
        progress=None, stated=None,
    ):  # fmt: skip
        self.fabric, self.inputs, self.forces = fabric, tuple(inputs), forces
        self.stated = stated or (fabric.wale_spacing, fabric.course_spacing)
        names = [i.name for i in inputs]
        self.rubs = "friction" in names
        self.own = [k for k, name in enumerate(names) if not (self.rubs and name in RUBBING)]
        base = replace(fabric, friction=0.0) if self.rubs else fabric
        self.plain = Forward(
            base, [inputs[k] for k in self.own], forces, resolution, pretension=pretension
        )
        self.again = Forward(fabric, inputs, forces, self.plain.resolution, pretension=pretension)
        self.kept, self.rows, self.number, self.rubbed, self.failed = [], [], [], [], []
        many = max(math.ceil(RUBBED * count), LEAST_RUBBED) if self.rubs else 0
        for k, one in enumerate(draws(inputs, count, seed)):
            self.add(one, len(self.number) < many)
            if progress:
                progress(k + 1, count)
        if not self.rows:
            raise ComputationError(
                f"none of {count} fabrics drawn has an equilibrium: {self.failed[0]}"
            )
        self.drawn = len(self.failed)

    def add(self, z, rubbed):
        """Solve the fabric at z (inputs,), with friction as well if ``rubbed``."""
        row, why = self.plain.row(z[self.own])
        if row is None:
            self.failed.append(why)
            return
        if rubbed:
            more, _ = self.again.row(z)
            if more is not None:
                self.number.append(len(self.rows))
                self.rubbed.append(more)
        self.kept.append(z)
        self.rows.append(row)

    def emulator(self):
        """The Emulator of what is solved by now."""
        both = (np.array(self.number), np.array(self.rubbed)) if self.rubs else None
        return Emulator(
            self.inputs, self.plain.places, np.array(self.kept), np.array(self.rows), both
        )

    def refine(self, tests, use):
        """Solve fabrics drawn from what the tests leave, where an emulator of the whole distribution is not
        good enough."""
        for number in range(REFINED):
            emulator = self.emulator()
            found = fitted(emulator, blocks_for(self.stated, emulator.places, tests, use))
            z = found.draws(AT_ONCE, number)[0]
            z[0] = found.z
            for one in z:
                self.add(one, self.rubs)


def blocks_for(stated, places, tests, use=("strain", "rest")):
    """Blocks of measured tests (MeasuredTest) and, with "rest" in use, of the stated spacings (wale,
    course) (m), None where it is not stated."""
    for name in use:
        if name not in USES:
            raise InputError("use", name, f"must be of {', '.join(USES)}")
    blocks = []
    for test in tests:
        blocks += blocks_of(places, test, [q for q in QUANTITIES if q in use])
    if "rest" in use:
        blocks += rest_blocks(places, *stated)
    return [b for b in blocks if len(b.at)]


def learned(solved, tests, use=("strain", "rest"), seed=0):
    """The :class:`Inferred` of measured tests; solved: :class:`Solved`."""
    emulator = solved.emulator()
    posterior = fitted(emulator, blocks_for(solved.stated, emulator.places, tests, use))
    k = posterior.draws(1000, seed)[2]
    return Inferred(
        emulator.inputs, emulator, Posterior(emulator), posterior, solved.forces, tuple(solved.failed),
        emulator.solved, k,
    )  # fmt: skip


def table(found, count=4000, seed=0):
    """Prior and posterior of each input, side by side: rows (name, kind, prior low, median, high, posterior
    low, median, high (SI, 95 %), narrowed: posterior over prior deviation of z, words)."""
    before = found.prior.draws(count, seed)[0]
    z, s, _ = found.posterior.draws(count, seed)
    rows = []
    for k, one in enumerate((*found.inputs, DISCREPANCY)):
        last = k == len(found.inputs)
        old = np.random.default_rng(seed).standard_normal(count) if last else before[:, k]
        new = s if last else z[:, k]
        ends = [np.quantile(one.at(v), (0.025, 0.5, 0.975)) for v in (old, new)]
        narrowed = float(new.std() / old.std())
        shift = float(np.median(new))
        rows.append(
            (
                one.name,
                one.kind,
                *map(float, [*ends[0], *ends[1]]),
                narrowed,
                _words(narrowed, shift),
            )
        )
    return rows


def _words(narrowed, shift):
    how = (
        "learned"
        if narrowed < LEARNED
        else "a little learned"
        if narrowed < UNKNOWN
        else "not learned"
    )
    if abs(shift) > 2.0:
        return f"{how}; moved by {shift:+.1f} standard deviations: what was stated does not fit the curves"
    return how


def combinations(found, most=3):
    """Combinations of inputs that the data know best and least: [(deviation over prior, {name: weight})]."""
    size, axes = np.linalg.eigh(found.posterior.covariance)
    named = [
        (float(math.sqrt(one)), {i.name: float(w) for i, w in zip(found.inputs, axis, strict=True)})
        for one, axis in zip(size, axes.T, strict=True)
    ]
    return named[:most], named[::-1][:most]


def next_tests(found, target, candidates=(), at=None):
    """Which further measurement narrows a prediction most: [(what, deviation after over before)], best first.

    target: "course" or "wale", whose strain is predicted; candidates: ("course" or "wale", quantity)
    tests; each input measured well is a candidate too.  In the linear approximation about the most
    probable inputs.
    """
    posterior, model = found.posterior, found.emulator
    at = found.forces[target] if at is None else at
    slopes = model.slopes(posterior.z)
    wanted = reading(model.places, target, "strain", at) @ slopes
    size = float(DISCREPANCY.at(posterior.s))

    def spread(precision):
        return math.sqrt(np.trace(wanted @ np.linalg.solve(precision, wanted.T)) / len(at))

    own, rows = spread(posterior.precision), []
    for k, one in enumerate(found.inputs):
        extra = np.zeros(len(found.inputs))
        extra[k] = 1.0 / EXACTLY**2
        after = spread(posterior.precision + np.diag(extra))
        rows.append((f"{one.name.replace('_', ' ')}, ten times better", after / own))
    for test, quantity in candidates:
        forces = found.forces[test]
        seen = reading(model.places, test, quantity, forces) @ slopes
        error, part = NEXT_ERROR[quantity]
        mix = (error**2 + (part * size) ** 2) * (together(forces) + 1e-3 * np.eye(len(forces)))
        after = spread(posterior.precision + seen.T @ np.linalg.solve(mix, seen))
        rows.append((f"{test} pull, {quantity.replace('_', ' ')}", after / own))
    return sorted(rows, key=lambda row: row[1])


def left_out(stated, emulator, measured, choices, *, count=2000, seed=0, between=(0.0, math.inf)):
    """Scores of tests that were not fitted: rows (fitted, test, quantity, :class:`.scores.Score`).

    stated: spacings as for :func:`blocks_for`; measured: [MeasuredTest]; choices: {words: (tests fitted,
    use)}; between: forces (N/m) of the points.
    """
    rows = []
    for words, (tests, use) in choices.items():
        posterior = fitted(emulator, blocks_for(stated, emulator.places, tests, use))
        for test in measured:
            for quantity in QUANTITIES:
                if quantity not in test or (test in tests and quantity in use):
                    continue
                one = scored(posterior, test, quantity, count=count, seed=seed, between=between)
                if one is not None:
                    rows.append((words, test.name, quantity, one))
    return rows


def scored(posterior, test, quantity="strain", *, count=2000, seed=0, between=(0.0, math.inf)):
    """The Score of a measured tension test's points between two forces per width (N/m)."""
    places = posterior.model.places
    ends = [p.at for p in places if p.test == test.direction]
    force = test["force_per_width"]
    keep = (
        test.loading & (force >= max(min(ends), between[0])) & (force <= min(max(ends), between[1]))
    )
    keep &= np.isfinite(test[quantity]) & (test["strain"] > 0)
    if not keep.any():
        return None
    error = error_of(test, quantity)[keep[test.loading]]
    samples = predicted(
        posterior, test.direction, quantity, force[keep], count=count, seed=seed, measured=error
    )
    return score(samples, test[quantity][keep])

"""From measured curves of a fabric to what they teach of its inputs and to predictions whose band holds.

>>> # found = infer(fabric, inputs, {"wale": curve}, fit=["wale"])       # minutes: solves some 200 fabrics
>>> # found.posterior.z, predicted(found.posterior, "course", "strain", [100.0, 300.0])
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


def emulated(
    fabric, inputs, forces, *, count=FABRICS, seed=SEED, resolution=None, pretension=None, progress=None
):  # fmt: skip
    """(Emulator, failures) of a fabric from ``count`` solved ones, drawn from their distribution.

    With uncertain friction they are solved without it, and a part of them again with it.  Draws without an
    equilibrium are left out: the distribution is that of fabrics which can be.
    """
    names = [i.name for i in inputs]
    rubs = "friction" in names
    own = [k for k, name in enumerate(names) if not (rubs and name in RUBBING)]
    z = draws(inputs, count, seed)
    base = replace(fabric, friction=0.0) if rubs else fabric
    plain = Forward(base, [inputs[k] for k in own], forces, resolution, pretension=pretension)
    again = Forward(fabric, inputs, forces, plain.resolution, pretension=pretension)
    many = max(math.ceil(RUBBED * count), LEAST_RUBBED) if rubs else 0
    kept, rows, number, rubbed, failed = [], [], [], [], []
    for k, one in enumerate(z):
        row, why = plain.row(one[own])
        if row is None:
            failed.append(why)
        else:
            if len(number) < many:
                more, why = again.row(one)
                if more is not None:
                    number.append(len(rows))
                    rubbed.append(more)
            kept.append(one)
            rows.append(row)
        if progress:
            progress(k + 1, count)
    if not rows:
        raise ComputationError(f"none of {count} fabrics drawn has an equilibrium: {failed[0]}")
    both = (np.array(number), np.array(rubbed)) if rubs else None
    return Emulator(inputs, plain.places, np.array(kept), np.array(rows), both), tuple(failed)


def blocks_for(fabric, places, tests, use=("strain", "rest")):
    """Blocks of measured tests (MeasuredTest) and, with "rest" in use, of the stated spacings."""
    for name in use:
        if name not in USES:
            raise InputError("use", name, f"must be of {', '.join(USES)}")
    blocks = []
    for test in tests:
        blocks += blocks_of(places, test, [q for q in QUANTITIES if q in use])
    if "rest" in use and fabric.wale_spacing and fabric.course_spacing:
        blocks += rest_blocks(places, fabric.wale_spacing, fabric.course_spacing)
    return [b for b in blocks if len(b.at)]


def learned(fabric, emulator, tests, use=("strain", "rest"), forces=None, failed=(), seed=0):
    """The :class:`Inferred` of measured tests."""
    posterior = fitted(emulator, blocks_for(fabric, emulator.places, tests, use))
    k = posterior.draws(1000, seed)[2]
    solved = emulator.solved
    prior = Posterior(emulator)
    return Inferred(emulator.inputs, emulator, prior, posterior, forces, failed, solved, k)


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


def left_out(fabric, emulator, measured, choices, *, count=2000, seed=0):
    """Scores of tests that were not fitted: rows (fitted, test, quantity, :class:`.scores.Score`).

    measured: [MeasuredTest]; choices: {words: (tests fitted, use)}.
    """
    rows = []
    for words, (tests, use) in choices.items():
        posterior = fitted(emulator, blocks_for(fabric, emulator.places, tests, use))
        for test in measured:
            for quantity in QUANTITIES:
                if quantity not in test or (test in tests and quantity in use):
                    continue
                one = scored(posterior, test, quantity, count=count, seed=seed)
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

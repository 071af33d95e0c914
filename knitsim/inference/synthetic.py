"""Whether bands hold where the truth is known: fabrics with inputs drawn from their distribution.

Each is solved more finely than the inference solves, its wale curve given with chance errors, its course
curve predicted.  Both curves differ from the model's by a discrepancy as the inference assumes it; without
one, nothing is left out of the model, and bands which allow for that hold more than they say.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from knitsim.inference.forward import INCREMENT, Forward
from knitsim.inference.inputs import draws
from knitsim.inference.posterior import (
    DISCREPANCY,
    block,
    fitted,
    predicted,
    reading,
    rest_blocks,
    together,
)
from knitsim.inference.scores import Score, score

SEED = 77  # of the fabrics, another one than of those that are solved for an emulator
NOISE = 0.03  # of the given strain
STATES = 21


@dataclass(frozen=True, eq=False)
class Trial:
    """One fabric: z (inputs,); row (places,): the truth, None with why; score of its course strain."""

    z: np.ndarray
    row: np.ndarray | None
    why: str
    score: Score | None = None


def finer(emulating):
    """A Forward at twice the resolution, with half the increments and other states."""
    own = emulating.resolution
    resolution = replace(own, points=2 * own.points, contacts=2 * own.contacts)
    return Forward(
        emulating.fabric, emulating.inputs, emulating.forces, resolution, states=STATES,
        pretension=emulating.pretension, increment=0.5 * INCREMENT,
    )  # fmt: skip


def truths(emulating, count, seed=SEED):
    """Yields the :class:`Trial` of each fabric, not yet scored; emulating: the Forward of an emulator."""
    forward = finer(emulating)
    for z in draws(emulating.inputs, count, seed):
        row, why = forward.row(z)
        yield Trial(z, row, why)


def scored(emulator, trial, number, left_out=True, noise=NOISE):
    """The Trial with the score of its course strain at the forces that it reaches, predicted from the wale
    curve with errors of ``noise`` (relative, each by chance) and from its spacings at rest.

    left_out: with a discrepancy of each curve, else with none.
    """
    rng = np.random.default_rng((SEED, number))
    places = emulator.places
    size = float(DISCREPANCY.at(rng.standard_normal())) if left_out else 0.0

    def curve(test):
        at = np.array([p.at for p in places if (p.test, p.quantity) == (test, "strain")])
        strain = reading(places, test, "strain", at) @ np.nan_to_num(trial.row)
        known = strain > 0.0
        at, strain = at[known], strain[known]
        off = rng.multivariate_normal(np.zeros(len(at)), together(at))
        return at, strain * np.exp(size * off)

    at, strain = curve("wale")
    seen = strain * (1.0 + noise * rng.standard_normal(len(at)))
    blocks = [block(places, "wale", "strain", at, seen, noise * seen, correlated=False)]
    blocks += rest_blocks(places, *trial.row[:2])
    at, truth = curve("course")
    samples = predicted(fitted(emulator, blocks), "course", "strain", at, seed=number)
    return replace(trial, score=score(samples, truth))


def coverage(trials):
    """Over all points of scored trials: shares inside the 50 and 95 % bands, median relative width of the
    95 % band, and how many trials and points."""
    own = [t.score for t in trials if t.score is not None]
    points = np.array([one.points for one in own], dtype=float)
    shares = [
        float(np.average([getattr(one, name) for one in own], weights=points))
        for name in ("inside_50", "inside_95")
    ]
    return *shares, float(np.median([one.width_95 for one in own])), len(own), math.fsum(points)

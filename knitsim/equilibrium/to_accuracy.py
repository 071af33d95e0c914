"""Ask for an accuracy instead of a resolution.

>>> from knitsim.equilibrium.fabric import Fabric
>>> from knitsim.yarn.law import paper_k3
>>> cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
>>> found = settings_for(cotton, 0.01)
>>> found.resolution.points, found.resolution.contacts
(64, 512)
>>> found.estimate <= 0.01
True
"""

from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium.fabric import LEAST_POINTS, Resolution
from knitsim.equilibrium.pull import FRICTION_INCREMENT, tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError

# Control points a loop, and contact points over those of the contact law's rule: what stood on the
# front of run time against error (benchmark) for a cotton jersey, from fast to exact.
LADDER = (
    (40, 0.5), (48, 0.6), (64, 0.8), (64, 1.2), (64, 1.6), (96, 2.4), (128, 3.2), (192, 4.8),
    (256, 6.4),
)  # fmt: skip
# Strains that the error is estimated at, over the largest: small ones, where little force stands
# against the ripple of the contact points, and then evenly.
PLACES = np.array([0.25, 0.5, *range(1, 9)]) / 8.0
LARGEST = {"course": 0.6, "wale": 0.4}
LEAST_INCREMENT = FRICTION_INCREMENT / 32.0
SHARE = 0.5  # of the error asked for that is left to the increments, with friction


@dataclass(frozen=True)
class Settings:
    """What gives the accuracy asked for: ``relax(fabric, resolution)``, ``tensile(...,
    increment=increment)``; estimate: the estimated error of the force (1), None where not sought."""

    resolution: Resolution
    increment: float
    estimate: float | None

    def as_dict(self):
        """As plain data; contacts None: by the rule of the contact law."""
        return {
            "points": self.resolution.points, "contacts": self.resolution.contacts,
            "increment": self.increment, "estimated_error": self.estimate,
        }  # fmt: skip


def settings_for(fabric, error, largest=None):
    """The cheapest settings of a ladder at which the forces of ``fabric`` are exact to ``error``.

    error: of the force in tension, relative to max(|force|, 1 % of the largest), as estimated by
    :mod:`knitsim.equilibrium.accuracy`; between 1e-5 and 0.5.  largest: largest strain by direction
    ("course", "wale") up to which that holds, 60 % and 40 % where None.  Returns :class:`Settings`.

    Raises InputError for values out of range and for an accuracy that the finest settings miss,
    ComputationError where the fabric has no equilibrium at rest.
    """
    if not 1e-5 <= error <= 0.5:
        raise InputError("accuracy", error, "must be between 1e-05 and 0.5")
    largest = LARGEST if largest is None else largest
    if not largest or not set(largest) <= set(LARGEST):
        raise InputError("largest", sorted(largest), "must name course, wale or both")
    strains = {direction: top * PLACES for direction, top in largest.items()}
    rubs = fabric.friction > 0.0
    smooth = replace(fabric, friction=0.0)
    allowed = error * (1.0 - SHARE) if rubs else error
    resolution, spatial = _resolution(smooth, strains, allowed)
    if not rubs:
        return Settings(resolution, FRICTION_INCREMENT, spatial)
    increment, estimate = _increment(relax(fabric, resolution), strains, error)
    return Settings(resolution, increment, estimate)


def _resolution(fabric, strains, allowed):
    """The first rung of the ladder with an estimated error of ``allowed`` at most, and that error."""
    rule = Resolution(points=LEAST_POINTS).contacts_for(fabric)
    estimate = np.inf
    for points, share in LADDER:
        contacts = 4 * int(np.ceil(max(share * rule, 2 * points) / 4.0))
        resolution = Resolution(points, contacts)
        try:
            estimate = _largest(relax(fabric, resolution), strains, FRICTION_INCREMENT)
        except ComputationError:
            if (points, share) == LADDER[-1]:
                raise
            continue
        if estimate <= allowed:
            return resolution, estimate
    raise InputError(
        "accuracy", f"{allowed:g}",
        f"is not reached: the finest settings come to {estimate:.2g} in these strains",
    )  # fmt: skip


def _increment(relaxed, strains, allowed):
    """The largest increment with an estimated error of ``allowed`` at most, and that error."""
    increment = FRICTION_INCREMENT
    while increment >= LEAST_INCREMENT:
        estimate = _largest(relaxed, strains, increment)
        if estimate <= allowed:
            return increment, estimate
        increment /= 2.0
    raise InputError(
        "accuracy", f"{allowed:g}",
        f"of the increments with friction is not reached: the smallest come to {estimate:.2g}",
    )  # fmt: skip


def _largest(relaxed, strains, increment):
    """The largest estimated error of all tests; infinite where a state is missing or not known."""
    largest = 0.0
    for direction, asked in strains.items():
        curve = tensile(relaxed, direction, asked, increment=increment, estimate_error=True)
        errors = curve.numerical_error
        if len(errors) < len(asked) or not np.isfinite(errors).all():
            return np.inf
        largest = max(largest, float(errors.max()))
    return largest

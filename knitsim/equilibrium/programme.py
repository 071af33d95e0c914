"""Programmes of loads, and what friction makes of them: cycles, handling before a test, rest states.

With friction a fabric remembers.  A programme pulls it to any sequence of turning points; a history is
a programme that is gone through before a test and released, whose end is the state that the test starts
from.

>>> from knitsim.equilibrium.fabric import Fabric
>>> from knitsim.equilibrium.relax import relax
>>> from knitsim.yarn.law import paper_k3
>>> cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(True), friction=0.1)
>>> loop = programme(relax(cotton), "course", [Strain(0.3), Strain(0.15), Strain(0.3)], states=1)
>>> [round(1e3 * float(f), 2) for f in loop.force_per_loop]  # mN: back to the force it had
[16.27, 6.21, 16.27]
"""

from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium.accuracy import solved
from knitsim.equilibrium.kernels.accept import RUBBED_TOLERANCE
from knitsim.equilibrium.pull import (
    FRICTION_INCREMENT,
    LARGEST_STRAIN,
    PULLED,
    curve_of,
    laterally,
    strains_in,
    walk_from,
)
from knitsim.equilibrium.result import LOADING, RECOVERY
from knitsim.errors import ComputationError, InputError

SHORTEST = -0.5  # strain to which a fabric may be pushed together
PART = 0.05  # strain between states on the way to a force
SHAKES, SHAKEN, FADING = (
    8,
    0.15,
    0.6,
)  # decaying cycles, the first's strain, each over the one before


@dataclass(frozen=True)
class Strain:
    """A turning point: engineering strain along the pull, from the state that the programme starts in."""

    value: float

    def __post_init__(self):
        if not SHORTEST <= self.value <= LARGEST_STRAIN:
            raise InputError(
                "strain", self.value, f"must be between {SHORTEST:g} and {LARGEST_STRAIN:g}"
            )


@dataclass(frozen=True)
class Force:
    """A turning point: force per width along the pull (N/m), over the width that the programme starts in."""

    value: float

    def __post_init__(self):
        if not np.isfinite(self.value):
            raise InputError("force", self.value, "must be finite (N/m)")


RELEASED = Force(0.0)


def programme(
    relaxed,
    direction,
    turns,
    *,
    lateral="free",
    states=5,
    increment=FRICTION_INCREMENT,
    accuracy=None,
    estimate_error=False,
):
    """Pull along ``direction`` to one turning point after another; a :class:`.result.Curve`.

    turns: Strain and Force objects, in order; lateral: as in :func:`.pull.tensile`; states: that are kept
    on the way to each strain, the turning point the last of them; on the way to a force one about every 5
    % strain.  In the result ``segment`` numbers the turning points, ``phase`` says whether the fabric gets
    longer, ``cycle`` counts how often it starts to.  increment, accuracy, estimate_error: as in tensile.

    A path that cannot be followed to its end gives the states reached and a stop_reason.  Raises
    InputError for turning points that make no sense.
    """
    if direction not in PULLED:
        raise InputError("direction", direction, "must be course or wale")
    if not turns or not all(isinstance(turn, (Strain, Force)) for turn in turns):
        raise InputError("turns", turns, "must be one or more of Strain and Force")
    if states < 1:
        raise InputError("states", states, "must be 1 or more")

    def run(start, increment):
        return _programme(start, direction, turns, lateral, states, increment)

    return solved(relaxed, run, increment, accuracy, estimate_error)


def _programme(relaxed, direction, turns, lateral, states, increment):
    pulled, across = PULLED[direction]
    start, load, free = laterally(relaxed, pulled, across, lateral)
    length = (relaxed.wale_spacing, 0.0, 0.0, relaxed.course_spacing)
    base, width = length[pulled], length[across]
    walk = walk_from(relaxed, start, free, [pulled], load, increment, base, strains_in(base))
    at = relaxed.model.lattice + pulled
    cycle, longer = 0, False
    for turn in turns:
        here = walk.y[at] / base - 1.0
        rises = turn.value > (here if isinstance(turn, Strain) else walk.force_per_width(at, width))
        cycle += rises and not longer
        longer = rises
        phase = LOADING if rises else RECOVERY
        if isinstance(turn, Strain):
            way = np.linspace(here, turn.value, states + 1)[1:]
            done = walk.forward(base * (1.0 + way)[:, None], phase, max(cycle, 1))
        else:
            end = LARGEST_STRAIN if rises else SHORTEST
            way = here + np.sign(end - here) * np.arange(PART, abs(end - here), PART)
            wanted = turn.value * width * relaxed.model.loops
            done = walk.to_force(base * (1.0 + way)[:, None], wanted, phase, max(cycle, 1))
        if not done:
            break
    return curve_of(relaxed, walk, direction, pulled, base, width, free, load)


@dataclass(frozen=True)
class Handled:
    """One step of a history: pulled along ``direction`` to the turning points, then released."""

    direction: str
    turns: tuple


def handled(relaxed, history, increment=FRICTION_INCREMENT):
    """The relaxed state after a history (a sequence of :class:`Handled`), free of force.

    Without friction nothing is remembered, and the state comes back as it was.  Raises ComputationError
    where it cannot be followed.
    """
    for step in history:
        turns = [*step.turns, RELEASED]
        curve = programme(relaxed, step.direction, turns, states=1, increment=increment)
        if curve.stop_reason:
            raise ComputationError(f"history, {step.direction}: {curve.stop_reason}")
        relaxed = replace(
            curve.start, y=curve.y[-1], energy=curve.energy[-1], memory=curve.memory,
            residual=float(curve.residual[-1]), min_distance=float(curve.min_distance[-1]),
            history=(*relaxed.history, step),
        )  # fmt: skip
    return relaxed


def shaken(strain=SHAKEN):
    """The history of a fabric that is shaken loose: pulled both ways in turn, less each time."""
    return tuple(
        Handled(direction, (Strain(strain * FADING**n),))
        for n in range(SHAKES)
        for direction in ("course", "wale")
    )


def conditioned(curve, tolerance=0.01):
    """Number of the cycle from which on loops of a curve close to ``tolerance``; None where none does.

    A loop closes where its peak force differs from that of the cycle before by at most this part of it.
    """
    peaks = [curve.force_per_loop[curve.cycle == c].max() for c in np.unique(curve.cycle)]
    for cycle in range(1, len(peaks)):
        if abs(peaks[cycle] / peaks[cycle - 1] - 1.0) <= tolerance:
            return cycle + 1
    return None


def per_cycle(curve):
    """Peak force per width (N/m), residual strain and energy lost per loop (J) of each cycle: (cycles, 3).

    The residual strain is that of the cycle's last state, NaN where it is not free of force.
    """
    rows, lost = [], 0.0
    zero = 2.0 * RUBBED_TOLERANCE * np.abs(curve.force_per_width).max(initial=0.0)
    for cycle in np.unique(curve.cycle):
        own = curve.cycle == cycle
        peak, last = np.abs(curve.force_per_width[own]).max(), np.flatnonzero(own)[-1]
        free = abs(curve.force_per_width[last]) <= zero
        rows.append((peak, curve.strain[last] if free else np.nan, curve.dissipated[last] - lost))
        lost = curve.dissipated[last]
    return np.array(rows)


def growth(curve):
    """Residual strain after the last cycle less that after the first; NaN where either is not known."""
    residual = per_cycle(curve)[:, 1]
    return float(residual[-1] - residual[0]) if len(residual) else np.nan


def returned(curve):
    """Largest change of the force where a curve comes back to a strain at which it turned before; NaN
    where it never does.

    By a memory of turning points (:mod:`.kernels.friction`) a loop between two of them leaves no trace.
    """
    ends = np.flatnonzero(np.diff(curve.segment, append=curve.segment[-1:] + 1))
    changes, largest = [], np.abs(curve.force_per_loop).max(initial=0.0)
    for later, end in enumerate(ends):
        for before in ends[:later]:
            between = curve.strain[before : end + 1]
            inside = between.max() <= curve.strain[before] * (1.0 + 1e-9)
            same = abs(curve.strain[end] - curve.strain[before]) <= 1e-6
            if same and inside and curve.force_per_loop[before] > 0.01 * largest:
                changes.append(curve.force_per_loop[end] / curve.force_per_loop[before] - 1.0)
    return float(max(changes, key=abs)) if changes else np.nan


def rest_line(relaxed, largest=0.4, states=4, increment=FRICTION_INCREMENT):
    """Spacings (m) in which friction lets the fabric rest, (2 states + 1, 2): wale, course.

    From the one end, where it was pulled along the course as far as ``largest`` (strain) and released, to
    the other, pulled along the wale; the state itself stands in the middle.
    """
    strains = largest * np.arange(1, states + 1) / states
    ends = {}
    for direction in PULLED:
        found = []
        for strain in strains:
            state = handled(relaxed, [Handled(direction, (Strain(strain),))], increment)
            found.append((state.wale_spacing, state.course_spacing))
        ends[direction] = found
    middle = (relaxed.wale_spacing, relaxed.course_spacing)
    return np.array([*ends["course"][::-1], middle, *ends["wale"]])

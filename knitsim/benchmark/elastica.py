"""The same scene by this solver and by PyElastica, an optional extra: time to reach an error.

PyElastica (Cosserat rods, explicit steps) is driven to rest by damping, this solver goes there by
Newton's method.  Both are timed in CPU time, compiled, and tuned: each may use any of its settings
listed here, and the fastest that reaches the error counts.  PyElastica's clock stops when its error
has come below the target to stay; it is told the exact answer and need not find out by itself.  This
solver's runs to its own convergence.

Scenes, both with exact answers: a cantilever under a dead load P L2/EI = 4 at its tip, compared in
the tip's deflection (:mod:`knitsim.verification.exact_rods`), and a cantilever lifted by a rigid
cylinder, compared in the height of its free end (:mod:`knitsim.benchmark.exact`).
"""

import importlib.metadata
import importlib.util
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from knitsim.benchmark.exact import lifted_end
from knitsim.benchmark.front import cpu_time
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, solve_open
from knitsim.verification import exact_rods
from knitsim.yarn.law import TensionLaw

TARGETS = (1e-2, 1e-3)
LOAD = 4.0  # P L2/EI of the cantilever
NAME = "pyelastica"
# The cylinder: how far along the rod its axis stands, how far below, and the distance of the centre
# line from it, all over the rod's length.
ALONG, BELOW, RADIUS = 0.5, 0.1, 0.2
SOFT, RISE = 100.0, 1.0  # contact stiffness (L3/EI) that PyElastica begins with; how long it rises
MOST_SECONDS = 60.0  # CPU time after which a run of PyElastica is given up


def version():
    """Version of PyElastica, or None where it is not installed."""
    if importlib.util.find_spec("elastica") is None:
        return None
    return importlib.metadata.version(NAME)


@dataclass(frozen=True)
class Reached:
    """The best time of one solver to one target: seconds and settings, or NaN and why not."""

    scene: str
    solver: str
    target: float
    seconds: float
    error: float
    settings: str


# This solver.


def own_cantilever(elements, steps):
    """Relative error of the tip's deflection."""
    exact = exact_rods.tip_load(LOAD)
    length, rigidity = 0.1, 1e-6
    unit = rigidity / length**2
    yarn = OpenYarn(
        length, rigidity, TensionLaw([0.0, 0.1], [0.0, 1e6 * unit]), elements,
        start=Support("clamped", direction=(1.0, 0.0, 0.0)), tip_force=(0.0, -LOAD * unit, 0.0),
    )  # fmt: skip
    state = solve_open([yarn], steps=steps)
    return abs(-state.end(0)[1] / length / exact.deflection - 1.0)


def own_lifted(elements, steps):
    """Relative error of the height of the free end."""
    length, rigidity = 0.1, 1e-6
    unit = rigidity / length**2
    yarn = OpenYarn(
        length, rigidity, TensionLaw([0.0, 0.1], [0.0, 1e6 * unit]), elements,
        start=Support("clamped", direction=(1.0, 0.0, 0.0)), contacts=4,
    )  # fmt: skip
    cylinder = Cylinder(
        (ALONG * length, -BELOW * length, 0.0), (0.0, 0.0, 1.0), RADIUS * length, 1e6 * unit
    )
    state = solve_open([yarn], cylinders=[cylinder], steps=steps)
    return abs(state.end(0)[1] / length / lifted_end(ALONG, BELOW, RADIUS)[1] - 1.0)


def _own(scene, run, settings):
    """Best times of this solver over (elements, steps), elements rising.

    An error counts as large as the largest with as many elements or more, so that one that is small
    by chance buys nothing.  (PyElastica's are taken as they come.)
    """
    tried, largest = [], 0.0
    for elements, steps in reversed(settings):
        run(elements, steps)
        error, seconds, _ = cpu_time(partial(run, elements, steps), 5)
        largest = max(largest, float(error))
        tried.append((seconds, largest, f"{elements} elements a yarn, load in {steps} steps"))
    return [_best(scene, "knitsim", target, tried) for target in TARGETS]


def _best(scene, solver, target, tried):
    """The fastest of (seconds, error, settings) that reaches ``target``; else which came closest."""
    reached = [one for one in tried if one[1] <= target and math.isfinite(one[0])]
    if reached:
        return Reached(scene, solver, target, *min(reached))
    _, error, settings = min(tried, key=lambda one: one[1])
    return Reached(scene, solver, target, math.nan, error, f"not reached; closest: {settings}")


# PyElastica.


@dataclass(frozen=True)
class Driven:
    """A PyElastica scene under way: one step of it, its error now, and the length of a step (s)."""

    step: Callable
    error: Callable
    time_step: float


def _simulator():
    import elastica

    class Scene(
        elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping,
        elastica.Contact,
    ):  # fmt: skip
        pass

    return elastica, Scene()


def _driven(elastica, scene, time_step, error):
    scene.finalize()
    stepper, now = elastica.PositionVerlet(), [np.float64(0.0)]

    def step():
        now[0] = stepper.step(scene, now[0], np.float64(time_step))

    return Driven(step, error, time_step)


def _cantilever(elastica, scene, elements, slender, courant, damping):
    """A clamped rod of length 1, EI = 1 and mass 1 in ``scene``, and the time step for it.

    slender: length over radius; courant: time step over radius/speed of sound, about the limit that
    the turning of sections sets; damping: rate over twice the first circular frequency of the
    straight cantilever (1: critical).

    PyElastica clamps a whole element, which by itself leaves an error of the first order.  So the rod
    begins half an element before the clamp, and its error is of the second order.
    """
    radius, piece = 1.0 / slender, 1.0 / (elements - 0.5)
    modulus, density = 4.0 / (math.pi * radius**4), 1.0 / (math.pi * radius**2)
    rod = elastica.CosseratRod.straight_rod(
        elements, np.array([-0.5 * piece, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 0.0, 1.0]), 1.0 + 0.5 * piece, radius, density,
        youngs_modulus=modulus, shear_modulus=modulus / 2.0,
    )  # fmt: skip
    scene.append(rod)
    scene.constrain(rod).using(
        elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    step = courant * radius / math.sqrt(modulus / density)
    scene.dampen(rod).using(
        elastica.AnalyticalLinearDamper,
        uniform_damping_constant=2.0 * 3.516 * damping, time_step=step,
    )  # fmt: skip
    return rod, step


def elastica_cantilever(elements, slender, courant, damping):
    """The rod under a dead load across its tip; for the arguments see :func:`_cantilever`."""
    elastica, scene = _simulator()
    rod, step = _cantilever(elastica, scene, elements, slender, courant, damping)
    scene.add_forcing_to(rod).using(
        elastica.EndpointForces, np.zeros(3), np.array([0.0, -LOAD, 0.0]), ramp_up_time=1e-9
    )
    exact = exact_rods.tip_load(LOAD).deflection
    return _driven(
        elastica, scene, step, lambda: abs(-rod.position_collection[1, -1] / exact - 1.0)
    )


def elastica_lifted(elements, slender, courant, damping, contact):
    """The same rod without load, lifted by a cylinder; contact: stiffness of the contact, L3/EI.

    The rod starts straight, deep in the cylinder, and would be shot away by a stiff contact; so the
    stiffness rises from what lifts it gently.
    """
    elastica, scene = _simulator()

    class Rising(elastica.RodCylinderContact):
        def apply_contact(self, system_one, system_two, time=0.0):
            self.k = np.float64(contact * (SOFT / contact) ** max(1.0 - time / RISE, 0.0))
            super().apply_contact(system_one, system_two, time)

    rod, step = _cantilever(elastica, scene, elements, slender, courant, damping)
    bar = elastica.Cylinder(
        np.array([ALONG, -BELOW, -0.5]), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]),
        1.0, RADIUS - 1.0 / slender, 1.0,
    )  # fmt: skip
    scene.append(bar)
    scene.constrain(bar).using(
        elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    scene.detect_contact_between(rod, bar).using(Rising, k=SOFT, nu=0.0)
    exact = lifted_end(ALONG, BELOW, RADIUS)[1]
    return _driven(elastica, scene, step, lambda: abs(rod.position_collection[1, -1] / exact - 1.0))


def settle(driven, duration, targets=TARGETS, most=MOST_SECONDS, looks=400):
    """CPU seconds until the error of ``driven`` is below each target to stay, NaN where it never is.

    duration: simulated time (s); the error is read ``looks`` times in it, outside the clock.
    """
    steps = max(1, round(duration / driven.time_step / looks))
    spent, history = 0.0, []
    for _ in range(looks):
        begin = time.process_time()
        for _ in range(steps):
            driven.step()
        spent += time.process_time() - begin
        with np.errstate(all="ignore"):
            history.append((spent, float(driven.error())))
        if spent > most or not math.isfinite(history[-1][1]):
            break
    seconds, errors = np.array(history).T
    found = []
    for target in targets:
        above = np.flatnonzero(~(errors <= target))
        first = 0 if not above.size else above[-1] + 1
        found.append(
            (seconds[first], errors[-1]) if first < errors.size else (math.nan, errors[-1])
        )
    return found


# What each solver may use; PyElastica's were found by trying several times as many.
_OWN = {
    "cantilever": (own_cantilever, ((10, 1), (12, 1), (14, 1), (16, 1), (20, 1))),
    "rod lifted by a cylinder": (
        own_lifted, ((10, 1), (12, 1), (16, 1), (20, 1), (30, 1), (40, 1), (60, 1), (80, 1), (120, 1)),
    ),
}  # fmt: skip
_OTHER = {
    "cantilever": (
        elastica_cantilever,
        ((8, 15, 0.5, 0.8), (8, 20, 0.6, 0.8), (10, 20, 0.6, 0.8), (14, 30, 0.6, 0.9)),
    ),
    "rod lifted by a cylinder": (
        elastica_lifted, ((40, 40, 0.3, 0.8, 1e5), (80, 40, 0.3, 0.8, 1e5), (160, 80, 0.3, 0.8, 1e6)),
    ),
}  # fmt: skip
_NAMES = ("elements", "length/radius", "time step c/radius", "damping/critical", "contact L3/EI")
DURATION = 5.0  # of a PyElastica run; the first period of the straight cantilever is 1.8


def compare():
    """The best times of both solvers in both scenes, :class:`Reached`; this solver's come first."""
    found = []
    for scene, (run, settings) in _OWN.items():
        found += _own(scene, run, settings)
        build, others = _OTHER[scene]
        tried = {target: [] for target in TARGETS}
        for setting in others:
            build(*setting).step()  # compiles
            name = ", ".join(f"{n} {v:g}" for n, v in zip(_NAMES, setting, strict=False))
            for target, (seconds, error) in zip(
                TARGETS, settle(build(*setting), DURATION), strict=True
            ):
                tried[target].append((seconds, error if math.isfinite(error) else math.inf, name))
        found += [_best(scene, NAME, target, tried[target]) for target in TARGETS]
    return found

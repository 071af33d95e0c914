"""Run time against error of the equilibrium model: relaxing, tension, bending, with friction.

The fabric is the paper's cotton fabric.  Errors of forces are the largest over the states, each
relative to the force at the same strain on loading, or to 1 % of the largest where that is more.
"""

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from knitsim.benchmark.front import Setting, Task
from knitsim.equilibrium import bend as bending
from knitsim.equilibrium import model
from knitsim.equilibrium import pull as tension
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.store.tensile import SMALLEST_OF_LARGEST
from knitsim.yarn.law import paper_k3

COTTON = Fabric(1e-2 / 6.67, 1e-2 / 8.33, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
FRICTION = 0.2
STATES = 30
LARGEST = {"course": 1.5, "wale": 0.9}
LARGEST_RUBBING = {"course": 0.6, "wale": 0.4}
# 1/m: to the one side, through zero to the other.
CURVATURES = 250.0 * np.concatenate([np.arange(11) / 10, np.arange(9, -11, -1) / 10])
# Knobs that the fabric at rest does not depend on.
_OF_THE_PATH = ("increment", "turn", "step", "arc")
# (module, constant) of the settings that are no argument of the public functions.
_CONSTANTS = {
    "tolerance": (model, "TOLERANCE"),
    "step": (tension, "INCREMENT"),
    "arc": (bending, "INCREMENT"),
}


@dataclass(frozen=True)
class Knobs:
    """Every setting of the solver that bears on error or run time; the defaults are the solver's.

    points, contacts: per loop, contacts None for the rule of the contact law; cell: ``symmetric`` or
    ``full``; increment: of strain in one solved step with friction; turn: of curvature (1/m)
    likewise; step, arc: of strain and of curvature (1/m) without friction; tolerance: of the
    residual, over B/d2.
    """

    points: int = Resolution().points
    contacts: int | None = None
    cell: str = "symmetric"
    increment: float = tension.FRICTION_INCREMENT
    turn: float = bending.FRICTION_INCREMENT
    step: float = tension.INCREMENT
    arc: float = bending.INCREMENT
    tolerance: float = model.TOLERANCE

    @property
    def resolution(self):
        return Resolution(self.points, self.contacts, self.cell)

    @property
    def name(self):
        """The points and contacts, and in words what else is not the default."""
        words = [f"{self.points} points, {self.resolution.contacts_for(COTTON)} contacts"]
        if self.cell != "symmetric":
            words.append(f"{self.cell} cell")
        for knob in ("tolerance", *_OF_THE_PATH):
            if getattr(self, knob) != getattr(DEFAULT, knob):
                words.append(f"{knob} {getattr(self, knob):g}")
        return ", ".join(words)


DEFAULT = Knobs()


@contextmanager
def _set(knobs):
    """Within it the solver's constants are those of ``knobs``."""
    with ExitStack() as stack:
        for knob, (module, name) in _CONSTANTS.items():
            stack.callback(setattr, module, name, getattr(module, name))
            setattr(module, name, getattr(knobs, knob))
        yield


def spacing_errors(relaxed, reference):
    """(largest relative error of the relaxed spacings,)."""
    return (
        max(
            abs(relaxed.wale_spacing / reference.wale_spacing - 1.0),
            abs(relaxed.course_spacing / reference.course_spacing - 1.0),
        ),
    )


def force_errors(curve, reference):
    """(largest relative error of the force,); with recovery also that of the residual strain.

    NaN where the curve ends early.
    """
    if curve.stop_reason:
        return (np.nan,) * (2 if reference.phase.any() else 1)
    loading = reference.phase == 0
    strain, force = reference.strain[loading], reference.force_per_loop[loading]
    least = SMALLEST_OF_LARGEST * force.max()
    largest = 0.0
    # The last state of a recovery is where the force is zero, at a strain of its own.
    for phase, own, theirs in ((0, slice(None), slice(None)), (1, slice(-1), slice(-1))):
        mine = np.flatnonzero(curve.phase == phase)[own]
        his = np.flatnonzero(reference.phase == phase)[theirs]
        for i in mine:
            same = his[np.abs(reference.strain[his] - curve.strain[i]) < 1e-9]
            if same.size:
                size = max(np.interp(curve.strain[i], strain, force), least)
                away = abs(curve.force_per_loop[i] - reference.force_per_loop[same[0]])
                largest = max(largest, away / size)
    if not reference.phase.any():
        return (largest,)
    return largest, abs(curve.strain[-1] / reference.strain[-1] - 1.0)


def moment_errors(curve, reference):
    """Largest error of the moment over the largest moment, and the same of its change from flat."""
    if curve.stop_reason:
        return np.nan, np.nan
    mine, his = curve.moment_per_width, reference.moment_per_width
    change, changed = mine - mine[0], his - his[0]
    return (
        np.abs(mine - his).max() / np.abs(his).max(),
        np.abs(change - changed).max() / np.abs(changed).max(),
    )


class _Runs:
    """The tests by their Knobs; relaxed fabrics are found once."""

    def __init__(self):
        self.known = {}

    def relaxed(self, knobs, friction=0.0):
        key = replace(knobs, **dict.fromkeys(_OF_THE_PATH, 0)), friction
        if key not in self.known:
            with _set(knobs):
                self.known[key] = relax(replace(COTTON, friction=friction), knobs.resolution)
        return self.known[key]

    def relaxing(self, knobs):
        with _set(knobs):
            return relax(COTTON, knobs.resolution)

    def pulled(self, knobs, direction):
        relaxed = self.relaxed(knobs)
        strains = LARGEST[direction] * np.arange(1, STATES + 1) / STATES
        with _set(knobs):
            return tensile(relaxed, direction, strains)

    def rubbed(self, knobs, direction):
        relaxed = self.relaxed(knobs, FRICTION)
        strains = LARGEST_RUBBING[direction] * np.arange(1, STATES + 1) / STATES
        with _set(knobs):
            return tensile(relaxed, direction, strains, recovery=True, increment=knobs.increment)

    def bent(self, knobs, direction):
        relaxed = self.relaxed(knobs)
        with _set(knobs):
            return bend(relaxed, direction, CURVATURES)

    def bent_rubbing(self, knobs, direction):
        relaxed = self.relaxed(knobs, FRICTION)
        with _set(knobs):
            return bend(relaxed, direction, CURVATURES, increment=knobs.turn)


def _grid(points, contacts):
    """Knobs of all pairs with two contact points a control point or more; the default among them."""
    own = DEFAULT.resolution.contacts_for(COTTON)
    pairs = [(p, c) for p in points for c in contacts if c >= 2 * p]
    return [DEFAULT, *(Knobs(p, c) for p, c in pairs if (p, c) != (DEFAULT.points, own))]


def _task(runs, test, quantities, errors, run, all_knobs, reference, check, friction=None):
    """A Task of the equilibrium solver; friction: of the relaxed fabric needed before, or None."""

    def prepare(knobs):
        return None if friction is None else lambda: runs.relaxed(knobs, friction)

    settings = tuple(Setting(k.name, partial(run, k), k == DEFAULT, prepare(k)) for k in all_knobs)
    return Task(
        "equilibrium", test, quantities, settings, partial(run, reference), partial(run, check),
        errors,
    )  # fmt: skip


def frictionless_tasks(full):
    """Relaxing, tension along course and wale, bending of both, without friction.

    full: many settings and the finest reference; else a handful.
    """
    runs = _Runs()
    if full:
        reference, check = Knobs(192, 1536), Knobs(128, 1024)
        grid = _grid((24, 32, 40, 48, 64, 80, 96, 128), (160, 192, 256, 320, 384, 512, 768))
        more = [
            *(replace(DEFAULT, tolerance=t) for t in (1e-2, 1e-4, 1e-8)),
            *(Knobs(p, c, "full") for p, c in ((32, 192), (48, 192), (48, None), (64, 256))),
        ]
        steps = [replace(DEFAULT, step=step) for step in (0.025, 0.05, 0.2)]
        arcs = [replace(DEFAULT, arc=arc) for arc in (6.25, 12.5)]
    else:
        reference, check = Knobs(128, 1024), Knobs(96, 768)
        grid = [
            DEFAULT,
            *(Knobs(p, c) for p, c in ((32, 192), (40, 160), (48, 192), (64, 256), (64, 512))),
        ]
        more = [replace(DEFAULT, tolerance=1e-4)]
        steps = arcs = []
    tasks = [
        _task(
            runs, "relaxing", ("spacings",), spacing_errors, runs.relaxing, grid + more, reference,
            check,
        )
    ]  # fmt: skip
    for direction in ("course", "wale"):
        pulled = partial(_swapped, runs.pulled, direction)
        tasks.append(
            _task(
                runs, f"{direction} tension", ("force",), force_errors, pulled,
                grid + more + steps, reference, check, 0.0,
            )
        )  # fmt: skip
    for direction in ("course", "wale"):
        tasks.append(
            _task(
                runs, f"{direction} bending", ("moment", "change of moment"), moment_errors,
                partial(_swapped, runs.bent, direction), grid + more + arcs, reference, check, 0.0,
            )
        )  # fmt: skip
    return tasks


def friction_tasks(full):
    """Tension with friction, loading and recovery to zero force, and in full also bending."""
    runs, own = _Runs(), DEFAULT.increment
    if full:
        reference, check = (Knobs(64, 512, increment=own / n) for n in (16, 8))
        knobs = [
            DEFAULT,
            *(Knobs(p, c) for p, c in ((32, 192), (40, 160), (48, 192), (64, 256), (64, 512))),
            *(Knobs(p, c, increment=own / n) for p, c in ((48, 192), (48, None), (64, 512))
              for n in (2, 4, 8)),
            replace(DEFAULT, tolerance=1e-4),
            replace(DEFAULT, tolerance=1e-8), Knobs(48, 192, "full"),
        ]  # fmt: skip
    else:
        reference, check = (Knobs(64, 256, increment=own / n) for n in (8, 4))
        knobs = [DEFAULT, Knobs(40, 160), Knobs(48, 192), Knobs(48, 192, increment=own / 2)]
    tasks = [
        _task(
            runs, f"{direction} tension with friction", ("force", "residual strain"), force_errors,
            partial(_swapped, runs.rubbed, direction), knobs, reference, check, FRICTION,
        )
        for direction in (("course", "wale") if full else ("wale",))
    ]  # fmt: skip
    if not full:
        return tasks
    reference, check = (Knobs(64, 512, turn=bending.FRICTION_INCREMENT / n) for n in (16, 8))
    knobs = [
        DEFAULT,
        *(Knobs(p, c) for p, c in ((32, 192), (40, 160), (48, 192), (64, 256), (64, 512))),
        *(replace(DEFAULT, turn=bending.FRICTION_INCREMENT / n) for n in (2, 4, 8)),
        *(Knobs(64, 512, turn=bending.FRICTION_INCREMENT / n) for n in (2, 4)),
        Knobs(48, 192, "full"),
    ]
    return tasks + [
        _task(
            runs, f"{direction} bending with friction", ("moment", "change of moment"),
            moment_errors, partial(_swapped, runs.bent_rubbing, direction), knobs, reference,
            check, FRICTION,
        )
        for direction in ("course", "wale")
    ]  # fmt: skip


def _swapped(run, direction, knobs):
    return run(knobs, direction)

"""A random case solved and judged: what became of each of its tests, in rows.

Outcomes: "verified", all that was asked was reached and the judge found nothing; "stopped", the test
ended before with its reason; "refused", InputError or ComputationError with its reason; "wrong", the
judge found something, the load is further from that at twice the resolution than was said, an input
that no fabric has was taken, or the solver failed in another way.  Stopped tests are judged too.
"""

import time
from dataclasses import fields, replace

import numpy as np

from knitsim.equilibrium.accuracy import scale_of
from knitsim.equilibrium.bend import FRICTION_INCREMENT as BENDING_FRICTION_INCREMENT
from knitsim.equilibrium.bend import INCREMENT as BENDING_INCREMENT
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.pull import FRICTION_INCREMENT, biaxial, shear, tensile
from knitsim.errors import ComputationError, InputError
from knitsim.verification.judge.given import Core
from knitsim.verification.judge.loads import HELD
from knitsim.verification.judge.verdict import judge
from knitsim.verification.trials.law import NO_INPUT, Asked, Case
from knitsim.verification.trials.rule import impossible
from knitsim.verification.trials.told import given_of, relaxed_of, states_of, wanted_of

VERIFIED, STOPPED, REFUSED, WRONG = OUTCOMES = ("verified", "stopped", "refused", "wrong")
# Checks that a fabric fails too that snaps from one shape to another.
SNAPPING = {
    "work is not stored or lost", "energy lost without friction",
    "work of the load is not stored or lost", "energy is below that at rest",
}  # fmt: skip
# And these, where it does so over several solved steps, of which friction remembers each.
TAKEN = {
    "friction takes more than Coulomb's law", "friction takes less than it must",
    "friction holds another energy",
}  # fmt: skip
ALOUD = 0.2  # estimated errors above it are said aloud
REFINED = 0.05  # change of the load at twice the resolution that needs not be said
FILLED = 3  # times at most that states are added, as steps are halved elsewhere then
MOST_STATES = 500  # that the judge reads of one way
JUMPS = 0.1  # of all work astray at least goes so where the fabric snaps
LOST_ALIKE = 0.8  # part of the work astray that is left in steps of a quarter where a fabric snaps

_CASE = [f.name for f in fields(Case) if f.name not in ("tests", "contact", "number")]
_CONTACT = ("contact_stiffness", "core", "exponent")
_ASKED = [f.name for f in fields(Asked) if f.name != "path"]
_FOUND = (
    "outcome", "reason", "states", "reached", "load", "first_load", "residual", "min_distance",
    "estimated_error", "refined_difference", "snaps",
)  # fmt: skip
COLUMNS = (
    "number", "seed", "test", *_CASE, *_CONTACT, "kinds", *_ASKED, "largest", "possible",
    "impossible_because", *_FOUND,
)  # fmt: skip
TIMES = ("number", "relaxing", "testing", "refining", "judging")


def run(campaign, numbers, seed=None):
    """Rows of results (mappings by COLUMNS) and of CPU times (by TIMES, s) of the cases ``numbers``."""
    rows, times = [], []
    for number in numbers:
        clock = Clock(TIMES[1:])
        case = campaign.draw(number, seed)
        same = {"seed": campaign.seed if seed is None else seed}
        rows += [same | row for row in rows_of(case, campaign.errors, clock)]
        times.append({"number": number, **clock.row()})
    return rows, times


class Clock:
    """CPU time by what it was spent on."""

    def __init__(self, names):
        self.spent = dict.fromkeys(names, 0.0)

    def time(self, name, call, *args, **more):
        """What the call gives; its time is added under the name."""
        start = time.process_time()
        try:
            return call(*args, **more)
        finally:
            self.spent[name] += time.process_time() - start

    def row(self):
        """Times so far, four digits."""
        return {name: f"{spent:.4g}" for name, spent in self.spent.items()}


def guarded(call, *args, **more):
    """(result or None, outcome, reason) of a call to the solver."""
    try:
        return call(*args, **more), VERIFIED, ""
    except (InputError, ComputationError) as error:
        return None, REFUSED, f"{type(error).__name__}: {error}"
    except Exception as error:  # whatever else happens is the solver's fault, and counts so
        return None, WRONG, f"{type(error).__name__}: {error}"


def rows_of(case, errors, clock):
    """Rows (by COLUMNS, without the seed), one for each test of a case."""
    row = inputs_of(case) | dict.fromkeys(_FOUND, "")
    relaxed, outcome, reason = clock.time("relaxing", guarded, relaxed_of, case)
    if relaxed is not None and case.family == NO_INPUT:
        relaxed, outcome, reason = None, WRONG, "an input that no fabric has was taken"
    # A core law is wrong in silence where contact points do not resolve it: it always says its error.
    errors = errors or case.refined or case.contact.core > 0.0
    rows = []
    for asked in case.tests:
        found = {"outcome": outcome, "reason": reason}
        if relaxed is not None:
            found = _found(case, relaxed, asked, errors, clock)
        own = {name: getattr(asked, name) for name in _ASKED}
        own |= {"test": asked.name, "largest": float(np.abs(asked.path).max())}
        rows.append(row | own | found)
    return rows


def inputs_of(case):
    """What is written of a case in each of its rows."""
    law, reasons = case.contact, impossible(case)
    row = {name: _text(getattr(case, name)) for name in _CASE}
    return row | {
        "number": case.number, "kinds": "; ".join(case.kinds),
        "contact_stiffness": law.stiffness, "core": law.core or "",
        "exponent": law.exponent if isinstance(law, Core) else "",
        "possible": "no" if reasons else "yes", "impossible_because": "; ".join(reasons),
    }  # fmt: skip


def _text(value):
    if not isinstance(value, tuple):
        return value
    return " ".join(v if isinstance(v, str) else f"{v:.9g}" for v in value)


def _found(case, relaxed, asked, error, clock):
    """Results of one test, by some of _FOUND."""
    curve, outcome, reason = clock.time("testing", guarded, solved, asked, relaxed, error)
    for _ in range(FILLED):
        # A jump is halved wherever it comes.
        many = curve is None or curve.steps > MOST_STATES
        if many or not curve.model.rub or not np.any(curve.increments > 1):
            break
        # What friction does is told anew exactly only where each solved step is a state.
        asked = every_step(asked, curve)
        curve, outcome, reason = clock.time("testing", guarded, solved, asked, relaxed, error)
    if curve is None:
        return {"outcome": outcome, "reason": reason}
    found = {"outcome": STOPPED if curve.stop_reason else VERIFIED, "reason": curve.stop_reason}
    found["states"] = curve.steps
    if not curve.steps:
        return found
    bends = asked.kind == "bending"
    load = _load(asked, curve)
    found |= {
        "reached": float((curve.curvature if bends else curve.strain)[-1]),
        "load": float(load[-1]), "first_load": float(load[0]),
        "residual": float(curve.residual.max()), "min_distance": float(np.min(curve.min_distance)),
    }  # fmt: skip
    if error:
        found["estimated_error"] = float(np.max(curve.numerical_error))
    # A test may take more contact points than the fabric at rest needs; it then starts from its own.
    start = curve.start
    states, given = states_of(asked, start, curve), given_of(case, start)
    wrong = clock.time("judging", judge, given, states, wanted_of(asked, start, curve))
    # What yarns are held with is an error of the resolution: whether it is told is seen at a finer one.
    held = [f for f in wrong if f.check == HELD]
    wrong = [f for f in wrong if f.check != HELD]
    checks = {f.check for f in wrong}
    if checks and checks <= SNAPPING | TAKEN:
        jumps = _jumps(asked, relaxed, states, given)
        if len(jumps) and (checks <= SNAPPING or (states.increments[jumps + 1] > 1).all()):
            found["snaps"], wrong = "yes", []
    wrong = [str(finding) for finding in wrong]
    if case.refined or held:
        curve = solved(asked, relaxed, error=True) if held and not error else curve
        off = clock.time("refining", _refined, case, relaxed, asked, curve)
        if off is not None:
            found["refined_difference"], limit = off
            if not off[0] <= limit:
                wrong.append(f"off by {off[0]:.3g} at twice the resolution, said {limit:.3g}")
        said = off is not None and np.isfinite(limit)
        wrong += [str(f) for f in held if not (said or (curve.numerical_error > ALOUD).all())]
    return found | ({"outcome": WRONG, "reason": "; ".join(wrong)} if wrong else {})


def _load(asked, curve):
    return curve.moment_per_width if asked.kind == "bending" else curve.force_per_loop


def every_step(asked, curve):
    """The test with a state wherever the solver has stepped between two, on ways back and out again too.

    Where that would be more than MOST_STATES on a way, at every second, third and so on.
    """
    share = -(-int(curve.increments.sum()) // (MOST_STATES * max(1, 2 * asked.cycles)))
    steps = -(-curve.increments // share)
    if asked.kind == "tension":
        # Every way goes through the same strains.
        parts, ends = {}, np.round(np.append(0.0, curve.strain), 6)
        for a, b, k in zip(ends[:-1], ends[1:], steps, strict=True):
            way = min(a, b), max(a, b)
            parts[way] = max(k, parts.get(way, 1))
        between = np.concatenate([np.linspace(*way, k + 1)[1:-1] for way, k in parts.items()])
        between = between[(between > 0.0) & (between < asked.path[-1])]
        return replace(asked, path=tuple(np.union1d(asked.path, between).tolist()))
    path = np.reshape(asked.path, (len(asked.path), -1))
    parts = np.ones(len(path), dtype=int)
    n = min(len(path), curve.steps)
    parts[:n] = np.maximum(steps[:n], 1)
    before = np.concatenate([np.zeros((1, path.shape[1])), path[:-1]])
    ways = zip(before, path, parts, strict=True)
    filled = np.concatenate([np.linspace(a, b, k + 1)[1:] for a, b, k in ways])
    return replace(asked, path=tuple(filled[:, 0] if filled.shape[1] == 1 else map(tuple, filled)))


def solved(asked, relaxed, error=False, finer=1):
    """Curve or BendingCurve of the test asked; error: with its estimate; finer: divides the steps."""
    if asked.kind == "bending":
        fabric = relaxed.model.fabric
        rubs = fabric.friction > 0.0 or fabric.bending_hysteresis > 0.0
        step = (BENDING_FRICTION_INCREMENT if rubs else BENDING_INCREMENT) / finer
        return bend(
            relaxed, asked.direction, asked.path, spacings=asked.lateral, increment=step,
            estimate_error=error,
        )  # fmt: skip
    step = {"increment": (asked.increment or FRICTION_INCREMENT) / finer}
    if asked.kind == "biaxial":
        return biaxial(relaxed, asked.path, **step)
    step["estimate_error"] = error
    if asked.kind == "shear":
        return shear(relaxed, asked.path, lateral=asked.lateral, tension=asked.tension, **step)
    return tensile(
        relaxed, asked.direction, asked.path, lateral=asked.lateral, recovery=asked.cycles > 0,
        cycles=max(asked.cycles, 1), **step,
    )  # fmt: skip


def _jumps(asked, relaxed, states, given):
    """After which states the fabric jumps to another shape, which sets energy free; none if it does not.

    Then work goes astray in the same amount however small the steps are (without friction it is what
    the solver says was lost); an error of the steps falls.  What goes astray elsewhere is a small part.
    """
    curve, _, _ = guarded(solved, asked, relaxed, finer=4)
    finer = None if curve is None else states_of(asked, curve.start, curve)
    if finer is None or len(finer.work) != len(states.work):
        return ()
    coarse, fine = [
        np.diff(s.work - s.energy.sum(1) - s.sprung - given.rubs * s.dissipated)
        for s in (states, finer)
    ]
    jumps = np.flatnonzero((coarse > JUMPS * np.abs(coarse).sum()) & (fine > LOST_ALIKE * coarse))
    return jumps if coarse[jumps].sum() > LOST_ALIKE * coarse.sum() else ()


def _refined(case, relaxed, asked, curve):
    """(difference of the loads from those at twice the resolution, limit) where worst, or None.

    Both over max(|load|, 1 % of the largest).  None where the finer solution is not reached.  Where
    the solver does not say how exact it is, the difference stands without a limit.
    """
    fine = relaxed.model.resolution.refined(relaxed.model.fabric)
    finer, _, _ = guarded(
        lambda: solved(
            asked, relaxed_of(replace(case, points=fine.points, contacts=fine.contacts)), finer=2
        )
    )
    if finer is None:
        return None
    load, exact = _load(asked, curve), _load(asked, finer)
    # On the way out states are the same; on the way back the last one is at zero force.
    n = min(len(load), len(exact), len(asked.path))
    if n == 0:
        return None
    off = np.abs(exact[:n] - load[:n]) / scale_of(load)[:n]
    said = curve.numerical_error[:n]
    limit = np.where(np.isfinite(said), np.maximum(REFINED, said), np.inf)
    if not np.isfinite(limit).any():
        return float(off.max()), np.inf
    worst = int(np.argmax(off - limit))
    return float(off[worst]), float(limit[worst])

"""Random and worst-case fabrics through the equilibrium model, each result judged by code of its own.

Outcomes: "verified", all that was asked was reached and the judge found nothing; "stopped", the test
ended before with its reason; "refused", InputError or ComputationError with its reason; "wrong", the
judge found something, the solver failed in another way, took an input that no fabric has, or its
force is further from that at twice the resolution than it says.  Stopped tests are judged too.
"""

import csv
import dataclasses
import time
from collections import Counter

import numpy as np

from knitsim.equilibrium.accuracy import scale_of
from knitsim.equilibrium.bending import FRICTION_INCREMENT as BENDING_FRICTION_INCREMENT
from knitsim.equilibrium.bending import INCREMENT as BENDING_INCREMENT
from knitsim.equilibrium.bending import bend
from knitsim.equilibrium.fabric import BarrierContact, Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.tension import FRICTION_INCREMENT, tensile
from knitsim.errors import ComputationError, InputError
from knitsim.evaluation import stress
from knitsim.evaluation.bending_judge import UNBALANCED, Test, TestStates, judge_test
from knitsim.evaluation.campaign import AT_REST, PEIRCE
from knitsim.evaluation.judge import FINE_FORCE
from knitsim.evaluation.judge_energy import Given
from knitsim.yarn.law import TensionLaw

VERIFIED, STOPPED, REFUSED, WRONG = OUTCOMES = ("verified", "stopped", "refused", "wrong")
LEAST_SOLVED = 0.98  # of the possible cases

_OF_CASE = [f.name for f in dataclasses.fields(stress.StressCase) if f.name != "fabric"]
_OF_FABRIC = [
    "wale_spacing", "course_spacing", "loop_length", "diameter", "bending_rigidity", "law_strain",
    "law_tension", "contact_stiffness", "friction", "course_strain", "wale_strain",
]  # fmt: skip
_FOUND = (
    "outcome", "reason", "states", "reached", "load", "residual", "min_distance", "estimated_error",
    "refined_difference", "snaps",
)  # fmt: skip
COLUMNS = [*_OF_CASE, *_OF_FABRIC, "possible", "impossible_because", *_FOUND]
TIMES = ("number", "relaxing", "testing", "refining", "judging")
SUMMARY = ("quantity", "family", "value", "limit")
# Of the rule for possible cases, for the map: B/(K d^3), room for the loop in diameters, l/d, curvature
# times diameter; and the families of cases.
LIMITS = {
    "narrow": stress.NARROW, "room": PEIRCE * AT_REST, "bulk": stress.LEAST_BULK,
    "curvature": stress.TIGHTEST / stress.THICK, "families": tuple(stress.FAMILIES),
}  # fmt: skip


def run(numbers, seed=stress.SEED):
    """Rows of results (mappings by COLUMNS) and of CPU times (by TIMES, s) of the cases ``numbers``."""
    rows, times = [], []
    for number in numbers:
        case = stress.draw(number, seed)
        clock = Clock(TIMES[1:])
        rows.append(_row(case, clock))
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


def guarded(call):
    """(result or None, outcome, reason) of a call to the solver."""
    try:
        return call(), VERIFIED, ""
    except (InputError, ComputationError) as error:
        return None, REFUSED, f"{type(error).__name__}: {error}"
    except Exception as error:  # whatever else happens is the solver's fault, and counts so
        return None, WRONG, f"{type(error).__name__}: {error}"


def relaxed_of(fabric, resolution):
    """The relaxed :class:`campaign.Case` ``fabric``."""
    law = TensionLaw(fabric.law_strain, fabric.law_tension, fabric.law_strain[-1])
    return relax(
        Fabric(
            fabric.wale_spacing, fabric.course_spacing, fabric.loop_length, fabric.diameter,
            fabric.bending_rigidity, law, BarrierContact(fabric.contact_stiffness), fabric.friction,
        ),
        resolution,
    )  # fmt: skip


def given_of(fabric, relaxed):
    """What the judge is told of a :class:`campaign.Case` and of how finely it was solved."""
    cell = relaxed.model.cell
    return Given(
        fabric.loop_length, fabric.diameter, fabric.bending_rigidity, fabric.law_strain,
        fabric.law_tension, fabric.contact_stiffness, fabric.friction, cell.points, cell.contacts,
    )  # fmt: skip


def tension_states(relaxed, curve):
    """TestStates of a tensile Curve, from the relaxed fabric on."""
    values = {
        "centreline": (relaxed.centreline, curve.centreline),
        "wale_spacing": (relaxed.wale_spacing, curve.wale_spacing),
        "course_spacing": (relaxed.course_spacing, curve.course_spacing),
        "coordinate": (0.0, curve.strain),
        "load": (0.0, curve.force_per_loop),
        "energy": (relaxed.energy, curve.energy),
        "work": (0.0, curve.work),
        "dissipated": (0.0, curve.dissipated),
        "min_distance": (relaxed.min_distance, curve.min_distance),
        "numerical_error": (np.nan, curve.numerical_error),
    }
    return TestStates(
        **{name: np.concatenate([np.asarray(a)[None], b]) for name, (a, b) in values.items()}
    )


def bending_states(curve):
    """TestStates of a BendingCurve."""
    return TestStates(
        curve.centreline, curve.wale_spacing, curve.course_spacing, curve.curvature,
        curve.moment_per_width, curve.energy, curve.work, curve.dissipated, curve.min_distance,
        curve.numerical_error,
    )  # fmt: skip


def states_of(case, relaxed, curve):
    """TestStates of the Curve or BendingCurve of a case."""
    return bending_states(curve) if case.kind == "bending" else tension_states(relaxed, curve)


def _row(case, clock):
    reasons = stress.impossible(case)
    row = {name: getattr(case, name) for name in _OF_CASE}
    for name in _OF_FABRIC:
        value = getattr(case.fabric, name)
        row[name] = " ".join(f"{v:.9g}" for v in value) if isinstance(value, tuple) else value
    row |= {"possible": "no" if reasons else "yes", "impossible_because": "; ".join(reasons)}
    return row | dict.fromkeys(_FOUND, "") | _found(case, clock)


def _found(case, clock):
    """Results, by some of _FOUND."""
    relaxed, outcome, reason = guarded(
        lambda: clock.time(
            "relaxing", relaxed_of, case.fabric, Resolution(case.points, case.contacts)
        )
    )
    if relaxed is None:
        return {"outcome": outcome, "reason": reason}
    if case.family == "no input":
        return {"outcome": WRONG, "reason": "an input that no fabric has was taken"}
    curve, outcome, reason = guarded(
        lambda: clock.time("testing", tested, case, relaxed, error=case.refined)
    )
    if curve is None:
        return {"outcome": outcome, "reason": reason}
    found = {"states": len(curve.residual), "reason": curve.stop_reason}
    found["outcome"] = STOPPED if curve.stop_reason else VERIFIED
    if not found["states"]:
        return found
    bends = case.kind == "bending"
    load = curve.moment_per_width if bends else curve.force_per_loop
    found |= {
        "reached": float((curve.curvature if bends else curve.strain)[-1]),
        "load": float(load[-1]),
        "residual": float(curve.residual.max()),
        "min_distance": float(np.min(curve.min_distance)),
    }
    states = states_of(case, relaxed, curve)
    wrong = clock.time(
        "judging", judge_test, given_of(case.fabric, relaxed), states, test_of(case, curve)
    )
    if wrong and all(f.check == UNBALANCED for f in wrong) and _snaps(case, relaxed, states):
        found["snaps"], wrong = "yes", []
    wrong = [str(finding) for finding in wrong]
    if case.refined:
        found["estimated_error"] = float(np.max(curve.numerical_error))
        off = clock.time("refining", _refined, case, relaxed, curve, load)
        if off is not None:
            found["refined_difference"], limit = off
            if not found["refined_difference"] <= limit:
                wrong.append(
                    f"off by {found['refined_difference']:.3g} at twice the resolution,"
                    f" said {limit:.3g}"
                )
    if wrong:
        found |= {"outcome": WRONG, "reason": "; ".join(wrong)}
    return found


def _snaps(case, relaxed, states):
    """Whether the fabric jumps from one shape to another on the way, which sets energy free.

    Then work goes astray in the same amount however small the steps are; an error of the steps falls.
    """
    finer, _, _ = guarded(lambda: states_of(case, relaxed, tested(case, relaxed, finer=4)))
    if finer is None or len(finer.work) != len(states.work):
        return False
    lost = [np.diff(s.work - s.energy.sum(axis=1) - s.dissipated) for s in (states, finer)]
    jump = int(np.argmax(lost[0]))
    return bool(0.8 * lost[0][jump] < lost[1][jump] and lost[0][jump] > 0.8 * lost[0].sum() > 0.0)


def tested(case, relaxed, error=False, finer=1):
    """Curve or BendingCurve of the test asked; error: with its estimate; finer: divides the steps."""
    spacings = "held" if case.held else "free"
    if case.kind == "bending":
        rubs = case.fabric.friction > 0.0
        step = (BENDING_FRICTION_INCREMENT if rubs else BENDING_INCREMENT) / finer
        return bend(
            relaxed, case.direction, case.path, spacings=spacings, increment=step,
            estimate_error=error,
        )  # fmt: skip
    increment = FRICTION_INCREMENT if case.increment is None else case.increment
    return tensile(
        relaxed, case.direction, case.coordinates, lateral=spacings, recovery=case.recovers,
        increment=increment / finer, estimate_error=error,
    )  # fmt: skip


def test_of(case, curve):
    """What the judge is told of the test."""
    asked, ended = None, not curve.stop_reason
    if ended:
        asked = tuple(case.path) if case.kind == "bending" else (0.0, *case.coordinates)
    return Test(
        case.kind, case.direction, not case.held, asked,
        ended and case.recovers and case.kind == "tension", case.increment is None,
    )  # fmt: skip


def _refined(case, relaxed, curve, load):
    """(difference of the loads from those at twice the resolution, limit) where worst, or None.

    Both over max(|load|, 1 % of the largest).  None where the finer solution is not reached.  Where
    the solver does not say how exact it is, the difference stands without a limit.
    """
    fine = relaxed.model.resolution.refined(relaxed.model.fabric)
    finer, _, _ = guarded(lambda: tested(case, relaxed_of(case.fabric, fine), finer=2))
    if finer is None:
        return None
    exact = finer.moment_per_width if case.kind == "bending" else finer.force_per_loop
    # On the way out states are the same; on the way back the last one is at zero force.
    n = min(len(load), len(exact), len(case.coordinates) + (case.kind == "bending"))
    if n == 0:
        return None
    size = scale_of(load)[:n]
    off = np.abs(exact[:n] - load[:n]) / size
    said = curve.numerical_error[:n]
    limit = np.where(np.isfinite(said), np.maximum(FINE_FORCE, said), np.inf)
    if not np.isfinite(limit).any():
        return float(off.max()), np.inf
    worst = int(np.argmax(off - limit))
    return float(off[worst]), float(limit[worst])


def gathered(paths):
    """Rows (mappings, values as text) of the CSV files of all parts, by the number of the case."""
    rows = []
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            rows += csv.DictReader(file)
    return sorted(rows, key=lambda row: int(row["number"]))


def summary(rows):
    """Rows (by SUMMARY) of what the campaign came to, all cases and each family; rows: by COLUMNS."""
    table = []
    for family in ("all", *stress.FAMILIES):
        cases = [row for row in rows if family in ("all", row["family"])]
        possible = [row for row in cases if row["possible"] == "yes"]
        of_all, of_possible = (
            Counter(row["outcome"] for row in some) for some in (cases, possible)
        )
        solved = f"{100.0 * of_possible[VERIFIED] / max(len(possible), 1):.4g}"
        limit = f"{100.0 * LEAST_SOLVED:g} or more" if family == "all" else ""
        table += [
            ("cases", family, len(cases), ""),
            ("possible cases", family, len(possible), ""),
            ("possible cases solved and verified, per cent", family, solved, limit),
            ("possible cases that stopped before with a reason", family, of_possible[STOPPED], ""),
            ("possible cases that were refused with a reason", family, of_possible[REFUSED], ""),
            ("wrong results in all cases", family, of_all[WRONG], "0" if family == "all" else ""),
            (
                "cases called impossible that were solved and verified", family,
                of_all[VERIFIED] - of_possible[VERIFIED], "",
            ),
            (
                "of the cases solved, fabrics that snap from one shape to another", family,
                sum(row["snaps"] == "yes" for row in cases), "",
            ),
            (
                "cases solved again at twice the resolution", family,
                sum(row["refined_difference"] != "" for row in cases), "",
            ),
        ]  # fmt: skip
    return table

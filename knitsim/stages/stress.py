"""Random and worst-case fabrics through the equilibrium model, each result judged by code of its own.

Outcomes are those of :mod:`knitsim.stages.judged`; a result is "wrong" also where the solver took an
input that no fabric has, or where its force is further from that at twice the resolution than it says.
"""

import dataclasses
from collections import Counter

import numpy as np

from knitsim.equilibrium.accuracy import scale_of
from knitsim.equilibrium.bend import FRICTION_INCREMENT as BENDING_FRICTION_INCREMENT
from knitsim.equilibrium.bend import INCREMENT as BENDING_INCREMENT
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import FRICTION_INCREMENT, tensile
from knitsim.stages.judged import (
    REFUSED,
    STOPPED,
    VERIFIED,
    WRONG,
    bending_states,
    given_of,
    guarded,
    inputs_of,
    relaxed_of,
    rows_of,
    tension_states,
)
from knitsim.verification import stress
from knitsim.verification.bending_judge import SNAPPING, Test, judge_test
from knitsim.verification.campaign import AT_REST, PEIRCE
from knitsim.verification.judge import FINE_FORCE

CASES = stress.CASES
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
    return rows_of(numbers, lambda number: stress.draw(number, seed), _row, TIMES)


def states_of(case, relaxed, curve):
    """TestStates of the Curve or BendingCurve of a case."""
    return bending_states(curve) if case.kind == "bending" else tension_states(relaxed, curve)


def _row(case, clock):
    row = {name: getattr(case, name) for name in _OF_CASE}
    row |= inputs_of(case.fabric, _OF_FABRIC, (), stress.impossible(case))
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
    if wrong and all(f.check in SNAPPING for f in wrong) and _snaps(case, relaxed, states):
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

    Then work goes astray in the same amount however small the steps are (without friction it is what
    the solver says was lost); an error of the steps falls.
    """
    finer, _, _ = guarded(lambda: states_of(case, relaxed, tested(case, relaxed, finer=4)))
    if finer is None or len(finer.work) != len(states.work):
        return False
    rubbed = 1.0 if case.fabric.friction > 0.0 else 0.0
    lost = [np.diff(s.work - s.energy.sum(axis=1) - rubbed * s.dissipated) for s in (states, finer)]
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

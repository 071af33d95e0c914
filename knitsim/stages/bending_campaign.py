"""Random fabrics bent both ways in both directions, each result judged by code of its own.

Outcomes are those of :mod:`knitsim.stages.judged`; all curvatures must be reached.
"""

import dataclasses
from collections import Counter

import numpy as np

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Resolution
from knitsim.stages.judged import (
    OUTCOMES,
    REFUSED,
    STOPPED,
    VERIFIED,
    WRONG,
    bending_states,
    exactness,
    given_of,
    guarded,
    inputs_of,
    relaxed_of,
    rows_of,
)
from knitsim.verification import stress_bending
from knitsim.verification.bending_judge import Test, judge_test
from knitsim.verification.campaign import POINTS, Case

CASES = stress_bending.CASES
LEAST_SOLVED = 0.97  # of the possible cases

_INPUTS = [f.name for f in dataclasses.fields(Case) if not f.name.endswith("e_strain")]
_FOUND = (
    "outcome", "reason", "states", "moment_flat", "moment_convex", "moment_hollow", "min_distance",
    "numerical_error", "change_error",
)  # fmt: skip
COLUMNS = [
    *_INPUTS, "possible", "impossible_because", "outcome", "rest_reason",
    *(f"{direction}_{name}" for direction in ("course", "wale") for name in _FOUND),
]  # fmt: skip
TIMES = ("number", "relaxing", "bending", "judging")
SUMMARY = ("quantity", "value", "limit")


def run(numbers, seed=stress_bending.SEED):
    """Rows of results (mappings by COLUMNS) and of CPU times (by TIMES, s) of the cases ``numbers``."""
    return rows_of(numbers, lambda number: stress_bending.draw(number, seed), _row, TIMES)


def _row(case, clock):
    row = inputs_of(case, _INPUTS, COLUMNS, stress_bending.impossible(case))
    relaxed, row["outcome"], row["rest_reason"] = guarded(
        lambda: clock.time("relaxing", relaxed_of, case, Resolution(POINTS))
    )
    if relaxed is None:
        return row
    outcomes = []
    for direction in ("course", "wale"):
        found = _bent(case, relaxed, direction, clock)
        row |= {f"{direction}_{name}": value for name, value in found.items()}
        outcomes.append(found["outcome"])
    row["outcome"] = max(outcomes, key=OUTCOMES.index)
    return row


def _bent(case, relaxed, direction, clock):
    """Results (by some of _FOUND) of bending in one direction."""
    asked = stress_bending.path()
    curve, outcome, reason = guarded(
        lambda: clock.time("bending", bend, relaxed, direction, asked, estimate_error=True)
    )
    if curve is None:
        return {"outcome": outcome, "reason": reason}
    states = bending_states(curve)
    found = {
        "outcome": STOPPED if curve.stop_reason else VERIFIED,
        "reason": curve.stop_reason,
        "states": curve.steps,
    }
    if not curve.steps:
        return found
    moment = curve.moment_per_width
    found |= {
        "moment_flat": float(moment[0]),
        "moment_convex": float(moment[np.argmax(curve.curvature)]),
        "moment_hollow": float(moment[np.argmin(curve.curvature)]),
        "min_distance": float(np.min(curve.min_distance)),
        "numerical_error": float(np.max(curve.numerical_error)),
        "change_error": float(np.max(curve.change_error)),
    }
    test = Test("bending", direction, asked=None if curve.stop_reason else tuple(asked))
    wrong = clock.time("judging", judge_test, given_of(case, relaxed), states, test)
    if wrong:
        found |= {"outcome": WRONG, "reason": "; ".join(map(str, wrong))}
    return found


def summary(rows):
    """Rows (by SUMMARY) of what the campaign came to; rows: mappings by COLUMNS."""
    possible = [row for row in rows if row["possible"] == "yes"]
    of_all, of_possible = (Counter(row["outcome"] for row in some) for some in (rows, possible))
    solved = f"{100.0 * of_possible[VERIFIED] / max(len(possible), 1):.4g}"
    table = [
        ("cases", len(rows), ""),
        ("possible cases", len(possible), ""),
        (
            "possible cases bent both ways in both directions and verified, per cent", solved,
            f"{100.0 * LEAST_SOLVED:g} or more",
        ),
        ("possible cases that stopped before with a reason", of_possible[STOPPED], ""),
        ("possible cases that were refused with a reason", of_possible[REFUSED], ""),
        ("wrong results in all cases", of_all[WRONG], "0"),
        (
            "cases called impossible that were solved and verified",
            of_all[VERIFIED] - of_possible[VERIFIED], "",
        ),
    ]  # fmt: skip
    for direction in ("course", "wale"):
        title = f"possible cases solved, {direction} direction"
        table += exactness(possible, direction, VERIFIED, title, "moment")
    return table

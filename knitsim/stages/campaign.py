"""Random fabrics through the equilibrium model, each result judged by code of its own.

Outcomes are those of :mod:`knitsim.stages.judged`, where "reached" stands for "verified".  The judge
takes the force to be as exact as the solver's own error estimate says.
"""

import dataclasses
import math

import numpy as np

from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.stages.judged import (
    REFUSED,
    STOPPED,
    WRONG,
    exactness,
    given_of,
    guarded,
    inputs_of,
    relaxed_of,
    rows_of,
)
from knitsim.verification.campaign import CASES as CASES
from knitsim.verification.campaign import POINTS, SEED, Case, draw, impossible
from knitsim.verification.judge import States, judge

# Strains of stored states: close together where friction sets in, then this far apart at most.
FIRST, STORED = (0.0025, 0.005), 0.01
REACHED = "reached"
LEAST_REACHED = 0.97  # of the possible cases

_INPUTS = [f.name for f in dataclasses.fields(Case)]
_RESULTS = ("outcome", "reached_strain", "yarn_strain", "min_distance", "numerical_error", "reason")
COLUMNS = [
    *_INPUTS, "possible", "impossible_because", "outcome", "rest_outcome", "rest_reason",
    *(f"{direction}_{name}" for direction in ("course", "wale") for name in _RESULTS),
]  # fmt: skip
TIMES = ("number", "relaxing", "course", "wale", "errors", "judging")
SUMMARY = ("quantity", "value", "limit")


def run(numbers, seed=SEED):
    """Rows of results (mappings by COLUMNS) and of CPU times (by TIMES, s) of the cases ``numbers``."""
    return rows_of(numbers, lambda number: draw(number, seed), _row, TIMES)


def _row(case, clock):
    row = inputs_of(case, _INPUTS, COLUMNS, impossible(case))
    relaxed, row["rest_outcome"], row["rest_reason"] = guarded(
        lambda: clock.time("relaxing", relaxed_of, case, Resolution(POINTS))
    )
    if relaxed is None:
        row["outcome"] = row["rest_outcome"]
        return row
    given = given_of(case, relaxed)
    rest = _rest(relaxed)
    row["rest_outcome"], row["rest_reason"] = _verdict(
        REACHED, "", clock.time("judging", judge, given, rest)
    )
    outcomes = [row["rest_outcome"]]
    for direction in ("course", "wale"):
        found = _test(case, given, relaxed, rest, direction, clock)
        row |= {f"{direction}_{name}": value for name, value in found.items()}
        outcomes.append(found["outcome"])
    row["outcome"] = max(outcomes, key=(REACHED, STOPPED, REFUSED, WRONG).index)
    return row


def _verdict(outcome, reason, findings):
    return (WRONG, "; ".join(map(str, findings))) if findings else (outcome, reason)


def _rest(relaxed):
    zero = np.zeros(1)
    return States(
        relaxed.centreline[None], np.array([relaxed.wale_spacing]),
        np.array([relaxed.course_spacing]), zero, zero, relaxed.energy[None], zero, zero,
        np.array([relaxed.min_distance]), np.full(1, np.nan),
    )  # fmt: skip


def _states(rest, curve, error):
    """The states of a curve after the rest; error: estimated error of its forces."""
    values = {
        "centreline": curve.centreline, "wale_spacing": curve.wale_spacing,
        "course_spacing": curve.course_spacing, "strain": curve.strain,
        "force": curve.force_per_loop, "energy": curve.energy, "work": curve.work,
        "dissipated": curve.dissipated, "min_distance": curve.min_distance,
        "numerical_error": error,
    }  # fmt: skip
    return States(**{name: np.concatenate([getattr(rest, name), v]) for name, v in values.items()})


def _test(case, given, relaxed, rest, direction, clock):
    """Results (by _RESULTS) of one test of a relaxed fabric."""
    asked = case.asked(direction)
    steps = math.ceil(asked / STORED)
    strains = np.concatenate([FIRST, asked * np.arange(1, steps + 1) / steps])
    found = dict.fromkeys(_RESULTS, "")
    curve, found["outcome"], found["reason"] = guarded(
        lambda: clock.time(direction, tensile, relaxed, direction, strains)
    )
    if curve is None:
        return found
    known, _, _ = guarded(
        lambda: clock.time("errors", tensile, relaxed, direction, strains, estimate_error=True)
    )
    error = np.full(curve.steps, np.nan) if known is None else known.numerical_error
    outcome, reason = (STOPPED, curve.stop_reason) if curve.stop_reason else (REACHED, "")
    states = _states(rest, curve, error)
    found["outcome"], found["reason"] = _verdict(
        outcome, reason,
        clock.time(
            "judging", judge, given, states, direction, asked if outcome == REACHED else None
        ),
    )  # fmt: skip
    found["reached_strain"] = float(curve.strain[-1])
    found["yarn_strain"] = float(curve.yarn_strain[-1])
    found["min_distance"] = float(curve.min_distance[-1])
    found["numerical_error"] = float(error[-1])
    return found


def summary(rows):
    """Rows (by SUMMARY) of what the campaign came to; rows: mappings by COLUMNS."""
    possible = [row for row in rows if row["possible"] == "yes"]

    def count(which, *outcomes):
        return sum(row["outcome"] in outcomes for row in which)

    reached = count(possible, REACHED)
    table = [
        ("cases", len(rows), ""),
        ("possible cases", len(possible), ""),
        (
            "possible cases that reached both asked strains, per cent",
            f"{100.0 * reached / max(len(possible), 1):.4g}", f"{100.0 * LEAST_REACHED:g} or more",
        ),
        ("possible cases that stopped before with a reason", count(possible, STOPPED), ""),
        ("possible cases that were refused with a reason", count(possible, REFUSED), ""),
        ("wrong results in all cases", count(rows, WRONG), "0"),
        (
            "cases called impossible that reached both asked strains",
            count(rows, REACHED) - reached, "",
        ),
    ]  # fmt: skip
    for direction in ("course", "wale"):
        title = f"possible cases that reached the asked {direction} strain"
        table += exactness(possible, direction, REACHED, title, "force")
    return table

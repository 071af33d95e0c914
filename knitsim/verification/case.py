"""A scene with an exact answer: solved with more and more elements, compared, its order observed.

All quantities are dimensionless.  What keeps an error from falling further is part of the scene, not
of its resolution: exact rods do not stretch, exact contact is hard, the kinks of an exact tension law
are sharp.  ``Comparison.floor`` is an estimate of it, below which no order is observed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from knitsim.errors import ComputationError

ELEMENTS = (10, 20, 40, 80)
CONTACT_ELEMENTS = ELEMENTS[1:]  # ten do not follow a cylinder
LIMIT, CONTACT_LIMIT = 1e-4, 5e-3  # largest error asked for with the most elements

RODS, SHAPES, CONTACTS = "loaded cantilevers", "struts, crimp and stretch", "contact and friction"


@dataclass(frozen=True)
class Comparison:
    """A quantity computed and exact; floor: relative error that more elements leave, about."""

    quantity: str
    value: float
    exact: float
    floor: float

    @property
    def error(self):
        """|value - exact| over |exact|; over 1, the rod's length, where the exact value is 0."""
        scale = abs(self.exact)
        return abs(self.value - self.exact) / (scale if scale > 1e-9 else 1.0)


@dataclass(frozen=True)
class Case:
    """A scene with an exact answer.

    run: function of the number of elements that returns the OpenState and the Comparisons; group:
    one of RODS, SHAPES, CONTACTS; note: what the floor of its errors is from; limit: largest error
    asked for with the most elements.
    """

    name: str
    group: str
    run: Callable
    note: str = "the exact rod does not stretch"
    limit: float = LIMIT
    elements: tuple = ELEMENTS


@dataclass(frozen=True)
class Checked:
    """Comparisons of one quantity over the numbers of elements, all (elements,): value, exact, error,
    residual (N), iterations of the solver.

    floor: see :class:`Comparison`; order: see :func:`observed_order`.
    """

    case: Case
    quantity: str
    value: np.ndarray
    exact: np.ndarray
    error: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    floor: float
    order: float


def observed_order(elements, error, floor):
    """Slope of log(error) against log(1/elements), fitted to the errors above ``floor``.

    elements, error (n,).  NaN where fewer than two errors exceed it.
    """
    above = np.asarray(error) > floor
    if above.sum() < 2:
        return math.nan
    return -float(np.polyfit(np.log(elements)[above], np.log(error)[above], 1)[0])


def check(case):
    """Run a Case with all its numbers of elements; a list of :class:`Checked`.

    Raises ComputationError, naming the case, if the solver does not reach a state.
    """
    solved = []
    for elements in case.elements:
        try:
            solved.append(case.run(elements))
        except ComputationError as error:
            raise ComputationError(f"{case.name}, {elements} elements: {error}") from error
    residual = np.array([state.residual for state, _ in solved])
    iterations = np.array([state.iterations for state, _ in solved])
    found = []
    for rows in zip(*(comparisons for _, comparisons in solved), strict=True):
        error = np.array([row.error for row in rows])
        found.append(
            Checked(
                case,
                rows[0].quantity,
                np.array([row.value for row in rows]),
                np.array([row.exact for row in rows]),
                error,
                residual,
                iterations,
                rows[0].floor,
                observed_order(case.elements, error, rows[0].floor),
            )
        )
    return found

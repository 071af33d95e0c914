"""Tests of a fabric predicted with calibrated inputs, or with all inputs as given.

The band of a prediction has two parts, added as squares: what the uncertainty of the calibrated
inputs makes of it (at the ends of their 95 % interval along each principal axis of their covariance,
cut at their bounds; differences of two solutions as coarse as those of the fit, that end where yarns lock
too closely for these), and the solver's own error; of inputs as given that error alone.  Above and below
the value it is of different width.  It covers neither the inputs that were taken as given nor what the
model leaves out.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from knitsim.equilibrium.accuracy import finer, rest_to, scale_of
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.result import LOADING
from knitsim.errors import ComputationError, InputError
from knitsim.inference.bending_points import bending_points
from knitsim.inference.continuation import States, common_resolution, varied
from knitsim.inference.trials import Pull, strains_for
from knitsim.measured.test import from_pretension

SMALLEST, EVENLY, STATES = 0.01, 1.0, 50  # strains solved, see strains_for
PARTS = (1.0, 0.5, 0.25, 0.125)  # of the way to the end of an interval, while it has no fabric
ON_BOUND = 1e-9  # of the range between the bounds
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True, eq=False)
class Prediction:
    """One predicted quantity along a test, (n,) each; NaN beyond what the model reaches.

    value; low, high: band, NaN where neither side of an input reaches; numerical_error: the solver's part
    of it, in units of value.
    """

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    numerical_error: np.ndarray


@dataclass(frozen=True, eq=False)
class Outcome:
    """A predicted test: quantities {name: :class:`Prediction`} at the places asked for, ``at`` (n,);
    notes: what was not reached, and which sides of the band failed."""

    at: np.ndarray
    quantities: dict
    notes: tuple


class Predictor:
    """Predicts tests of a fabric.

    fabric: all inputs as given; calibration: a :class:`knitsim.inference.calibrate.Calibration`,
    whose fabric then counts, or whose values are put into ``fabric`` where both are given;
    resolution: as for knitsim.equilibrium.relax.relax; None for one that is finer than a fit's.
    """

    def __init__(self, fabric=None, calibration=None, resolution=None):
        if fabric is None and calibration is None:
            raise InputError("predictor", None, "needs a fabric, a calibration, or both")
        start = calibration.problem.fabric if fabric is None else fabric
        self.fabric = fabric if calibration is None else calibration.fabric
        if None not in (fabric, calibration):
            found = zip(calibration.names, map(float, calibration.values), strict=True)
            self.fabric = varied(fabric, dict(found))
        self.calibration = calibration
        solved = Resolution() if calibration is None else calibration.resolution
        coarse = common_resolution([self.fabric], solved if resolution is None else resolution)
        # Solved once, not at every step of a search: fine enough for a narrow band.
        self.resolution = finer(coarse, self.fabric) if resolution is None else coarse
        self.states, self.rest = self._rest_at(self.resolution, start)
        self.base = self.rest
        if calibration is not None and coarse != self.resolution:
            self.states, self.base = self._rest_at(coarse, start)
        self.notes = []
        self.sides = []
        if calibration is not None:
            self._spread()

    def _rest_at(self, resolution, start):
        """The States of a resolution and the fabric at rest in them."""
        states = States(resolution)
        if self.calibration is not None:
            # Where the fit began, so that the calibrated fabric lies on the same branch.
            states.rest(start)
        return states, states.rest(self.fabric).relaxed

    def _spread(self):
        """Fabrics at rest at both ends along each principal axis of the uncertain inputs.

        The bounds count as knowledge: an even distribution between them has the variance range^2/12,
        which keeps an input that the data do not determine within them.
        """
        found = self.calibration
        low, high = found.problem.bounds.T
        unit = high - low
        scaled = found.spread.information * np.outer(unit, unit)
        if not np.isfinite(scaled).all():
            return
        size, axes = np.linalg.eigh(scaled + 12.0 * np.eye(len(unit)))
        for variance, axis in zip(1.0 / size, axes.T, strict=True):
            end = found.spread.factor * np.sqrt(variance) * axis * unit
            self.sides.append([self._side(found.values, way * end, low, high) for way in (1, -1)])

    def _side(self, values, step, low, high):
        """(Fabric at rest, part of the step) at the end of ``step``, cut at the bounds, or part of the
        way where that has no equilibrium; the fabric itself where the bounds leave no room."""
        step = np.clip(values + step, low, high) - values
        if (np.abs(step) <= ON_BOUND * (high - low)).all():
            return self.base, 1.0
        for part in PARTS:
            inputs = dict(zip(self.calibration.names, values + part * step, strict=True))
            try:
                return self.states.rest(varied(self.fabric, inputs)).relaxed, part
            except _FAILURES:
                continue
        return None

    def _banded(self, solve, values, errors):
        """{name: Prediction} of values {name: (n,)}; solve(relaxed): the same of another fabric at rest, for
        the differences that make the band; errors: {name: (n,)}."""
        base = values
        if self.sides:
            try:
                base = solve(self.base)
            except _FAILURES as error:
                self.notes.append(f"the band is that of two resolutions: {error}")
        above = {name: np.zeros(len(v)) for name, v in values.items()}
        below = {name: np.zeros(len(v)) for name, v in values.items()}
        for number, both in enumerate(self.sides):
            moves = []
            for side in both:
                if side is None:
                    continue
                try:
                    moved = base if side[0] is self.base else solve(side[0])
                except _FAILURES as error:
                    self.notes.append(f"a side of the band failed: {error}")
                    continue
                moves.append({n: (moved[n] - v) / side[1] for n, v in base.items()})
            if not moves:
                self.notes.append(f"the band lacks principal axis {number + 1} of the inputs")
                continue
            for name in values:
                # A side that fails, or ends before, counts as the other one mirrored.
                one, other = moves[0][name], moves[-1][name] if moves[1:] else -moves[0][name]
                one = np.where(np.isfinite(one), one, -other)
                other = np.where(np.isfinite(other), other, -one)
                above[name] += np.maximum(np.maximum(one, other), 0.0) ** 2
                below[name] += np.minimum(np.minimum(one, other), 0.0) ** 2
        found = {}
        for name, value in values.items():
            error = np.nan_to_num(errors[name])
            low = value - np.hypot(np.sqrt(below[name]), error)
            high = value + np.hypot(np.sqrt(above[name]), error)
            if name == "strain":
                # On loading a pull lengthens.
                low = np.maximum(low, np.minimum(value, 0.0))
            found[name] = Prediction(value, low, high, errors[name])
        return found

    def _outcome(self, at, quantities):
        notes = list(dict.fromkeys(self.notes))
        self.notes = []
        if any(np.isnan(q.numerical_error).any() for q in quantities.values()):
            notes.append("the solver's own error could not be estimated everywhere")
        if any(
            (np.isfinite(q.value) & np.isnan(q.high - q.low)).any() for q in quantities.values()
        ):
            notes.append("the band is not known everywhere: no side of it reaches so far")
        short = [n for n, q in quantities.items() if not np.isfinite(q.value).all()]
        if short:
            notes.append(f"not reached everywhere: {', '.join(short)}")
        return Outcome(np.asarray(at, dtype=float), quantities, tuple(notes))

    def spacings(self):
        """Relaxed spacings: an :class:`Outcome` with ``wale_spacing`` and ``course_spacing`` (m)."""
        _, share = rest_to(self.rest)
        error = {
            n: np.array([share * getattr(self.rest, n)]) for n in ("wale_spacing", "course_spacing")
        }

        def solve(relaxed):
            return {
                "wale_spacing": np.array([relaxed.wale_spacing]),
                "course_spacing": np.array([relaxed.course_spacing]),
            }

        return self._outcome([0.0], self._banded(solve, solve(self.rest), error))

    def tension(self, direction, forces, *, lateral="free", pretension=0.0):
        """First loading at forces per width (N/m, rising): an :class:`Outcome` with ``strain`` and
        ``transverse_strain``, both from the state under ``pretension`` (N/m)."""
        forces = np.atleast_1d(np.asarray(forces, dtype=float))
        if not (forces > 0).all() or (np.diff(forces) <= 0).any():
            raise InputError("forces", forces.tolist(), "must be above 0 N/m and rise")
        if not forces[0] >= pretension >= 0.0:
            raise InputError("pretension", pretension, "must lie from 0 to the first of the forces")

        def solve(relaxed, estimate_error=False):
            strains = strains_for(SMALLEST, EVENLY, STATES)
            pull = partial(
                tensile, relaxed, direction, strains, to_force=float(forces[-1]), lateral=lateral
            )
            curve = pull(estimate_error=estimate_error, refine=estimate_error)
            if curve.stop_reason and not estimate_error:
                # Pressed closer than the contact points of all sides tell: with more of them.
                curve = pull()
            pulled = Pull(
                curve, relaxed, np.concatenate([[0.0], curve.strain]),
                np.concatenate([[0.0], curve.force_per_width]),
                np.concatenate([[LOADING], curve.phase]),
            )  # fmt: skip
            across = np.concatenate([[0.0], curve.transverse_strain])
            at = pulled.strain_at(np.append(forces, pretension))
            found = {"strain": at, "transverse_strain": _at_strain(pulled.strain, across, at)}
            found = {name: from_pretension(v[:-1], v[-1]) for name, v in found.items()}
            return (found, pulled, across, at) if estimate_error else found

        values, pulled, across, at = solve(self.rest, estimate_error=True)
        if pulled.curve.stop_reason:
            self.notes.append(pulled.curve.stop_reason)
        # An error of the force moves the strain at a given force by dF/(dF/de).
        error = np.append(0.0, pulled.curve.numerical_error) * scale_of(pulled.force_per_width)
        slope = np.gradient(pulled.force_per_width, pulled.strain)
        of_strain = np.divide(error, slope, out=np.zeros_like(error), where=slope > 0)
        by_strain = np.gradient(across, pulled.strain)
        errors = {
            "strain": _at_strain(pulled.strain, of_strain, at),
            "transverse_strain": _at_strain(pulled.strain, np.abs(by_strain) * of_strain, at),
        }
        # Both ends count where strain is not from rest.
        errors = {n: e[:-1] + (e[-1] if pretension else 0.0) for n, e in errors.items()}
        return self._outcome(forces, self._banded(solve, values, errors))

    def bending(self, direction, curvatures):
        """Bending through curvatures (1/m) in the order visited from the flat fabric: an
        :class:`Outcome` with ``moment`` (N, per width) and ``moment_change`` (from the flat one)."""
        curvatures = np.atleast_1d(np.asarray(curvatures, dtype=float))

        def solve(relaxed, **options):
            curve = bend(relaxed, direction, np.concatenate([[0.0], curvatures]), **options)
            moment = np.full(len(curvatures) + 1, np.nan)
            moment[: curve.steps] = curve.moment_per_width
            found = {"moment": moment[1:], "moment_change": moment[1:] - moment[0]}
            return (found, curve) if options else found

        found, curve = solve(self.rest, estimate_error=True)
        if curve.stop_reason:
            self.notes.append(curve.stop_reason)
        own, change = np.full((2, len(curvatures)), np.nan)
        reached = curve.steps - 1
        own[:reached] = (curve.numerical_error * scale_of(curve.moment_per_width))[1:]
        largest = np.nanmax(np.abs(found["moment_change"]))
        change[:reached] = curve.change_error[1:] * largest
        return self._outcome(
            curvatures, self._banded(solve, found, {"moment": own, "moment_change": change})
        )

    def measured_bending(self, test):
        """What a measured test's :class:`knitsim.inference.bending_points.BendingPoints` compare with: an
        :class:`Outcome` with ``moment_change`` (N, per width, mean of both ways) at ``test.at``.

        Raises ComputationError where the model does not get through the test.
        """
        curve, own = test.follow(self.rest, estimate_error=True)
        largest = np.abs(curve.moment_per_width - curve.flat_moment).max()
        error = test.mean(curve.change_error[own] * largest, test.at)

        def solve(relaxed):
            return {"moment_change": bending_points(test, relaxed)}

        return self._outcome(
            test.at, self._banded(solve, solve(self.rest), {"moment_change": error})
        )


def _at_strain(strain, values, at):
    """``values`` between solved strains, linear; NaN where ``at`` is."""
    return np.where(np.isfinite(at), np.interp(np.nan_to_num(at), strain, values), np.nan)

"""Tests of a fabric predicted with calibrated inputs, or with all inputs as given.

The band of a prediction has two parts, added as squares: what the uncertainty of the calibrated
inputs makes of it (their covariance, at 95 %, linear), and the solver's own error.  The band covers
neither the inputs that were taken as given nor what the model leaves out.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium.accuracy import fine_relaxed
from knitsim.equilibrium.bending import bend
from knitsim.equilibrium.curve import LOADING
from knitsim.equilibrium.tension import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.evaluation.calibrate_curves import Pull, strains_for
from knitsim.evaluation.calibrate_states import States, common_resolution, varied

SMALLEST, EVENLY, STATES = 0.01, 1.0, 50  # strains solved, see strains_for
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True, eq=False)
class Prediction:
    """One predicted quantity along a test, (n,) each; NaN beyond what the model reaches.

    value; low, high: band; numerical_error: the solver's part of it, in units of value.
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

    fabric: all inputs as given; calibration: a :class:`knitsim.evaluation.calibrate.Calibration`,
    whose fabric then counts instead; resolution: as for knitsim.equilibrium.relax.relax.
    """

    def __init__(self, fabric=None, calibration=None, resolution=None):
        if (fabric is None) == (calibration is None):
            raise InputError("predictor", None, "needs a fabric or a calibration, not both")
        self.fabric = fabric if calibration is None else calibration.fabric
        if calibration is not None and resolution is None:
            resolution = calibration.resolution
        self.calibration = calibration
        self.resolution = common_resolution([self.fabric], resolution)
        self.states = States(self.resolution)
        if calibration is not None:
            # Where the fit began, so that the calibrated fabric lies on the same branch.
            self.states.rest(calibration.problem.fabric)
        self.rest = self.states.rest(self.fabric).relaxed
        self.notes = []
        self.sides, self.factor = [], 0.0
        if calibration is not None:
            self._spread()

    def _spread(self):
        """Fabrics at rest on both sides along each principal axis of the uncertain inputs.

        The bounds count as knowledge: an even distribution between them has the variance range^2/12,
        which keeps an input that the data do not determine within them.
        """
        found = self.calibration
        low, high = found.problem.bounds.T
        unit = high - low
        self.factor = found.spread.factor
        scaled = found.spread.information * np.outer(unit, unit)
        if not np.isfinite(scaled).all():
            return
        size, axes = np.linalg.eigh(scaled + 12.0 * np.eye(len(unit)))
        for variance, axis in zip(1.0 / size, axes.T, strict=True):
            both = []
            for sign in (1.0, -1.0):
                step = sign * np.sqrt(variance) * axis * unit
                both.append(self._side(found.values, step, low, high))
            self.sides.append(both)

    def _side(self, values, step, low, high):
        """(Fabric at rest, part of the step) as far along ``step`` as bounds and equilibrium allow."""
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (high - values) / step, (low - values) / step)
        part = min(1.0, float(np.where(step == 0.0, np.inf, room).min()))
        for _ in range(4):
            if part < 0.05:
                break
            inputs = dict(zip(self.calibration.names, values + part * step, strict=True))
            try:
                return self.states.rest(varied(self.fabric, inputs)).relaxed, part
            except _FAILURES:
                part *= 0.5
        return None

    def _banded(self, solve, errors):
        """{name: Prediction} of solve(relaxed) -> {name: (n,)}; errors: {name: (n,)}."""
        values = solve(self.rest)
        variance = {name: np.zeros(len(v)) for name, v in values.items()}
        for number, both in enumerate(self.sides):
            slopes = []
            for side in both:
                if side is None:
                    continue
                try:
                    moved = solve(side[0])
                except _FAILURES as error:
                    self.notes.append(f"a side of the band failed: {error}")
                    continue
                slopes.append({n: np.abs(moved[n] - v) / side[1] for n, v in values.items()})
            if not slopes:
                self.notes.append(f"the band lacks principal axis {number + 1} of the inputs")
                continue
            for name in values:
                # A side that ends before leaves the other one.
                larger = np.fmax.reduce([slope[name] for slope in slopes])
                variance[name] += np.where(np.isfinite(larger), larger, 0.0) ** 2
        found = {}
        for name, value in values.items():
            error = errors[name]
            half = np.hypot(self.factor * np.sqrt(variance[name]), np.nan_to_num(error))
            found[name] = Prediction(value, value - half, value + half, error)
        return found

    def _outcome(self, at, quantities):
        notes = list(dict.fromkeys(self.notes))
        self.notes = []
        if any(np.isnan(q.numerical_error).any() for q in quantities.values()):
            notes.append("the solver's own error could not be estimated everywhere")
        short = [n for n, q in quantities.items() if not np.isfinite(q.value).all()]
        if short:
            notes.append(f"not reached everywhere: {', '.join(short)}")
        return Outcome(np.asarray(at, dtype=float), quantities, tuple(notes))

    def spacings(self):
        """Relaxed spacings: an :class:`Outcome` with ``wale_spacing`` and ``course_spacing`` (m)."""
        try:
            fine = fine_relaxed(self.rest)
            error = {
                n: 2.0 * np.abs([getattr(fine, n) - getattr(self.rest, n)])
                for n in ("wale_spacing", "course_spacing")
            }
        except _FAILURES:
            error = dict.fromkeys(("wale_spacing", "course_spacing"), np.array([np.nan]))

        def solve(relaxed):
            return {
                "wale_spacing": np.array([relaxed.wale_spacing]),
                "course_spacing": np.array([relaxed.course_spacing]),
            }

        return self._outcome([0.0], self._banded(solve, error))

    def tension(self, direction, forces, *, lateral="free"):
        """First loading at forces per width (N/m, rising): an :class:`Outcome` with ``strain`` and
        ``transverse_strain``."""
        forces = np.atleast_1d(np.asarray(forces, dtype=float))
        if not (forces > 0).all() or (np.diff(forces) <= 0).any():
            raise InputError("forces", forces.tolist(), "must be above 0 N/m and rise")

        def solve(relaxed, estimate_error=False):
            strains = strains_for(SMALLEST, EVENLY, STATES)
            curve = tensile(
                relaxed, direction, strains, to_force=float(forces[-1]), lateral=lateral,
                estimate_error=estimate_error,
            )  # fmt: skip
            pulled = Pull(
                curve, relaxed, np.concatenate([[0.0], curve.strain]),
                np.concatenate([[0.0], curve.force_per_width]),
                np.concatenate([[LOADING], curve.phase]),
            )  # fmt: skip
            strain = pulled.strain_at(forces)
            across = np.concatenate([[0.0], curve.transverse_strain(relaxed)])
            found = {
                "strain": strain,
                "transverse_strain": _at_strain(pulled.strain, across, strain),
            }
            return (found, pulled, across) if estimate_error else found

        found, pulled, across = solve(self.rest, estimate_error=True)
        if pulled.curve.stop_reason:
            self.notes.append(pulled.curve.stop_reason)
        # An error of the force moves the strain at a given force by dF/(dF/de).
        error = np.concatenate([[0.0], pulled.curve.numerical_error]) * np.maximum(
            pulled.force_per_width, 0.01 * pulled.force_per_width.max()
        )
        slope = np.gradient(pulled.force_per_width, pulled.strain)
        of_strain = np.divide(error, slope, out=np.zeros_like(error), where=slope > 0)
        by_strain = np.gradient(across, pulled.strain)
        errors = {
            "strain": _at_strain(pulled.strain, of_strain, found["strain"]),
            "transverse_strain": _at_strain(
                pulled.strain, np.abs(by_strain) * of_strain, found["strain"]
            ),
        }
        return self._outcome(forces, self._banded(solve, errors))

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
        size = np.abs(curve.moment_per_width)
        own[:reached] = (curve.numerical_error * np.maximum(size, 0.01 * size.max()))[1:]
        largest = np.nanmax(np.abs(found["moment_change"]))
        change[:reached] = curve.change_error[1:] * largest
        return self._outcome(
            curvatures, self._banded(solve, {"moment": own, "moment_change": change})
        )


def _at_strain(strain, values, at):
    """``values`` between solved strains, linear; NaN where ``at`` is."""
    return np.where(np.isfinite(at), np.interp(np.nan_to_num(at), strain, values), np.nan)

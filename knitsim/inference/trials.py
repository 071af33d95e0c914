"""The residuals of a calibration's problem at trial values, and their derivatives."""

from dataclasses import dataclass

import numpy as np

from knitsim.errors import ComputationError, InputError
from knitsim.inference import curve_points as curves_
from knitsim.inference.bending_points import BendingPoints, bending_points
from knitsim.inference.continuation import Sensitivity, States, common_resolution, varied

STEP = 1e-3  # of a value, for differences between solved tests
LEAST_STEP = 1e-3  # of the range between the bounds, for values near zero
LEAST_BAND = 0.1  # of the middle width of a band
FLOOR = 0.05  # of the largest measured value: a relative misfit divides by no less
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True, eq=False)
class Fitted:
    """One curve after the fit, (n,) each: measured and model values (strain, N/m or N), residual."""

    name: str
    measured: np.ndarray
    model: np.ndarray
    residual: np.ndarray

    @property
    def rms(self):
        return float(np.sqrt(np.mean(self.residual**2)))


class Trials:
    """Residuals of a problem at trial values, with what was solved for the last ones kept."""

    def __init__(self, problem):
        self.problem, self.names = problem, problem.names
        fabrics = [problem.fabric]
        try:
            start = dict(zip(self.names, problem.start, strict=True))
            fabrics.append(varied(problem.fabric, start))
        except InputError:
            # Noted as the first trial that failed.
            pass
        self.resolution = common_resolution(fabrics, problem.resolution)
        self.states = States(self.resolution)
        self.bent = [BendingPoints(c) if c.kind == "bending" else None for c in problem.curves]
        self.measured = [
            curves_.measured_points(c, problem.kind) if bent is None else bent.change
            for c, bent in zip(problem.curves, self.bent, strict=True)
        ]
        self.divisor = [
            self._divisor(*one) for one in zip(problem.curves, self.measured, strict=True)
        ]
        self.weight = [
            c.weight if bent is None else np.ones(len(bent.at))
            for c, bent in zip(problem.curves, self.bent, strict=True)
        ]
        self.root = [np.sqrt(weight) for weight in self.weight]
        self.groups = np.repeat(np.arange(len(problem.curves)), list(map(len, self.measured)))
        self.points = len(self.groups)
        self.notes, self.evaluations = [], 0
        self.kept = None
        try:
            # Where all trials come from, so that they lie on the fabric's own branch.
            self.states.rest(problem.fabric)
        except _FAILURES:
            # The trials find their own start then, or say why not.
            pass

    def _divisor(self, curve, measured):
        if self.problem.misfit == "band":
            low, high = curve.band
            half = 0.5 * (high - low)
            # Specimens whose curves cross are no more certain there.
            return np.maximum(half, LEAST_BAND * np.median(half))
        largest = np.abs(measured).max()
        if self.problem.misfit == "absolute":
            return np.full(len(measured), largest)
        return np.maximum(np.abs(measured), FLOOR * largest)

    def misfit(self, residual):
        """Weighted rms of residuals that carry the roots of the weights."""
        total = sum(float(weight.sum()) for weight in self.weight)
        return float(np.sqrt(residual @ residual / total))

    def solve(self, values):
        """(Rest, solved tests, model values by curve); None where it failed, with a note."""
        values = np.asarray(values, dtype=float)
        if self.kept is not None and np.array_equal(self.kept[0], values):
            return self.kept[1]
        self.evaluations += 1
        kind = self.problem.kind
        try:
            fabric = varied(self.problem.fabric, dict(zip(self.names, values, strict=True)))
            rest = self.states.rest(fabric)
            solved, points = [], []
            for curve, bent in zip(self.problem.curves, self.bent, strict=True):
                if bent is not None:
                    solved.append(None)
                    points.append(bending_points(bent, rest.relaxed))
                    continue
                solved.append(curves_.pull_of(curve, rest.relaxed, kind, self.problem.states))
                points.append(curves_.tension_points(curve, solved[-1], kind))
            found = rest, solved, points
        except _FAILURES as error:
            shown = ", ".join(f"{n} = {v:.4g}" for n, v in zip(self.names, values, strict=True))
            self.notes.append(f"{shown}: {error}")
            found = None
        self.kept = values.copy(), found
        return found

    def residual(self, values):
        """Residuals (points,) with the roots of their weights; None where the trial failed."""
        found = self.solve(values)
        if found is None:
            return None
        return self._joined(
            (model - measured) / divisor
            for model, measured, divisor in zip(found[2], self.measured, self.divisor, strict=True)
        )

    def _joined(self, parts):
        return np.concatenate([
            part * (root if part.ndim == 1 else root[:, None])
            for part, root in zip(parts, self.root, strict=True)
        ])  # fmt: skip

    def jacobian(self, values, central=False):
        """Derivatives of the residuals (points, parameters): from the Hessians of the states where
        there is no friction, else from differences of solved tests, two-sided if ``central``."""
        curves, fabric = self.problem.curves, self.problem.fabric
        rest, solved, points = self.solve(values)
        exact = [curves_.has_gradient(c, fabric, self.names) for c in curves]
        parts = [np.zeros((len(m), len(self.names))) for m in self.measured]
        if any(exact):
            by_state = Sensitivity(rest, self.names, self.resolution)
            for k, curve in enumerate(curves):
                if exact[k]:
                    parts[k] = curves_.tension_gradient(
                        curve, solved[k], by_state, self.problem.kind
                    )
        if not all(exact):
            kept = self.kept
            for i in range(len(self.names)):
                for k, by_input in enumerate(self._difference(values, i, points, central)):
                    if not exact[k]:
                        parts[k][:, i] = by_input
            self.kept = kept
        return self._joined(
            part / divisor[:, None] for part, divisor in zip(parts, self.divisor, strict=True)
        )

    def _difference(self, values, i, points, central):
        """Derivatives of the model values of all curves by parameter i; zero where both sides fail."""
        low, high = self.problem.bounds[i]
        step = max(STEP * abs(values[i]), LEAST_STEP * (high - low))
        sides = [(values[i], points)]
        # Into the wider side first, so that one-sided differences stay within the bounds.
        order = (step, -step) if high - values[i] >= values[i] - low else (-step, step)
        for change in order:
            moved = values.copy()
            moved[i] = np.clip(values[i] + change, low, high)
            if moved[i] == values[i]:
                continue
            found = self.solve(moved)
            if found is not None:
                sides.append((moved[i], found[2]))
                if not central:
                    break
        if len(sides) == 1:
            return [np.zeros_like(p) for p in points]
        if len(sides) == 3:
            sides = sides[1:]
        (a, at_a), (b, at_b) = sides
        return [(q - p) / (b - a) for p, q in zip(at_a, at_b, strict=True)]

    def fitted(self, values):
        """The :class:`Fitted` curves."""
        points = self.solve(values)[2]
        return tuple(
            Fitted(curve.name, measured, model, (model - measured) / divisor)
            for curve, measured, model, divisor in zip(
                self.problem.curves, self.measured, points, self.divisor, strict=True
            )
        )

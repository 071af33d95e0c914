"""The points of measured tests from the model, and the residuals of a calibration's problem at trial values.

A measured test is a knitsim.measured.test.MeasuredTest.  A tension test is solved at strains that do not
depend on the fabric's inputs, up to the largest measured force; between its states the strain at a force (or
the force at a strain) is interpolated by monotone cubics.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from knitsim.equilibrium.kernels.accept import RUBBED_TOLERANCE
from knitsim.equilibrium.kernels.records import COURSE_SPACING, WALE_SPACING
from knitsim.equilibrium.pull import LARGEST_STRAIN, PULLED, tensile
from knitsim.equilibrium.result import LOADING, RECOVERY
from knitsim.errors import ComputationError, InputError
from knitsim.inference.bending_points import BendingPoints, bending_points
from knitsim.inference.continuation import Sensitivity, States, common_resolution, varied
from knitsim.measured.test import from_pretension

STATES = 16  # up to the largest measured strain
GROWTH = 1.3  # of the steps before the even ones
FURTHER = 4.0  # the model may strain this many times as far before it counts as failed
STEP = 1e-3  # of a value, for differences between solved tests
LEAST_STEP = 1e-3  # of the range between the bounds, for values near zero
LEAST_BAND = 0.1  # of the middle width of a band
FLOOR = 0.05  # of the largest measured value: a relative misfit divides by no less
_FAILURES = (ComputationError, InputError)


@dataclass(frozen=True, eq=False)
class Pull:
    """A solved tension test from rest: rows of (rest, states); strain, force_per_width (n,)."""

    curve: object
    relaxed: object
    strain: np.ndarray
    force_per_width: np.ndarray
    phase: np.ndarray

    def branch(self, phase):
        """Strain and force per width of one phase, rising; recovery begins at the largest force."""
        if phase == LOADING:
            keep = self.phase == LOADING
        else:
            keep = self.phase == RECOVERY
            keep[np.flatnonzero(self.phase == LOADING)[-1]] = True
        order = np.argsort(self.strain[keep], kind="stable")
        return self.strain[keep][order], self.force_per_width[keep][order]

    def strain_at(self, force, phase=LOADING):
        """Strain at forces per width (N/m); NaN beyond the last state, the first passage where the
        force falls in between."""
        strain, own = self.branch(phase)
        rising = np.concatenate([[True], own[1:] > np.maximum.accumulate(own)[:-1]])
        return _interpolated(own[rising], strain[rising], force)

    def force_at(self, strain, phase=LOADING):
        """Force per width (N/m) at strains; NaN beyond the last state."""
        return _interpolated(*self.branch(phase), strain)


def _interpolated(x, y, at):
    if len(x) < 2:
        return np.full(np.shape(at) + y.shape[1:], np.nan)
    return PchipInterpolator(x, y, extrapolate=False)(_reach(x[-1], at))


def _reach(last, at):
    """``at``, with what differs from the last state no more than a force is found drawn to it."""
    return np.where(np.abs(at - last) <= 2.0 * RUBBED_TOLERANCE * abs(last), last, at)


def strains_for(smallest, largest, states=STATES):
    """Strains at which a test is solved, for measured strains from ``smallest`` to ``largest``.

    Half the smallest first, then growing steps, evenly with ``states`` steps to the largest, beyond it by the
    same part of the length: a step far beyond where the yarns lock has no state, and costs most.
    """
    even = largest / states
    step = min(0.5 * smallest, even)
    strains = [step]
    while strains[-1] < largest - 0.5 * even:
        step = min(GROWTH * step, even)
        strains.append(strains[-1] + step)
    while strains[-1] < min(FURTHER * largest, LARGEST_STRAIN):
        step = even * (1.0 + strains[-1]) / (1.0 + largest)
        strains.append(min(strains[-1] + step, LARGEST_STRAIN))
    return np.array(strains)


def pull(relaxed, direction, strains, *, to_force=None, recovery=False, lateral="free"):
    """The :class:`Pull` of a fabric at rest.  Raises ComputationError where it ends early.

    strains: solved ones; to_force (N/m): where loading ends, before the last strain.
    """
    curve = tensile(
        relaxed, direction, strains, to_force=to_force, recovery=recovery, lateral=lateral
    )
    if curve.stop_reason:
        raise ComputationError(f"{direction} tension: {curve.stop_reason}")
    return Pull(
        curve,
        relaxed,
        np.concatenate([[0.0], curve.strain]),
        np.concatenate([[0.0], curve.force_per_width]),
        np.concatenate([[LOADING], curve.phase]),
    )


def pull_of(test, relaxed, kind, states=STATES):
    """The :class:`Pull` that a measured tension test compares with; kind as in
    :func:`tension_points`."""
    loading = test.loading
    recovery = bool((~loading).any())
    ends = float(test["strain"][loading].min()), float(test["strain"][loading].max())
    strains = strains_for(*ends, states)
    if kind == "strain":
        top = float(test["force_per_width"][loading].max())
        return pull(
            relaxed, test.direction, strains, to_force=top, recovery=recovery, lateral=test.lateral
        )
    largest = ends[1]
    if test.pretension:
        # The strain under the pretension, which the model must tell, comes on top.
        under = pull(
            relaxed, test.direction, strains, to_force=test.pretension, lateral=test.lateral
        )
        largest = (1.0 + largest) * (1.0 + under.strain[-1]) - 1.0
    strains = np.append(strains[strains < largest], largest)
    return pull(relaxed, test.direction, strains, recovery=recovery, lateral=test.lateral)


def measured_points(test, kind):
    """The measured values that a fit of a tension test compares with, (n,): strain or force per width."""
    return test["strain"] if kind == "strain" else test["force_per_width"]


def tension_points(test, pulled, kind):
    """What a solved test gives for the measured points, (n,).

    kind: "strain" at the measured forces or "force" (N/m) at the measured strains.  Raises
    ComputationError where a point is not reached.
    """
    zero = float(pulled.strain_at(test.pretension)) if test.pretension else 0.0
    values = np.empty(len(test))
    for phase in (LOADING, RECOVERY):
        own = test.phase == phase
        if not own.any():
            continue
        if kind == "strain":
            values[own] = from_pretension(
                pulled.strain_at(test["force_per_width"][own], phase), zero
            )
        else:
            strain = (1.0 + test["strain"][own]) * (1.0 + zero) - 1.0
            values[own] = pulled.force_at(strain, phase)
    if not np.isfinite(values).all():
        point = int(np.argmin(np.isfinite(values)))
        raise ComputationError(
            f"{test.direction} tension: the model does not reach the measured point {point + 1}"
        )
    return values


def tension_gradient(test, pulled, sensitivity, kind):
    """Derivatives of :func:`tension_points` by the inputs of a Sensitivity, (n, inputs).

    Without friction, lateral spacing free, loading only.  With F(L, p) the force of a loop at the
    spacing L, f = F/w0 the force per width and e = L/L0 - 1 the strain:
    at a force   dL/dp = (f dw0/dp - dF/dp)/(dF/dL),   de/dp = dL/dp/L0 - (1 + e) dL0/dp/L0;
    at a strain  dL/dp = (1 + e) dL0/dp,   df/dp = (dF/dp + dF/dL dL/dp - f dw0/dp)/w0.
    """
    driven, across = PULLED[test.direction]
    rest = pulled.relaxed
    spacing = {WALE_SPACING: rest.wale_spacing, COURSE_SPACING: rest.course_spacing}
    at = {WALE_SPACING: 0, COURSE_SPACING: 1}
    length, width = spacing[driven], spacing[across]
    by_length = sensitivity.spacings[:, at[driven]]
    by_width = sensitivity.spacings[:, at[across]]
    rows = np.zeros((len(pulled.strain), len(by_length)))
    forces = np.zeros_like(rows)
    for i, y in enumerate(pulled.curve.y, start=1):
        e, f = pulled.strain[i], pulled.force_per_width[i]
        slope, by_inputs = sensitivity.of_force(y, driven, (across,))
        move = (f * by_width - by_inputs) / slope
        rows[i] = move / length - (1.0 + e) * by_length / length
        forces[i] = (by_inputs + slope * (1.0 + e) * by_length - f * by_width) / width
    zero, by_zero = 0.0, 0.0
    if test.pretension:
        zero = float(pulled.strain_at(test.pretension))
        by_zero = _interpolated(pulled.force_per_width, rows, test.pretension)
    if kind == "strain":
        e = pulled.strain_at(test["force_per_width"])[:, None]
        inner = _interpolated(pulled.force_per_width, rows, test["force_per_width"])
        return inner / (1.0 + zero) - (1.0 + e) * by_zero / (1.0 + zero) ** 2
    strain = (1.0 + test["strain"]) * (1.0 + zero) - 1.0
    slope = PchipInterpolator(pulled.strain, pulled.force_per_width).derivative()(strain)
    inner = _interpolated(pulled.strain, forces, strain)
    return inner + slope[:, None] * (1.0 + test["strain"])[:, None] * by_zero


def has_gradient(test, fabric, names):
    """Whether :func:`tension_gradient` knows the derivatives of a test by these inputs."""
    return (
        test.kind == "tension"
        and test.lateral == "free"
        and bool(test.loading.all())
        and fabric.friction == 0.0
        and "friction" not in names
    )


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
            measured_points(c, problem.kind) if bent is None else bent.change
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
                solved.append(pull_of(curve, rest.relaxed, kind, self.problem.states))
                points.append(tension_points(curve, solved[-1], kind))
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
        exact = [has_gradient(c, fabric, self.names) for c in curves]
        parts = [np.zeros((len(m), len(self.names))) for m in self.measured]
        if any(exact):
            by_state = Sensitivity(rest, self.names, self.resolution)
            for k, curve in enumerate(curves):
                if exact[k]:
                    parts[k] = tension_gradient(curve, solved[k], by_state, self.problem.kind)
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

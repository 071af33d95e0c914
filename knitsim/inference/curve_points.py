"""The points of a measured tension test from the model.

A measured test is a knitsim.measured.test.MeasuredTest.  It is solved at strains that do not depend
on the fabric's inputs, up to the largest measured force; between its states the strain at a force (or
the force at a strain) is interpolated by monotone cubics.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from knitsim.equilibrium.kernels.records import COURSE_SPACING, WALE_SPACING
from knitsim.equilibrium.pull import LARGEST_STRAIN, PULLED, tensile
from knitsim.equilibrium.result import LOADING, RECOVERY
from knitsim.equilibrium.walk import RUBBED_TOLERANCE
from knitsim.errors import ComputationError
from knitsim.measured.test import from_pretension

STATES = 16  # up to the largest measured strain
GROWTH = 1.3  # of the steps before the even ones
FURTHER = 4.0  # the model may strain this many times as far before it counts as failed


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

"""Inputs found from measured curves, and tests predicted with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from knitsim.errors import InputError
from knitsim.inference.bending_points import BendingPoints
from knitsim.inference.calibrate import Calibration as Fit
from knitsim.inference.calibrate import Parameter, Problem, fit
from knitsim.inference.forward import QUANTITIES
from knitsim.inference.infer import (
    FABRICS,
    Inferred,
    Solved,
    forces_of,
    learned,
    next_tests,
    table,
)
from knitsim.inference.inputs import inputs_of
from knitsim.inference.posterior import predicted, reading
from knitsim.inference.predict import Outcome, Predictor
from knitsim.inference.predict import Prediction as Predicted
from knitsim.inference.scores import bands
from knitsim.measured.drawn import PLOTTED, axes_for, draw
from knitsim.measured.test import KINDS, MeasuredTest
from knitsim.stages.calibration import inside, pretensions_of, shifted
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.study.check import check_section
from knitsim.study.measured_checks import assumed_of, free_parameter, meaningless
from knitsim.study.measured_keys import CALIBRATIONS, PARAMETERS, key_name
from knitsim.study.resolve import Resolver
from knitsim.study.study import Fabric
from knitsim.units import from_si, label, to_si

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KIND = "calibrate"
NORMAL_95 = 1.96  # standard deviations that hold 95 % to both sides
CURVATURE, CHANGE = "Curvature (1/cm), face convex positive", "Change of moment (gf cm/cm)"


class Calibration:
    """Inputs of a fabric fitted to measured curves; made by :func:`knitsim.calibrate`.

    fabric: as it was given; fit: the fit (:class:`knitsim.inference.calibrate.Calibration`).
    """

    def __init__(self, fabric: Fabric, fitted: Fit) -> None:
        self.fabric, self.fit = fabric, fitted

    def to_dataframe(self) -> pd.DataFrame:
        """One row a parameter: value, low and high (95 %), in the unit of its key."""
        rows = []
        for name, *values in zip(
            self.fit.names, self.fit.values, self.fit.low, self.fit.high, strict=True
        ):
            unit = PARAMETERS[name].unit
            numbers = [from_si(one, unit) if unit else one for one in values]
            about = dict(zip(("value", "low", "high"), map(float, numbers), strict=True))
            rows.append({"parameter": name, **about, "units": label(unit)})
        return pd.DataFrame(rows)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the measured curves as points and the fitted fabric as lines; the matplotlib axes (new ones
        without ``ax``).  Tension only, where tension and bending were fitted.  options: of the lines."""
        from knitsim.figures.style import COLOURS

        axes: Axes = axes_for(ax)
        problem = self.fit.problem
        kind = "tension" if any(one.kind == "tension" for one in problem.curves) else "bending"
        x, y = KINDS[kind]
        for test, found in zip(problem.curves, self.fit.curves, strict=True):
            if test.kind != kind:
                continue
            at = test[x] if kind == "tension" else BendingPoints(test).at
            sides = {x: at, y: found.model}
            if kind == "tension" and problem.kind == "strain":
                sides = {x: found.model, y: test[y]}
            look = {"color": COLOURS[test.direction], "label": f"{test.name}, fitted", **options}
            if kind == "tension":
                draw(test, axes, label=test.name, linestyle="none", color=COLOURS[test.direction])
            else:
                mean = from_si(found.measured, PLOTTED[y])
                axes.plot(from_si(at, PLOTTED[x]), mean, ".", color=look["color"], label=test.name)
            for phase in np.unique(test.phase) if kind == "tension" else (0,):
                own = test.phase == phase if kind == "tension" else slice(None)
                xs, ys = (from_si(sides[one][own], PLOTTED[one]) for one in (x, y))
                axes.plot(xs, ys, **look | ({"linestyle": "--", "label": None} if phase else {}))
        axes.set(
            xlabel="Strain along the pull (%)" if kind == "tension" else CURVATURE,
            ylabel="Force per width (gf/cm)" if kind == "tension" else CHANGE,
        )
        axes.legend(frameon=False)
        return axes

    def __repr__(self) -> str:
        told = [
            f"{row.parameter} {row.value:.3g} ({row.low:.3g} to {row.high:.3g}) {row.units}"
            for row in self.to_dataframe().itertuples()
        ]
        told_of = "".join(f"; {one.partition(': ')[0]}" for one in self.fit.warnings)
        return f"<Calibration: {', '.join(told)}; misfit {100 * self.fit.misfit:.2g} %{told_of}>"


class Learned:
    """What measured curves teach of a fabric of which every input is uncertain; made by
    :func:`knitsim.calibrate` without ``free``.

    fabric: as it was given; found: :class:`knitsim.inference.infer.Inferred`.
    """

    def __init__(self, fabric: Fabric, found: Inferred) -> None:
        self.fabric, self.found = fabric, found

    def to_dataframe(self) -> pd.DataFrame:
        """One row an input: 95 % before and after (SI), the part of its deviation that is left, in words."""
        columns = ["input", "kind", "prior_low", "prior_median", "prior_high", "low", "median", "high",
                   "narrowed", "says"]  # fmt: skip
        return pd.DataFrame(table(self.found), columns=columns)

    def next_tests(self, direction: str) -> pd.DataFrame:
        """Which further measurement narrows the strain predicted along ``direction`` most, best first."""
        others = [(test, quantity) for test in ("course", "wale") for quantity in QUANTITIES]
        rows = next_tests(self.found, direction, others)
        return pd.DataFrame(rows, columns=["measurement", "deviation_after_over_before"])

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw what is known of each input before and after, 95 %, in standard deviations from what was
        stated; the matplotlib axes (new ones without ``ax``).  options: of the lines after."""
        axes: Axes = axes_for(ax)
        z = self.found.posterior.draws(4000)[0]
        low, middle, high = np.quantile(z, (0.025, 0.5, 0.975), axis=0)
        at = np.arange(len(self.found.inputs))
        before: dict[str, Any] = {"color": "0.8", "linewidth": 7.0, "label": "before"}
        axes.hlines(at, -NORMAL_95, NORMAL_95, **before)
        axes.hlines(at, low, high, **{"color": "black", "label": "after", **options})
        axes.plot(middle, at, "o", color=options.get("color", "black"))
        axes.set_yticks(at, [one.name.replace("_", " ") for one in self.found.inputs])
        axes.invert_yaxis()
        axes.set_xlabel("Standard deviations from what was stated")
        axes.legend(frameon=False)
        return axes

    def __repr__(self) -> str:
        told = [
            f"{one.input} {100 * one.narrowed:.0f} %" for one in self.to_dataframe().itertuples()
        ]
        return f"<Learned, deviation left: {', '.join(told)}>"


class Prediction:
    """A test predicted, with a band; made by :func:`knitsim.predict`.

    force_per_width (n,) N/m and strain, low, high (n,), or curvature (n,) 1/m and moment_change, low, high
    (n,) N: no numbers where the model does not come.  notes: what was not reached.
    """

    def __init__(self, direction: str, x: str, y: str, outcome: Any) -> None:
        self.direction, self.notes = direction, tuple(outcome.notes)
        self._x, self._y = x, y
        one = outcome.quantities[y]
        self.values: dict[str, NDArray[np.float64]] = {
            x: np.asarray(outcome.at), y: one.value, "low": one.low, "high": one.high,
            "numerical_error": one.numerical_error,
        }  # fmt: skip

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.values[name]

    def to_dataframe(self) -> pd.DataFrame:
        """One row a state, in SI."""
        return pd.DataFrame(self.values)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the predicted curve and its band; the matplotlib axes (new ones without ``ax``)."""
        from knitsim.figures.style import COLOURS

        axes: Axes = axes_for(ax)
        band: dict[str, Any] = {"color": COLOURS[self.direction], "alpha": 0.25, "linewidth": 0.0}
        line: dict[str, Any] = {"color": COLOURS[self.direction], "label": "predicted", **options}
        low, high = self["low"], self["high"]
        if self._y == "strain":
            force = from_si(self["force_per_width"], "gf_per_cm")
            axes.plot(100 * self["strain"], force, **line)
            axes.fill_betweenx(force, 100 * low, 100 * high, label="95 % band", **band)
            axes.set(
                xlabel=f"Strain along the {self.direction} (%)", ylabel="Force per width (gf/cm)"
            )
        else:
            at = from_si(self["curvature"], "per_cm")
            moment, low, high = (from_si(one, "gf") for one in (self[self._y], low, high))
            axes.plot(at, moment, **line)
            axes.fill_between(at, low, high, label="95 % band", **band)
            axes.set(xlabel=CURVATURE, ylabel=CHANGE)
        axes.legend(frameon=False)
        return axes

    def __repr__(self) -> str:
        at = int(np.nanargmax(np.where(np.isfinite(self[self._y]), np.abs(self[self._x]), np.nan)))
        if self._y == "strain":
            force = from_si(self["force_per_width"][at], "gf_per_cm")
            ends = " to ".join(f"{100 * self[end][at]:.3g}" for end in ("low", "high"))
            reached = f"{100 * self['strain'][at]:.3g} % ({ends}) at {force:.3g} gf/cm"
        else:
            moment, low, high = (from_si(self[one][at], "gf") for one in (self._y, "low", "high"))
            per_cm = from_si(self["curvature"][at], "per_cm")
            reached = f"{moment:.3g} gf cm/cm ({low:.3g} to {high:.3g}) at {per_cm:.3g} per cm"
        noted = f"; {len(self.notes)} notes" if self.notes else ""
        return f"<Prediction {self.direction}: {reached}{noted}>"


def _solver(fabric: Fabric) -> Any:
    laws = laws_of(fabric.yarn, calibration_of(fabric.yarn))
    return solver_fabric(fabric, laws["continuous"], friction=True)


def calibrate(
    fabric: Fabric, curves: MeasuredTest | Sequence[MeasuredTest],
    free: str | Sequence[str] = ("bending_rigidity",), *,
    bounds: Mapping[str, Sequence[float]] | None = None, residual: str = "strain", misfit: str = "relative",
    profile: bool = True, fabrics: int = FABRICS,
) -> Calibration | Learned:  # fmt: skip
    """Find inputs of the fabric from measured curves, by least squares between bounds.

    curves: what :func:`knitsim.read_measured` read, one or several, each with a direction.  free: name of
    the parameter, or names; each starts from the fabric's value.  bounds:
    ``{"bending_rigidity_N_mm2": [0.001, 0.01]}``, else the plausible range or half to twice the value.
    residual: "strain" at given force or "force"; misfit: "relative", "absolute" or "band".  profile: also
    follow the misfit along each parameter.  Keys of ``calibrations``.

    Without a name in ``free`` every input is as uncertain as the fabric says, and the curves (of tension)
    narrow them: :class:`Learned`, for which ``fabrics`` are solved, minutes.

    Raises InputError, or :class:`knitsim.errors.ComputationError` where no fabric within the bounds reaches
    the measured points.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> ks.calibrate(fabric, [], free=["friction", "elasticity"])
    Traceback (most recent call last):
    knitsim.errors.InputError: calibrate.curves = []: must be one or more measured tests
    """
    curves = [curves] if isinstance(curves, MeasuredTest) else list(curves)
    free = [free] if isinstance(free, str) else list(free)
    if not curves or not all(isinstance(one, MeasuredTest) for one in curves):
        raise InputError(
            "calibrate.curves", repr(curves)[:60], "must be one or more measured tests"
        )
    if not free:
        return _learned(fabric, curves, fabrics)
    stated: dict[str, Any] = {
        "fit": [one.name for one in curves],
        "free": free,
        "residual": residual,
    }
    stated |= {"misfit": misfit} | (
        {"bounds": {k: list(v) for k, v in bounds.items()}} if bounds else {}
    )
    tree = check_section(CALIBRATIONS, {KIND: stated}, "fabric", sweeps=False)
    entry = Resolver(CALIBRATIONS, tree[KIND], KIND, fabric.name).values
    parameters = []
    for name in entry["free"]:
        if why := meaningless(fabric.yarn, name):
            raise InputError(f"{KIND}.free", name, f"{why} ({fabric.yarn.name})")
        one = free_parameter(fabric, name, entry["bounds"] or {}, f"{KIND}.bounds")
        parameters.append(Parameter(one.name, one.low, one.high, inside(one)))
    for name in entry["bounds"] or {}:
        if name not in entry["free"] and entry["bounds"][name] is not None:
            raise InputError(
                f"{KIND}.bounds.{key_name(name)}", None, "is of a parameter that is not free"
            )
    problem = Problem(
        _solver(fabric), tuple(parameters), tuple(curves), kind=entry["residual"], misfit=entry["misfit"],
        resolution=settings_of(fabric).resolution,
    )  # fmt: skip
    return Calibration(fabric, fit(problem, profile=profile))


def _learned(fabric: Fabric, curves: Sequence[MeasuredTest], fabrics: int) -> Learned:
    if any(one.kind != "tension" for one in curves):
        raise InputError(
            f"{KIND}.curves", "bending", "must be of tension, where no parameter is free"
        )
    built = _solver(fabric)
    zero = pretensions_of({str(k): one for k, one in enumerate(curves)})
    counted = [shifted(one.to_fit(), zero.get(one.direction, 0.0)) for one in curves]
    forces = forces_of(counted)
    found = inputs_of(built, assumed=assumed_of(fabric))
    solved = Solved(
        built, found, forces, count=fabrics, pretension=zero, stated=fabric.stated_spacings
    )
    use = ("strain", "rest")
    solved.refine(counted, use)
    return Learned(fabric, learned(solved, counted, use))


def predict(
    source: Calibration | Learned | Fabric, direction: str, *, to_N_per_mm: float | None = None,
    to_per_cm: float | None = None, states: int = 24,
) -> Prediction:  # fmt: skip
    """Predict a tension test to ``to_N_per_mm``, or first bending to ``to_per_cm``, with a band.

    source: a :class:`knitsim.library.inference.Calibration`, whose 95 % interval and numerical error make
    the band; or :class:`Learned`, where it holds 95 % of what all inputs and what the model leaves out
    allow, of tension up to the largest measured force; or a fabric, all inputs as given, where it is the
    numerical error alone.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> ks.predict(fabric, "course", to_N_per_mm=0.02, states=4)
    <Prediction course: 10.3 % (10.3 to 10.3) at 20.4 gf/cm>
    """
    if (to_N_per_mm is None) == (to_per_cm is None):
        raise InputError(
            "predict", None, "needs to_N_per_mm (tension) or to_per_cm (bending), one of them"
        )
    if direction not in ("course", "wale"):
        raise InputError("predict.direction", repr(direction), "must be course or wale")
    if isinstance(states, bool) or not isinstance(states, int) or states < 2:
        raise InputError("predict.states", states, "must be a whole number, 2 or more")
    largest = to_N_per_mm if to_per_cm is None else abs(to_per_cm)
    if not (isinstance(largest, (int, float)) and 0.0 < largest < float("inf")):
        raise InputError("predict", largest, "must be finite and above 0")
    if isinstance(source, Learned):
        if to_N_per_mm is None:
            raise InputError(
                "predict.to_per_cm", to_per_cm, "needs a calibration with free parameters"
            )
        return _banded(source, direction, states, to_si(to_N_per_mm, "N_per_mm"))
    if isinstance(source, Calibration):
        predictor = Predictor(calibration=source.fit)
    elif isinstance(source, Fabric):
        predictor = Predictor(_solver(source), resolution=settings_of(source).stated)
    else:
        raise InputError(
            "predict", repr(source)[:60], "needs a Fabric or what calibrate found of one"
        )
    parts = np.arange(1, states + 1) / states
    if to_per_cm is None:
        forces = parts * to_si(to_N_per_mm, "N_per_mm")
        return Prediction(
            direction, "force_per_width", "strain", predictor.tension(direction, forces)
        )
    curvatures = parts * to_si(to_per_cm, "per_cm")
    return Prediction(
        direction, "curvature", "moment_change", predictor.bending(direction, curvatures)
    )


def _banded(source: Learned, direction: str, states: int, top: float) -> Prediction:
    found = source.found
    at = top * np.arange(1, states + 1) / states
    own = found.forces[direction]
    at = at[at >= own[0] * (1.0 - 1e-9)]
    samples = predicted(found.posterior, direction, "strain", at)
    both, middle = bands(samples)
    model = found.posterior.model
    read = reading(model.places, direction, "strain", at)
    # Told by its logarithm.
    error = middle * np.sqrt(np.diag(read @ model.covariance @ read.T))
    low, high = both[95]
    one = Predicted(middle, low, high, error)
    return Prediction(direction, "force_per_width", "strain", Outcome(at, {"strain": one}, ()))

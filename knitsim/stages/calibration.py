"""A calibration on measured curves of a fabric, and what its parameters predict of every other test."""

from dataclasses import replace

import numpy as np
import xarray as xr

from knitsim.equilibrium.bend import TIGHTEST
from knitsim.errors import ComputationError, InputError
from knitsim.inference.bending_points import BendingPoints
from knitsim.inference.calibrate import Parameter, Problem, fit
from knitsim.inference.continuation import value_of
from knitsim.inference.predict import Predictor
from knitsim.inference.trials import FLOOR, pull_of, tension_points
from knitsim.measured.read import measured_test
from knitsim.measured.test import zero_at
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json
from knitsim.study.measured_checks import config_of, free_of
from knitsim.study.measured_keys import GIVEN, PARAMETERS, STAGE
from knitsim.study.schema import FABRIC
from knitsim.units import to_si

DIRECTIONS = ("course", "wale")
SPACINGS = ("wale", "course")
INSIDE = 0.05  # of the range between the bounds, that a fit starts away from them
ROOM = 0.8  # part of the tightest curvature up to which bending is predicted

BANDS = {True: "numerical error only", False: "95 %, fit and numerical error"}  # by GIVEN or not
KNIT_FORCE = to_si(50.0, "gf_per_cm")


def asked_of(fabric, measured):
    """(forces (n,) N/m, curvatures of one side (m,) 1/m) at which tests are predicted.

    measured: {name: MeasuredTest}; their pretensions are among the forces.
    """
    wanted = fabric["prediction"] or {}
    top = wanted.get("to_force")
    if top is None:
        largest = [m.y.max() for m in measured.values() if m.kind == "tension"]
        top = max([KNIT_FORCE, *largest])
    states = wanted.get("states", _default("states"))
    curvature = wanted.get("max_curvature", to_si(_default("max_curvature_per_cm"), "per_cm"))
    zero = list(pretensions_of(measured).values())
    forces = np.union1d(top * np.arange(1, states + 1) / states, zero)
    half = max(2, states // 4)
    return forces, curvature * np.arange(1, half + 1) / half if curvature else np.zeros(0)


def pretensions_of(measured):
    """{direction: pretension (N/m)} from which its strain is predicted: the largest of its curves."""
    found = {}
    for one in measured.values():
        if one.kind == "tension" and one.pretension > found.get(one.direction, 0.0):
            found[one.direction] = one.pretension
    return found


def _default(key):
    return FABRIC.section("prediction").key(key).default


def problem_of(fabric, name, built, measured):
    """The Problem of the calibration ``name``; built: its equilibrium Fabric; measured: {name:
    MeasuredTest} of all measured curves."""
    entry = fabric["calibrations"][name]
    return Problem(
        built,
        [Parameter(p.name, p.low, p.high, inside(p)) for p in free_of(fabric, name)],
        [measured[curve] for curve in entry["fit"]],
        kind=entry["residual"], misfit=entry["misfit"], resolution=settings_of(fabric).resolution,
    )  # fmt: skip


def inside(free):
    """The start, off the bounds: a search that starts on one hardly leaves it."""
    room = INSIDE * (free.high - free.low)
    return min(max(free.start, free.low + room), free.high - room)


def _at_bounds(found):
    """Fitted values; those within round-off of a bound are the bound."""
    values = found.values.copy()
    for end in found.problem.bounds.T:
        near = np.abs(values - end) <= 1e-9 * np.ptp(found.problem.bounds, axis=1)
        values[near] = end[near]
    return values


def _fit_dataset(found):
    """Variables of a Calibration of the evaluation; with None, of a prediction without one."""
    names = () if found is None else found.names
    n = len(names)
    data = {
        "fitted_value": ("parameter", _at_bounds(found) if n else np.zeros(0)),
        "fitted_interval": (
            ("parameter", "bound"),
            np.stack([found.low, found.high], axis=1) if n else np.zeros((0, 2)),
        ),
        "start_value": ("parameter", [value_of(found.problem.fabric, name) for name in names]),
        "parameter_bound": (("parameter", "bound"), found.problem.bounds if n else np.zeros((0, 2))),
        "correlation": (
            ("parameter", "other_parameter"), found.spread.correlation if n else np.zeros((0, 0)),
        ),
        "fit_misfit": found.misfit if n else np.nan,
        "fit_evaluations": found.evaluations if n else 0,
        "fit_failed": len(found.notes) if n else 0,
    }  # fmt: skip
    points = max((len(p.values) for p in found.profiles), default=0) if n else 0
    profiles = np.full((2, n, points), np.nan)
    for i, profile in enumerate(found.profiles if n else ()):
        profiles[:, i, : len(profile.values)] = profile.values, profile.misfit
    for row, quantity in zip(profiles, ("value", "misfit"), strict=True):
        data[f"profile_{quantity}"] = (("parameter", "profile_point"), row)
    units = np.array([PARAMETERS[name].si for name in names], dtype=object)
    coords = {
        "parameter": np.array(names, dtype=object),
        "other_parameter": np.array(names, dtype=object),
        "parameter_units": ("parameter", units),
        "bound": ["low", "high"],
        "profile_point": np.arange(points),
    }
    return xr.Dataset(data, coords)


def curve_dataset(measured, models, fitted, pretensions):
    """The measured curves beside the model's values at their points.

    measured: {name: MeasuredTest}, of tension as fits see it; models: {name: (value, low, high), (n,)
    each, or None}; the band of bending tests only.  pretensions: {direction: force per width (N/m)} from
    which predicted strain counts.
    """
    names = list(measured)
    bent = {name: BendingPoints(one) for name, one in measured.items() if one.kind == "bending"}
    sizes = {name: len(bent[name].at) if name in bent else len(measured[name]) for name in names}
    shape = (len(names), max(sizes.values(), default=0))
    of_strain = ("strain", "strain_low", "strain_high", "transverse_strain")
    fields = (
        *(f"measured_{field}" for field in of_strain), *(f"shifted_{field}" for field in of_strain),
        "measured_force_per_width", "model_strain", "measured_curvature", "measured_moment_per_width",
        "model_moment_per_width", "model_moment_per_width_low", "model_moment_per_width_high",
    )  # fmt: skip
    data = {field: np.full(shape, np.nan) for field in fields}
    phase = np.zeros(shape, dtype=np.int8)
    numbers = {
        field: np.full(len(names), np.nan)
        for field in ("misfit_rms", "misfit_mean", "misfit_largest", "share_in_band", "pretension")
    }
    for k, name in enumerate(names):
        one, own, model = measured[name], slice(None, sizes[name]), models[name]
        if name in bent:
            data["measured_curvature"][k, own] = bent[name].at
            data["measured_moment_per_width"][k, own] = given = bent[name].change
            field, weight = "model_moment_per_width", None
        else:
            given, weight = one["strain"], one.weight
            phase[k, own], numbers["pretension"][k] = one.phase, one.pretension
            data["measured_force_per_width"][k, own] = one["force_per_width"]
            counted = shifted(one, pretensions.get(one.direction, 0.0))
            for part, test in (("measured", one), ("shifted", counted)):
                data[f"{part}_strain"][k, own] = test["strain"]
                if "lateral_strain" in test:
                    data[f"{part}_transverse_strain"][k, own] = test["lateral_strain"]
                for end, band in zip(("low", "high"), test.band or (), strict=False):
                    data[f"{part}_strain_{end}"][k, own] = band
            field = "model_strain"
        if model is None:
            continue
        model, *band = model
        data[field][k, own] = model
        for end, values in zip(("low", "high"), band, strict=False):
            data[f"{field}_{end}"][k, own] = values
        # Near zero a relative misfit says nothing.
        divisor = np.where(given < 0, -1.0, 1.0) * np.maximum(
            np.abs(given), FLOOR * np.abs(given).max()
        )
        relative = (model - given) / divisor
        numbers["misfit_rms"][k] = np.sqrt(np.average(relative**2, weights=weight))
        numbers["misfit_mean"][k] = np.average(relative, weights=weight)
        numbers["misfit_largest"][k] = np.abs(relative).max()
        if name not in bent and one.band is not None:
            low, high = one.band
            numbers["share_in_band"][k] = np.average(
                (low <= model) & (model <= high), weights=weight
            )
    variables = {field: (("curve", "sample"), values) for field, values in data.items()}
    variables |= {field: ("curve", values) for field, values in numbers.items()}
    variables["measured_phase"] = (("curve", "sample"), phase)
    roles = ["fitted" if name in fitted else "predicted" for name in names]
    words = {
        "curve": names,
        "curve_test": [m.kind for m in measured.values()],
        "curve_direction": [m.direction for m in measured.values()],
        "curve_role": roles,
    }
    coords = {key: ("curve", np.array(value, dtype=object)) for key, value in words.items()}
    return xr.Dataset(variables, {**coords, "sample": np.arange(shape[1])})


def shifted(test, pretension):
    """A tension test with its strain counted from ``pretension`` (N/m), if that is above its own."""
    if pretension <= test.pretension:
        return test
    own, force = test.loading, test["force_per_width"]
    zero = zero_at(pretension, force[own], test["strain"][own], test.pretension)
    across = test.values.get("lateral_strain")
    if across is not None:
        known = own & np.isfinite(across)
        across = zero_at(pretension, force[known], across[known], test.pretension)
    return test.counted_from(zero, across)


def _prediction_dataset(fabric, predictor, forces, half, pretensions):
    """(dataset, notes) of what a Predictor says at rest, in tension and in bending.

    pretensions: {direction: force per width (N/m) from which strain counts}, from rest without.
    """
    notes = []
    rest = predictor.spacings()
    notes += rest.notes
    spacings = [rest.quantities[f"{name}_spacing"] for name in SPACINGS]
    # Curves start at rest, or at the pretension.
    at, zero = np.concatenate([[0.0], forces]), [pretensions.get(d, 0.0) for d in DIRECTIONS]
    tension = [
        predictor.tension(direction, forces[forces >= start], pretension=start)
        for direction, start in zip(DIRECTIONS, zero, strict=True)
    ]
    notes += [
        f"{d} tension: {n}" for d, t in zip(DIRECTIONS, tension, strict=True) for n in t.notes
    ]

    def stacked(quantity):
        rows = np.full((len(DIRECTIONS), len(at), 3), np.nan)
        for row, outcome, start in zip(rows, tension, zero, strict=True):
            one = outcome.quantities[quantity]
            row[at == start] = 0.0
            row[(at >= start) & (at > 0.0)] = np.stack([one.value, one.low, one.high], axis=-1)
        return rows[..., 0], rows[..., 1:]

    data = {
        "predicted_force_per_width": ("state", at),
        "predicted_pretension": ("direction", zero),
        "predicted_spacing": ("spacing", [float(s.value[0]) for s in spacings]),
        "predicted_spacing_band": (
            ("spacing", "bound"), [[float(s.low[0]), float(s.high[0])] for s in spacings],
        ),
        "stated_spacing": ("spacing", np.array(fabric.stated_spacings, dtype=float)),
    }  # fmt: skip
    for quantity in ("strain", "transverse_strain"):
        value, band = stacked(quantity)
        data[f"predicted_{quantity}"] = (("direction", "state"), value)
        data[f"predicted_{quantity}_band"] = (("direction", "state", "bound"), band)
    limit = tightest(predictor.rest)
    if half.size and half[-1] > limit:
        notes.append(f"bending to {limit:.4g} 1/m only: the fabric is too thick for more")
        half = half * limit / half[-1]
    if half.size:
        # Each side by itself from flat, so that both are first loading.
        sides, failed = {}, {}
        for direction in DIRECTIONS:
            for sign in (-1.0, 1.0):
                try:
                    outcome = predictor.bending(direction, sign * half)
                except (ComputationError, InputError) as error:
                    failed[direction] = str(error)
                    sides[direction, sign] = np.full((half.size, 3), np.nan)
                    continue
                notes += [f"{direction} bending: {note}" for note in outcome.notes]
                one = outcome.quantities["moment_change"]
                sides[direction, sign] = np.stack([one.value, one.low, one.high], axis=-1)
        notes += [f"{direction} bending: {text}" for direction, text in failed.items()]
        flat = np.zeros((1, 3))
        whole = np.stack([
            np.concatenate([sides[d, -1.0][::-1], flat, sides[d, 1.0]]) for d in DIRECTIONS
        ])  # fmt: skip
        dims = ("direction", "bent_state")
        data["predicted_curvature"] = ("bent_state", np.concatenate([-half[::-1], [0.0], half]))
        data["predicted_moment_per_width"] = (dims, whole[..., 0])
        data["predicted_moment_per_width_band"] = ((*dims, "bound"), whole[..., 1:])
    coords = {"direction": list(DIRECTIONS), "spacing": list(SPACINGS), "bound": ["low", "high"],
              "state": np.arange(at.size)}  # fmt: skip
    if half.size:
        coords["bent_state"] = np.arange(2 * half.size + 1)
    return xr.Dataset(data, coords), notes


def tightest(relaxed):
    """Largest curvature (1/m) at which bending is predicted, well below what the thickness allows."""
    half = np.abs(relaxed.centreline[:, 2]).max() + 0.5 * relaxed.model.fabric.diameter
    return ROOM * TIGHTEST / half


def _model_points(test, predictor):
    """(values, notes): the model's values, and for bending their band, at a measured test's points; None
    where they are not reached."""
    try:
        if test.kind == "bending":
            found = predictor.measured_bending(BendingPoints(test))
            one = found.quantities["moment_change"]
            return (one.value, one.low, one.high), [f"{test.name}: {n}" for n in found.notes]
        pulled = pull_of(test, predictor.rest, "strain")
        return (tension_points(test, pulled, "strain"),), []
    except (ComputationError, InputError) as error:
        return None, [f"{test.name}: {error}"]


def _to_fit(measured):
    return {key: m.to_fit() if m.kind == "tension" else m for key, m in measured.items()}


def _fitted(source, laws, name, measured, profile, timings):
    """The Calibration ``name`` of a FabricInput; measured: its curves where profile is true."""
    if not profile:
        measured = _to_fit({key: measured_test(source, key) for key in source["measured"]})
    problem = problem_of(
        source, name, solver_fabric(source, laws["continuous"], friction=True), measured
    )
    with timings.measure(f"{name}: fit of {', '.join(problem.names)}, with profiles"):
        return fit(problem, profile=profile)


def run(fabric, laws, name, fits=None):
    """(dataset, timings) of the calibration ``name`` of a FabricInput, or of GIVEN.

    laws: TensionLaw of its yarn by form; fits: Calibrations by (fabric, name) that are known, to which a new
    one is added.  Raises ComputationError where no fabric within the bounds
    reaches the measured points.
    """
    source = fabric.calibrated_on or fabric
    if name != GIVEN and not source["calibrations"][name]["free"]:
        from knitsim.stages.inference import run as run_inference

        return run_inference(fabric, laws, name)
    timings = Timings(STAGE, fabric.name)
    measured = {key: measured_test(fabric, key) for key in fabric["measured"]}
    records = {key: test.record() for key, test in measured.items()}
    asked = asked_of(fabric, measured)
    measured = _to_fit(measured)
    built = solver_fabric(fabric, laws["continuous"], friction=True)
    found, notes, warnings = None, [], []
    if name == GIVEN:
        predictor = Predictor(built, resolution=settings_of(fabric).stated)
    else:
        fits = {} if fits is None else fits
        if (source.name, name) not in fits:
            fits[source.name, name] = _fitted(
                source, laws, name, measured, source is fabric, timings
            )
        found = fits[source.name, name]
        if source is not fabric:
            # They stand in that one's result.
            found = replace(found, profiles=())
        predictor = Predictor(None if source is fabric else built, calibration=found)
        notes, warnings = list(found.notes), list(found.warnings)
    fitted = () if name == GIVEN or source is not fabric else fabric["calibrations"][name]["fit"]
    models = {}
    for key, test in measured.items():
        models[key], more = _model_points(test, predictor)
        notes += more
    with timings.measure(f"{name}: prediction of all tests"):
        predicted, more = _prediction_dataset(fabric, predictor, *asked, pretensions_of(measured))
    curves = curve_dataset(measured, models, fitted, pretensions_of(measured))
    dataset = xr.merge(
        [_fit_dataset(found), curves, predicted], join="exact",
    )  # fmt: skip
    dataset.attrs["band_covers"] = BANDS[name == GIVEN]
    dataset.attrs["warnings"] = to_json(warnings)
    dataset.attrs["notes"] = to_json([*notes, *more])
    dataset.attrs["measured_tests"] = to_json(records)
    references = ("munden", "singal") if fabric.yarn["core_law"] else ("munden",)
    what = f"calibration {name}" + ("" if source is fabric else f" of fabric {source.name}")
    if name == GIVEN:
        what = "without calibration, all parameters as given"
    describe_stage(
        dataset, fabric, STAGE, calibration=name,
        title=f"Fabric {fabric.name}, {what}: measured curves and prediction",
        summary="Parameters of the equilibrium model fitted to measured curves, and every other test "
        "predicted with them; bands cover the fit's uncertainty and the numerical error.",
        references=references, config=config_of(fabric, name),
    )  # fmt: skip
    return dataset, timings

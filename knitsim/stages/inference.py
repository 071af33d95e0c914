"""A calibration in which every input is uncertain: what the curves teach, and bands of every tension test."""

import numpy as np
import xarray as xr

from knitsim.inference import infer
from knitsim.inference.emulator import untold
from knitsim.inference.inputs import inputs_of
from knitsim.inference.posterior import DISCREPANCY, TRUSTED, predicted
from knitsim.inference.scores import bands
from knitsim.inference.synthetic import coverage, scored, truths
from knitsim.measured.read import measured_test
from knitsim.stages.calibration import (
    DIRECTIONS,
    SPACINGS,
    asked_of,
    curve_dataset,
    pretensions_of,
    shifted,
)
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json
from knitsim.study.measured_checks import assumed_of, config_of
from knitsim.study.measured_keys import PARAMETERS, STAGE

SAMPLES = 4000
SCORED = 1.0 / 15.0  # of the largest predicted force: from there points count, 0.02 N/mm of 0.3
QUANTITIES = {"strain": "strain", "lateral_strain": "transverse_strain"}
COVERS = "95 %, all inputs, what the model leaves out, solver and emulator"
NO_BENDING = "bending is neither fitted nor predicted without free parameters"


def inputs_for(fabric, built, name):
    """The uncertain inputs of the calibration ``name`` of a FabricInput; built: its equilibrium Fabric."""
    entry = fabric["calibrations"][name]
    stated = [
        {key: value for key, value in (entry[section] or {}).items() if value is not None}
        for section in ("range", "tolerance")
    ]
    return inputs_of(built, *stated, assumed_of(fabric))


class Start:
    """What the calibration ``name`` of a FabricInput begins with; laws: TensionLaw of its yarn by form.

    at (n,) N/m: forces of the prediction; zero: {direction: pretension (N/m)}; measured, records: of all
    tests; counted: those of tension, strain from there; fitted: some of them; judged: one a direction.
    """

    def __init__(self, fabric, laws, name):
        self.fabric, self.entry = fabric, fabric["calibrations"][name]
        measured = {key: measured_test(fabric, key) for key in fabric["measured"]}
        self.records = {key: test.record() for key, test in measured.items()}
        self.at, _ = asked_of(fabric, measured)
        self.measured = {k: m.to_fit() if m.kind == "tension" else m for k, m in measured.items()}
        self.zero = pretensions_of(self.measured)
        self.built = solver_fabric(fabric, laws["continuous"], friction=True)
        self.inputs = inputs_for(fabric, self.built, name)
        self.counted = {
            key: shifted(m, self.zero.get(m.direction, 0.0))
            for key, m in self.measured.items()
            if m.kind == "tension"
        }
        self.forces = infer.forces_of(self.counted.values(), float(self.at[-1]))
        self.fitted = [self.counted[key] for key in self.entry["fit"] if key in self.counted]
        self.judged = _judged(self.counted, self.entry)

    def solved(self, progress=None):
        """The :class:`knitsim.inference.infer.Solved`, drawn from the distribution of the inputs."""
        stated = self.fabric.scene["equilibrium_rest"]["points"]
        return infer.Solved(
            self.built, self.inputs, self.forces, count=self.entry["fabrics"], pretension=self.zero,
            progress=progress, resolution=settings_of(self.fabric).resolution if stated else None,
            stated=self.fabric.stated_spacings,
        )  # fmt: skip


def synthetic(fabric, laws, name, count, progress=None):
    """Coverage of the course strain of ``count`` fabrics drawn from the distribution of the inputs, each
    given its wale curve, {words: :func:`knitsim.inference.synthetic.coverage`}."""
    solved = Start(fabric, laws, name).solved(progress)
    emulator, known = solved.emulator(), []
    for k, trial in enumerate(truths(solved.again, count)):
        known += [] if trial.row is None else [(k, trial)]
        if progress:
            progress(k + 1, count)
    return {
        words: coverage([scored(emulator, trial, k, left_out) for k, trial in known])
        for words, left_out in (("with a discrepancy", True), ("without one", False))
    }


def run(fabric, laws, name, progress=None):
    """(dataset, timings) of the calibration ``name``, without free parameters, of a FabricInput.

    laws: TensionLaw of its yarn by form; progress: called with (fabrics solved, of how many).
    """
    timings, start = Timings(STAGE, fabric.name), Start(fabric, laws, name)
    entry, measured = start.entry, start.measured
    choices = _choices(start.judged, start.fitted, entry["use"], any(fabric.stated_spacings))
    with timings.measure(f"{name}: {entry['fabrics']} fabrics solved"):
        solved = start.solved(progress)
    with timings.measure(f"{name}: fabrics solved where fits are"):
        for tests, use in choices.values():
            if tests:
                solved.refine(tests, use)
    with timings.measure(f"{name}: inference and prediction"):
        found = infer.learned(solved, start.fitted, entry["use"])
        dataset = _dataset(fabric, found, measured, start.counted, start.at, start.zero, entry)
        dataset = dataset.merge(_scores(start, found, choices))
    failed = solved.failed[: solved.drawn]
    notes = (
        [f"{len(failed)} of {entry['fabrics']} fabrics drawn had no equilibrium"] if failed else []
    )
    if "rest" in entry["use"] and None in fabric.stated_spacings:
        notes.append("of the spacings at rest only what is stated counts; the rest is assumed")
    notes += [NO_BENDING] if any(m.kind == "bending" for m in measured.values()) else []
    dataset.attrs |= {
        "band_covers": COVERS, "warnings": to_json(_warnings(found)), "notes": to_json(notes),
        "measured_tests": to_json(start.records),
        "inputs_from": to_json({i.name: i.why for i in found.inputs}),
        "next_tests": to_json(_next(found)), "combinations": to_json(infer.combinations(found)),
    }  # fmt: skip
    describe_stage(
        dataset, fabric, STAGE, calibration=name,
        title=f"Fabric {fabric.name}, calibration {name}: all inputs uncertain",
        summary="What measured curves teach of every input of the equilibrium model, and the tests "
        "predicted with it; bands cover the inputs, the solver and what the model leaves out.",
        references=("munden", "singal") if fabric.yarn["core_law"] else ("munden",),
        config=config_of(fabric, name),
    )  # fmt: skip
    return dataset, timings


def _warnings(found):
    rows = infer.table(found)
    said = [f"{row[0]}: {row[9]}" for row in rows if "moved" in row[9]]
    if not found.trusted:
        said.append(
            f"the normal approximation of what is known is poor (k = {found.k:.2f}, above {TRUSTED}): take "
            "samples (knitsim.inference.samples)"
        )
    return said


def _next(found):
    other = [(d, q) for d in DIRECTIONS for q in infer.QUANTITIES]
    return {d: infer.next_tests(found, d, other)[:5] for d in DIRECTIONS}


def _dataset(fabric, found, measured, counted, at, zero, entry):
    names = [i.name for i in found.inputs] + [DISCREPANCY.name]
    rows, n = infer.table(found), len(found.inputs) + 1
    number = np.array([row[2:9] for row in rows])
    units = [PARAMETERS[name].si if name in PARAMETERS else "1" for name in names]
    correlation = np.eye(n)
    deviation = np.sqrt(np.diag(found.posterior.covariance))
    correlation[:-1, :-1] = found.posterior.covariance / np.outer(deviation, deviation)
    data = {
        "fitted_value": ("parameter", number[:, 4]),
        "fitted_interval": (("parameter", "bound"), number[:, [3, 5]]),
        "start_value": ("parameter", number[:, 1]),
        "parameter_bound": (("parameter", "bound"), number[:, [0, 2]]),
        "posterior_over_prior": ("parameter", number[:, 6]),
        "correlation": (("parameter", "other_parameter"), correlation),
        "fit_evaluations": found.solved, "fit_failed": len(found.failed), "weight_k": found.k,
        "profile_value": (("parameter", "profile_point"), np.zeros((n, 0))),
        "profile_misfit": (("parameter", "profile_point"), np.zeros((n, 0))),
        "predicted_force_per_width": ("state", np.append(0.0, at)),
        "predicted_pretension": ("direction", [zero.get(d, 0.0) for d in DIRECTIONS]),
        "stated_spacing": ("spacing", np.array(fabric.stated_spacings, dtype=float)),
    }  # fmt: skip
    z = found.posterior.draws(SAMPLES)[0]
    rest = untold(found.emulator.places, found.emulator.rows(z))[:, :2]
    data["predicted_spacing"] = ("spacing", np.median(rest, axis=0))
    data["predicted_spacing_band"] = (
        ("spacing", "bound"),
        np.quantile(rest, (0.025, 0.975), axis=0).T,
    )
    for quantity, called in QUANTITIES.items():
        data |= _predicted(found, quantity, called, at)
    models, misfit = {}, []
    for key in measured:
        models[key] = None
        if key in counted:
            middle = _at_points(found, counted[key])
            models[key] = (middle,)
            keep = np.isfinite(middle)
            if key in entry["fit"]:
                misfit.append((middle / counted[key]["strain"] - 1.0)[keep])
    data["fit_misfit"] = float(np.sqrt(np.mean(np.concatenate(misfit) ** 2))) if misfit else np.nan
    coords = {
        "parameter": np.array(names, dtype=object), "other_parameter": np.array(names, dtype=object),
        "parameter_units": ("parameter", np.array(units, dtype=object)), "bound": ["low", "high"],
        "profile_point": np.arange(0), "direction": list(DIRECTIONS), "spacing": list(SPACINGS),
        "state": np.arange(len(at) + 1),
    }  # fmt: skip
    curves = curve_dataset(counted | {k: m for k, m in measured.items() if k not in counted},
                           models, entry["fit"], zero)  # fmt: skip
    return xr.merge([xr.Dataset(data, coords), curves], join="exact")


def _predicted(found, quantity, called, at):
    """Variables of one quantity: median, bands and the prior's band, at forces (n,) and none."""
    shape = (len(DIRECTIONS), len(at) + 1)
    middle, band, inner, prior = np.full(shape, np.nan), *np.full((3, *shape, 2), np.nan)
    for k, direction in enumerate(DIRECTIONS):
        own = found.forces[direction]
        keep = np.append(False, (at >= own[0] * (1 - 1e-9)) & (at <= own[-1] * (1 + 1e-9)))
        for one in (middle, band, inner, prior):
            one[k, 0] = 0.0
        for posterior, ends in ((found.posterior, (band, inner)), (found.prior, (prior, None))):
            samples = predicted(posterior, direction, quantity, at[keep[1:]], count=SAMPLES)
            levels, median = bands(samples)
            ends[0][k, keep] = np.transpose(levels[95])
            if ends[1] is not None:
                ends[1][k, keep], middle[k, keep] = np.transpose(levels[50]), median
    dims = ("direction", "state")
    return {
        f"predicted_{called}": (dims, middle),
        f"predicted_{called}_band": ((*dims, "bound"), band),
        f"predicted_{called}_band_50": ((*dims, "bound"), inner),
        f"prior_{called}_band": ((*dims, "bound"), prior),
    }


def _at_points(found, test):
    """Median strain at the points of a measured test, NaN off the predicted forces."""
    own, force = found.forces[test.direction], test["force_per_width"]
    keep = test.loading & (force >= own[0]) & (force <= own[-1])
    middle = np.full(len(test), np.nan)
    if keep.any():
        samples = predicted(found.posterior, test.direction, "strain", force[keep], count=SAMPLES)
        middle[keep] = np.median(samples, axis=0)
    return middle


def _judged(counted, entry):
    """One test of each direction, {name: MeasuredTest}: a fitted one, else one with lateral strain."""
    found = {}
    for key, test in sorted(
        counted.items(),
        key=lambda one: (one[0] not in entry["fit"], "lateral_strain" not in one[1]),
    ):
        found.setdefault(test.direction, (key, test))
    return dict(found.values())


def _choices(judged, fitted, use, density):
    """{words: (tests, use)} from which the other tests are predicted: leave one test out; density: whether
    one is stated."""
    across = [t for t in judged.values() if "lateral_strain" in t]
    choices = {"fitted here": (fitted, use)}
    choices |= {
        name: ([test], ("strain", "rest")) for name, test in judged.items() if [test] != fitted
    }
    if across:
        choices["all lateral strains"] = across, ("lateral_strain", "rest")
    return choices | ({"rest alone": ([], ("rest",))} if density else {})


def _scores(start, found, choices):
    """How each choice of fitted tests predicts the others, up to the largest force of the prediction."""
    top = float(start.at[-1])
    rows = infer.left_out(
        start.fabric.stated_spacings,
        found.emulator,
        list(start.judged.values()),
        choices,
        between=(SCORED * top, top),
    )
    measures = ("inside_50", "inside_95", "rms", "crps", "width_95", "points")
    data = {
        f"score_{m}": ("scored", np.array([getattr(r[3], m) for r in rows], dtype=float))
        for m in measures
    }
    words = {
        f"scored_{what}": ("scored", np.array([r[k] for r in rows], dtype=object))
        for k, what in enumerate(("fitted", "test", "quantity"))
    }
    return xr.Dataset(data, {"scored": np.arange(len(rows)), **words})

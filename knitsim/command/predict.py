"""``knitsim predict``: what measured curves of a fabric teach, and what they predict, in words."""

import json
import os
import sys
from pathlib import Path

import numpy as np

from knitsim.errors import InputError
from knitsim.units import from_si, value_text

LINES = 5  # of a predicted curve
DIRECTIONS = ("course", "wale")


def predict_options(parser):
    """Options of ``knitsim predict``."""
    parser.epilog = (
        "A calibration without free parameters takes every input as uncertain as it is. Some two hundred "
        "fabrics are solved for it, minutes; --results reads what knitsim run has left instead."
    )
    parser.add_argument("fabric", metavar="FABRIC")
    parser.add_argument("direction", nargs="?", choices=DIRECTIONS, help="pulled; both without")
    parser.add_argument("--study", default=".", metavar="DIR", help="directory of the study")
    parser.add_argument("--results", metavar="DIR", help="read the calibration's file from there")
    parser.add_argument(
        "--calibration", metavar="NAME", help="one without free parameters, else the first"
    )
    parser.add_argument(
        "--synthetic", type=int, metavar="COUNT",
        help="instead: whether the bands hold, by as many fabrics drawn from what is known of the inputs; "
        "some ten seconds each",
    )  # fmt: skip
    parser.add_argument("--out", metavar="FILE.nc", help="write the result")
    parser.add_argument(
        "--plot", metavar="FILE.png", help="draw every measured test with its bands"
    )


def predict(given):
    """Fit the measured curves with all inputs uncertain, or read that fit, and say what it predicts."""
    from knitsim.stages.inference import run, synthetic
    from knitsim.stages.laws import ledger_laws
    from knitsim.store.writer import write
    from knitsim.study.study import load_study

    files = {key: Path(file).absolute() for key in ("out", "plot") if (file := getattr(given, key))}
    for file in files.values():
        if not file.parent.is_dir():
            raise InputError(file, None, "there is no such directory")
    results = Path(given.results).absolute() if given.results else None
    if not Path(given.study).is_dir():
        raise InputError(given.study, None, "no such directory; --study names that of the study")
    # As knitsim run does: curve files are looked for from there.
    os.chdir(given.study)
    fabric = _fabric(load_study("."), given.fabric)
    name = _calibration(fabric, given.calibration)
    if given.synthetic:
        found = synthetic(fabric, ledger_laws(fabric.yarn), name, given.synthetic, _progress)
        for words, (half, most, width, curves, points) in found.items():
            print(
                f"{curves} course curves, {points:.0f} points, {words}: {100 * half:.3g} and "
                f"{100 * most:.3g} % in the 50 and 95 % bands predicted from wale curves; median width "
                f"{100 * width:.3g} % strain"
            )
        return 0
    if results:
        dataset = _stored(results, given.fabric, name)
    else:
        dataset, _ = run(fabric, ledger_laws(fabric.yarn), name, _progress)
    print("\n".join(said(dataset, [given.direction] if given.direction else DIRECTIONS)))
    if "out" in files:
        write(dataset, files["out"])
    if "plot" in files:
        from knitsim.figures import style
        from knitsim.figures.inferred import fig34_prediction_bands

        with style.context():
            style.save(fig34_prediction_bands({name: dataset}), files["plot"].with_suffix(""))
    return 0


def _stored(results, fabric, name):
    import xarray as xr

    from knitsim.store.results import path_of

    path = results / path_of("calibration", fabric=fabric, calibration=name)
    if not path.is_file():
        raise InputError(path, None, "is not there; without --results it is computed")
    with xr.open_dataset(path) as stored:
        return stored.load()


def _fabric(study, name):
    if name not in study.fabrics:
        raise InputError("fabric", name, f"must be one of {', '.join(study.fabrics)}")
    return study.fabrics[name]


def _calibration(fabric, asked):
    from knitsim.study.measured_checks import inferred_of

    known = inferred_of(fabric)
    if not known:
        raise InputError(
            fabric.where("calibrations"),
            None,
            "needs one without free: {all_inputs: {fit: [your curve]}}",
        )
    if asked is not None and asked not in known:
        raise InputError("calibration", asked, f"must be one of {', '.join(known)}")
    return asked or known[0]


def _progress(done, count):
    if sys.stderr.isatty():
        print(
            f"\r{done} of {count} fabrics solved",
            end="\n" if done == count else "",
            file=sys.stderr,
        )


def said(dataset, directions=DIRECTIONS):
    """Lines that say what was learned, what is predicted and how that compares."""
    lines = ["input: before -> after (95 %), deviation left"]
    for k, name in enumerate(dataset.parameter.values):
        one = dataset.isel(parameter=k)
        bounds = np.concatenate([one.parameter_bound.values, one.fitted_interval.values])
        (low, unit), (high, _), (least, _), (most, _) = (
            value_text(bound, str(one.parameter_units.values)) for bound in bounds
        )
        lines.append(
            f"  {str(name).replace('_', ' ')}: {low} to {high} -> {least} to {most} {unit}".rstrip()
            + f", {100 * float(one.posterior_over_prior):.0f} %"
        )
    force = dataset.predicted_force_per_width.values
    lines.append(
        f"strains to {from_si(force[-1], 'gf_per_cm'):.3g} gf/cm, the largest force measured or "
        "prediction.to_force_gf_per_cm of the fabric"
    )
    for direction in directions:
        one = dataset.sel(direction=direction)
        known = np.flatnonzero(np.isfinite(one.predicted_strain.values) & (force > 0.0))
        lines.append(f"{direction} pull: strain (%), median and 95 % band")
        for i in known[np.unique(np.linspace(0, len(known) - 1, LINES).astype(int))]:
            low, high = 100.0 * one.predicted_strain_band.values[i]
            lines.append(
                f"  {from_si(force[i], 'gf_per_cm'):.3g} gf/cm ({from_si(force[i], 'N_per_mm'):.3g} N/mm): "
                f"{100 * float(one.predicted_strain[i]):.3g}, "
                f"{low:.3g} to {high:.3g}"
            )
    for direction, tests in json.loads(dataset.attrs["next_tests"]).items():
        if direction in directions:
            told = "; ".join(f"{what}: {100 * left:.0f} %" for what, left in tests[:3])
            lines.append(f"narrows the {direction} strain most, deviation that it leaves: {told}")
    lines.append("fitted -> predicted: rms, points in the 50 and 95 % band, CRPS")
    for k in range(dataset.sizes["scored"]):
        one = dataset.isel(scored=k)
        lines.append(
            f"  {one.scored_fitted.values} -> {one.scored_test.values} {one.scored_quantity.values}: "
            f"{100 * float(one.score_rms):.0f} %, {float(one.score_inside_50):.2f}, "
            f"{float(one.score_inside_95):.2f}, {float(one.score_crps):.4f}"
        )
    return lines

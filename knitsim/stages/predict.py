"""``knitsim predict``: what measured curves of a fabric teach, and what they predict, in words."""

import argparse
import sys
from pathlib import Path

import numpy as np

from knitsim.errors import ComputationError, InputError
from knitsim.stages.inference import run
from knitsim.stages.laws import ledger_laws
from knitsim.store.writer import write
from knitsim.study.measured_checks import inferred_of
from knitsim.study.study import load_study
from knitsim.units import from_si

LINES = 5  # of a predicted curve


def main(arguments=None):
    """``knitsim predict FABRIC``: fit the measured curves of a study's fabric with all inputs uncertain,
    and predict its tests; 0, or 1 for what is refused."""
    parser = argparse.ArgumentParser(
        prog="knitsim predict", description=main.__doc__.partition(":")[2]
    )
    parser.add_argument("fabric")
    parser.add_argument("--study", default="config", help="directory of the study")
    parser.add_argument("--calibration", help="one of its calibrations without free parameters")
    parser.add_argument("--out", metavar="FILE.nc", help="write the result")
    parser.add_argument(
        "--plot", metavar="FILE.png", help="draw every measured test with its bands"
    )
    given = parser.parse_args(arguments)
    try:
        fabric = _fabric(load_study(given.study), given.fabric)
        name = _calibration(fabric, given.calibration)
        dataset, _ = run(fabric, ledger_laws(fabric.yarn), name, _progress)
    except (InputError, ComputationError) as error:
        print(f"knitsim: {error}", file=sys.stderr)
        return 1
    print("\n".join(said(dataset)))
    if given.out:
        write(dataset, given.out)
    if given.plot:
        from knitsim.figures import style
        from knitsim.figures.inferred import fig34_prediction_bands

        with style.context():
            style.save(fig34_prediction_bands({name: dataset}), Path(given.plot).with_suffix(""))
    return 0


def _fabric(study, name):
    if name not in study.fabrics:
        raise InputError("fabric", name, f"must be one of {', '.join(study.fabrics)}")
    return study.fabrics[name]


def _calibration(fabric, asked):
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


def said(dataset):
    """Lines that say what was learned, what is predicted and how that compares."""
    lines = ["input: before -> after (95 %), deviation left"]
    for k, name in enumerate(dataset.parameter.values):
        one = dataset.isel(parameter=k)
        before, after = one.parameter_bound.values, one.fitted_interval.values
        lines.append(
            f"  {name}: {before[0]:.4g} to {before[1]:.4g} -> {after[0]:.4g} to {after[1]:.4g} "
            f"{one.parameter_units.values}, {100 * float(one.posterior_over_prior):.0f} %"
        )
    force = dataset.predicted_force_per_width.values
    for direction in dataset.direction.values:
        one = dataset.sel(direction=direction)
        known = np.flatnonzero(np.isfinite(one.predicted_strain.values) & (force > 0.0))
        lines.append(f"{direction} pull: strain (%), median and 95 % band")
        for i in known[np.unique(np.linspace(0, len(known) - 1, LINES).astype(int))]:
            low, high = 100.0 * one.predicted_strain_band.values[i]
            lines.append(
                f"  {from_si(force[i], 'N_per_mm'):.3g} N/mm: {100 * float(one.predicted_strain[i]):.3g}, "
                f"{low:.3g} to {high:.3g}"
            )
    lines.append("fitted -> predicted: rms, points in the 50 and 95 % band, CRPS")
    for k in range(dataset.sizes["scored"]):
        one = dataset.isel(scored=k)
        lines.append(
            f"  {one.scored_fitted.values} -> {one.scored_test.values} {one.scored_quantity.values}: "
            f"{100 * float(one.score_rms):.0f} %, {float(one.score_inside_50):.2f}, "
            f"{float(one.score_inside_95):.2f}, {float(one.score_crps):.4f}"
        )
    return lines


if __name__ == "__main__":
    sys.exit(main())

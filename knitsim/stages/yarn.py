"""The yarn: its tension law, given or calibrated, its fibres, and the simulated tensile test."""

from dataclasses import replace

import numpy as np
import xarray as xr

from knitsim.errors import InputError
from knitsim.stages.described import describe_stage
from knitsim.stages.laws import (
    FORMS,
    calibration_of,
    law_variables,
    laws_of,
    ledger_laws,
    stated_law,
)
from knitsim.stages.ledger import effect_dataset
from knitsim.store.schema import PHASES
from knitsim.store.tensile import stack_variants
from knitsim.store.timing import Timings
from knitsim.store.writer import to_json
from knitsim.study.schema import closure
from knitsim.yarn.packing import pack, solid_diameter
from knitsim.yarn.section import fibre_path, section_springs, tangent_stiffness, tensile_test
from knitsim.yarn.simulated_yarn import as_corrected, as_printed

STAGE = "yarn"
FIBRE_PATH_SECTIONS = 9


def layout_of(yarn):
    """FibreLayout of a YarnInput."""
    fibre = solid_diameter(yarn["linear_density"], yarn["fibres"], yarn["density"])
    if yarn["fibres"] == 1:
        fibre = min(fibre, yarn["diameter"])  # as it is stated, rounded
    return pack(
        yarn["fibres"], yarn["diameter"], fibre, where=yarn.where("fibres")[: -len(".fibres")]
    )


def signed_twist(yarn):
    """Turns per metre, positive for Z."""
    return yarn["twist"] if yarn["twist_direction"] == "Z" else -yarn["twist"]


def simulated_yarn(yarn, law, layout, reading):
    """SimulatedYarn of a YarnInput, ``corrected`` or ``printed``; None if the law has no such reading."""
    common = {
        "spacing": yarn["section_spacing"],
        "twist": signed_twist(yarn),
        "section_stiffness": yarn["section_stiffness"],
        "where": yarn.where("fibres")[: -len(".fibres")],
    }
    if reading == "printed":
        return as_printed(law, layout, **common)
    return as_corrected(law, layout, yarn["fibre_modulus"], **common)


def _run_test(simulated, test):
    return tensile_test(
        simulated, test["max_strain"], test["steps"], test["velocity"], test["gauge_length"],
        test["viscous_coefficient"], test["recovery"],
    )  # fmt: skip


def _test_dataset(result):
    return xr.Dataset(
        {
            "yarn_tension": ("step", result.tension),
            "friction_force": ("step", result.friction),
            "stretch_energy": ("step", result.stretch_energy),
            "bend_energy": ("step", result.bending_energy),
            "section_energy": ("step", result.section_energy),
            "plastic_dissipated": ("step", result.plastic_energy),
            "friction_dissipated": ("step", result.friction_energy),
            "work_per_length": ("step", result.work),
            "mean_radius_ratio": ("step", result.radius_ratio),
            "status": ("step", result.beyond_break.astype(np.int8)),
            "iterations": ("step", result.iterations),
            "time": ("step", result.time),
        },
        {
            "strain": ("step", result.strain),
            "step": np.arange(result.strain.size),
            "phase": ("step", np.array(PHASES)[(~result.loading).astype(int)]),
        },
    )


NOT_MEASURED = "the curve was computed from stated constants: they are found again, no more"


def _calibration_variables(calibration, stated, rebuilt):
    names = list(calibration.estimates)
    found = list(calibration.estimates.values())
    if rebuilt:  # a fit to its own constants says nothing of how well they are known
        found = [replace(e, low=np.nan, high=np.nan, note=NOT_MEASURED) for e in found]
    known = {}
    if stated is not None and calibration.kind == "bilinear":
        slopes = np.diff(stated.tension) / np.diff(stated.strain)
        known = {"k1": slopes[0], "k2": slopes[1], "yield_strain": stated.strain[1]}
    elif stated is not None:
        slopes = np.diff(stated.tension) / np.diff(stated.strain)
        known = {"k_low": slopes[0], "k_high": slopes[1], "switch_strain": stated.strain[1]}
        known["offset"] = (slopes[1] - slopes[0]) * stated.strain[1]
    data = {
        "curve_origin": np.int8(rebuilt),
        "curve_tension": ("sample", calibration.force),
        "curve_strain": ("sample", calibration.strain),
        "fitted_tension": ("sample", calibration.fitted),
        "fitted_value": ("parameter", [e.value for e in found]),
        "fitted_interval": (("parameter", "bound"), [(e.low, e.high) for e in found]),
        "stated_value": ("parameter", [known.get(name, np.nan) for name in names]),
        "fit_rms": calibration.rms_deviation,
        "fit_largest": calibration.max_deviation,
        "fit_r_squared": calibration.r_squared,
    }
    coords = {
        "sample": np.arange(calibration.strain.size),
        "parameter": names,
        "parameter_units": ("parameter", [e.unit for e in found]),
        "parameter_note": ("parameter", [e.note for e in found]),
        "bound": ["low", "high"],
    }
    return data, coords


def headlines(yarn):
    """{name: (value, units)} of the yarn's results that the ledger follows."""
    layout = layout_of(yarn)
    law = ledger_laws(yarn)["continuous"]
    simulated = simulated_yarn(yarn, law, layout, "corrected")
    found = {"yarn_stiffness": (tangent_stiffness(simulated), "N")}
    test = yarn.scene["tensile_test"]
    if test is not None:
        # Fewer steps than the test itself: these values do not depend on their number.
        result = _run_test(simulated, {**test, "steps": 4})
        top = int(np.argmax(result.strain))
        found["yarn_tension_at_largest_strain"] = (result.tension[top], "N")
        found["residual_strain"] = (result.residual_strain, "1")
    return found


def _law_alone(yarn, laws, why):
    """Dataset of a YarnInput whose fibres cannot be drawn: the law, and in ``stopped`` the reason."""
    dataset = xr.Dataset(law_variables(laws), {"form": list(FORMS)}, {"stopped": why})
    return describe_stage(
        dataset, yarn, STAGE, title=f"Yarn {yarn.name}", summary="Tension law of the yarn.",
        references=("paper",),
    )  # fmt: skip


def run(yarn):
    """(dataset, timings) of a YarnInput."""
    timings = Timings(STAGE, yarn.name)
    with timings.measure("calibration"):
        calibration = calibration_of(yarn)
    laws = laws_of(yarn, calibration)
    try:
        layout = layout_of(yarn)
    except InputError as error:
        # Fabrics need the law, not the fibres.
        return _law_alone(yarn, laws, str(error)), timings
    test = yarn.scene["tensile_test"]
    readings = test["readings"] if test is not None else ()
    results = {}
    for reading in readings:
        simulated = simulated_yarn(yarn, laws["continuous"], layout, reading)
        if simulated is None:
            continue  # only a law of two constants, k1 and k2, has a printed reading
        with timings.measure(f"simulated tensile test, {reading}"):
            results[reading] = _test_dataset(_run_test(simulated, test))
    path = [
        fibre_path(layout, yarn["section_spacing"], signed_twist(yarn), FIBRE_PATH_SECTIONS, form)
        for form in ("corrected", "printed")
    ]
    data = {
        **law_variables(laws),
        "linear_density": yarn["linear_density"],
        "diameter": layout.diameter,
        "fibre_diameter": layout.fibre_diameter,
        "twist": signed_twist(yarn),
        "section_spacing": yarn["section_spacing"],
        "fibre_position": (("fibre", "section_axis"), layout.positions),
        "fibre_path": (("twist_form", "section", "fibre", "yarn_axis"), np.array(path)),
        "section_edge": (("edge", "end"), section_springs(layout.positions)),
    }
    coords = {
        "form": list(FORMS),
        "twist_form": ["corrected", "printed"],
        "fibre": np.arange(layout.fibres),
        "section_axis": ["x", "y"],
        "yarn_axis": ["x", "y", "z"],
        "section": np.arange(FIBRE_PATH_SECTIONS),
    }
    if calibration is not None:
        rebuilt = yarn["tension_curve.rebuilt"]
        more, labels = _calibration_variables(calibration, stated_law(yarn), rebuilt)
        data, coords = data | more, coords | labels
    dataset = xr.Dataset(data, coords)
    if results:
        dataset = xr.merge([dataset, stack_variants(results)])
    with timings.measure("effect of the assumptions"):
        dataset = xr.merge([dataset, effect_dataset(yarn, closure(STAGE), headlines)])
    if calibration is not None:
        dataset.attrs["calibration_statement"] = NOT_MEASURED if rebuilt else calibration.statement
        dataset.attrs["calibration_source"] = calibration.source
        dataset.attrs["measured_tests"] = to_json({"tension_curve": calibration.record})
    describe_stage(
        dataset, yarn, STAGE, title=f"Yarn {yarn.name}",
        summary="Tension law, fibre layout and simulated tensile test of the yarn.",
        references=("paper", "hearle", "vogel"),
    )  # fmt: skip
    return dataset, timings

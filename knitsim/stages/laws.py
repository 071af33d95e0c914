"""The tension law of a yarn: from its constants or its measured curve, to and from a result file."""

import numpy as np

from knitsim.measured.read import read_entry
from knitsim.yarn.calibration import calibrate_test
from knitsim.yarn.law import TensionLaw, bilinear, secant

FORMS = ("continuous", "printed")


def stated_law(yarn, form="continuous"):
    """The whole yarn's TensionLaw from its constants, or None if a curve is given instead.

    yarn: knitsim.configuration YarnInput; form: of a secant law, ``printed`` keeps its jump.
    """
    given = yarn["tension_law"]
    if yarn["modulus"] is not None:
        strain = yarn["breaking_strain"]
        tension = yarn["modulus"] * yarn["linear_density"] * strain
        return TensionLaw([0.0, strain], [0.0, tension], strain, False)
    if given is None:
        return None
    if given["kind"] == "bilinear":
        law = bilinear(given["k1"], given["k2"], given["yield_strain"], yarn["breaking_strain"])
    elif given["kind"] == "secant":
        law = secant(
            given["low"], given["high"], given["offset"], given["switch_strain"],
            yarn["breaking_strain"], continuous=form == "continuous",
        )  # fmt: skip
    else:
        law = TensionLaw(
            given["strain"], given["tension"], yarn["breaking_strain"], given["plastic"]
        )
    return law.scaled(yarn["fibres"] if given["per"] == "filament" else 1)


def calibration_of(yarn):
    """The Calibration from the yarn's measured curve, or None."""
    if yarn["tension_curve"] is None:
        return None
    test = read_entry(
        yarn["tension_curve"],
        yarn.curve_paths,
        "yarn_tension",
        linear_density=yarn["linear_density"],
    )
    return calibrate_test(test, yarn["tension_curve.kind"])


def laws_of(yarn, calibration):
    """TensionLaw of the whole yarn in both FORMS; a calibrated one stands before stated constants.

    The printed form is the stated one: a measured curve has no misprints.
    """
    continuous = calibration.law if calibration else stated_law(yarn)
    printed = stated_law(yarn, "printed") or continuous
    return {"continuous": continuous, "printed": printed}


def ledger_laws(yarn):
    """As laws_of, but from the stated constants wherever there are any.

    The ledger moves constants; a calibrated law would not follow them.
    """
    return laws_of(yarn, None if yarn["tension_law"] is not None else calibration_of(yarn))


def law_variables(laws):
    """Variables of a result file that hold the laws, padded with their last vertex's slope."""
    size = max(law.strain.size for law in laws.values())
    strain, tension = np.full((2, len(laws), size), np.nan)
    for row, law in enumerate(laws.values()):
        strain[row, : law.strain.size] = law.strain
        tension[row, : law.strain.size] = law.tension
    dims = ("form", "vertex")
    return {
        "law_strain": (dims, strain),
        "law_tension": (dims, tension),
        "breaking_strain": ("form", [law.breaking_strain for law in laws.values()]),
        "law_is_plastic": ("form", np.array([law.plastic for law in laws.values()], dtype=np.int8)),
    }


def law_from(dataset, form):
    """The TensionLaw of that form in a yarn's result file."""
    one = dataset.sel(form=form)
    held = np.isfinite(one.law_strain.values)
    return TensionLaw(
        one.law_strain.values[held], one.law_tension.values[held], float(one.breaking_strain),
        bool(one.law_is_plastic),
    )  # fmt: skip

"""Predictions with their bands, and the sensitivity table, against brute force and scaling laws."""

from dataclasses import replace

import numpy as np
import pytest
from measured_tools import tension

from knitsim.equilibrium.contact import CoreContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.errors import InputError
from knitsim.inference.calibrate import Parameter, Problem, fit
from knitsim.inference.continuation import varied
from knitsim.inference.predict import Predictor
from knitsim.inference.sensitivity import sensitivity_table, standard_results
from knitsim.yarn.law import TensionLaw

COARSE = Resolution(40, 160)
ACRYLIC = Fabric(
    2.86e-3, 2.07e-3, 11.28e-3, 1.48e-3, 0.045e-6, TensionLaw([0.0, 0.02], [0.0, 100.0]),
    contact=CoreContact(0.65e-3, 0.0012e9, 2.4),
)  # fmt: skip
FORCES = np.array([30.0, 100.0, 300.0])


def strain_at(fabric, direction, force):
    """Strain at one force from a cold start."""
    relaxed = relax(fabric, COARSE)
    return tensile(relaxed, direction, np.arange(1, 76) * 0.02, to_force=force).strain[-1]


@pytest.fixture(scope="module")
def calibration():
    """The core alone, on three points of a wale curve with an error of some per cent."""
    strain = np.array([strain_at(ACRYLIC, "wale", force) for force in FORCES])
    curve = tension("wale", "wale", FORCES, strain * [1.02, 0.97, 1.01])
    free = [Parameter("core_diameter", 0.5e-3, 0.7e-3, 0.64e-3)]
    return fit(Problem(ACRYLIC, free, [curve], resolution=COARSE), profile=False)


def test_a_prediction_without_calibration_is_the_model_itself():
    outcome = Predictor(ACRYLIC, resolution=COARSE).tension("course", FORCES)
    strain = outcome.quantities["strain"]
    brute = [strain_at(ACRYLIC, "course", force) for force in FORCES]
    np.testing.assert_allclose(strain.value, brute, rtol=5e-3)
    # The band is the solver's own error alone.
    np.testing.assert_allclose(strain.high - strain.value, strain.numerical_error)
    assert (strain.numerical_error > 0).all()
    assert (outcome.quantities["transverse_strain"].value < 0).all()


@pytest.mark.slow
def test_the_band_is_what_the_ends_of_the_interval_make_of_it(calibration):
    outcome = Predictor(calibration=calibration, resolution=COARSE).tension("course", FORCES)
    strain = outcome.quantities["strain"]
    # The bounds count a little as well, hence 5 %.
    low, high = (
        [strain_at(varied(ACRYLIC, {"core_diameter": end[0]}), "course", f) for f in FORCES]
        for end in (calibration.high, calibration.low)
    )
    error = strain.numerical_error
    assert (np.array(high) > strain.value).all() and (strain.value > np.array(low)).all()
    np.testing.assert_allclose(
        strain.high - strain.value, np.hypot(high - strain.value, error), rtol=0.05
    )
    np.testing.assert_allclose(
        strain.value - strain.low, np.hypot(strain.value - low, error), rtol=0.05
    )


@pytest.mark.slow
def test_an_input_on_its_bound_has_a_band_to_one_side():
    strain = np.array([strain_at(ACRYLIC, "wale", force) for force in FORCES])
    curve = tension("wale", "wale", FORCES, strain * [1.02, 0.97, 1.01])
    free = [Parameter("core_diameter", 0.5e-3, 0.64e-3, 0.62e-3)]
    found = fit(Problem(ACRYLIC, free, [curve], resolution=COARSE), profile=False)
    assert found.values[0] == found.high[0] == 0.64e-3
    strain = (
        Predictor(calibration=found, resolution=COARSE)
        .tension("course", FORCES)
        .quantities["strain"]
    )
    # A thinner core strains more; a thicker one is not allowed.
    np.testing.assert_allclose(strain.value - strain.low, strain.numerical_error)
    wide = [
        strain_at(varied(ACRYLIC, {"core_diameter": found.low[0]}), "course", f) for f in FORCES
    ]
    np.testing.assert_allclose(
        strain.high - strain.value, np.hypot(wide - strain.value, strain.numerical_error), rtol=0.05
    )


@pytest.mark.slow
def test_strain_on_loading_is_not_negative_however_little_is_known():
    # Two points that contradict each other leave the rigidity free within its bounds.
    curve = tension("w", "wale", [20.0, 30.0], [0.3, 0.05])
    free = [Parameter("bending_rigidity", 0.04e-6, 2e-6, 0.05e-6)]
    found = fit(Problem(ACRYLIC, free, [curve], resolution=COARSE), profile=False)
    predictor = Predictor(calibration=found, resolution=COARSE)
    strain = predictor.tension("course", [5.0, 50.0]).quantities["strain"]
    assert (strain.low >= 0.0).all() and (strain.low <= strain.value).all()
    # Not beyond what the softest yarn that is allowed would do.
    soft = varied(ACRYLIC, {"bending_rigidity": 0.04e-6})
    most = np.array([strain_at(soft, "course", f) for f in (5.0, 50.0)])
    widest = strain.value + np.hypot(most - strain.value, strain.numerical_error)
    assert (strain.high <= widest * 1.02).all()


def test_strain_is_predicted_from_the_pretension():
    outcome = Predictor(ACRYLIC, resolution=COARSE).tension("wale", [20.0, 100.0], pretension=20.0)
    low, high = (strain_at(ACRYLIC, "wale", force) for force in (20.0, 100.0))
    strain = outcome.quantities["strain"].value
    assert strain[0] == 0.0
    assert strain[1] == pytest.approx((1 + high) / (1 + low) - 1, rel=5e-3)
    assert outcome.quantities["transverse_strain"].value[0] == 0.0
    with pytest.raises(InputError, match="pretension"):
        Predictor(ACRYLIC, resolution=COARSE).tension("wale", [20.0], pretension=30.0)


@pytest.mark.slow
def test_spacings_and_bending_have_bands(calibration):
    predictor = Predictor(calibration=calibration, resolution=COARSE)
    spacings = predictor.spacings().quantities
    relaxed = relax(calibration.fabric, COARSE)
    assert spacings["wale_spacing"].value[0] == pytest.approx(relaxed.wale_spacing)
    assert spacings["course_spacing"].low[0] < relaxed.course_spacing
    assert spacings["course_spacing"].high[0] > relaxed.course_spacing
    bent = predictor.bending("course", [50.0, 100.0]).quantities["moment_change"]
    assert 0 < bent.value[0] < bent.value[1]
    assert (bent.low < bent.value).all()


@pytest.mark.slow
def test_what_is_not_reached_is_said():
    outcome = Predictor(ACRYLIC, resolution=COARSE).tension("course", [100.0, 1e9])
    assert np.isfinite(outcome.quantities["strain"].value[0])
    assert np.isnan(outcome.quantities["strain"].value[1])
    assert any("not reached" in note for note in outcome.notes)


def test_a_predictor_needs_a_source():
    with pytest.raises(InputError, match="needs a fabric, a calibration"):
        Predictor()
    with pytest.raises(InputError, match="rise"):
        Predictor(ACRYLIC, resolution=COARSE).tension("wale", [3.0, 2.0])


@pytest.mark.slow
def test_sensitivities_obey_the_scaling_of_forces():
    """All stiffnesses by a factor is the force by its inverse: the effects of bending rigidity,
    shell stiffness and the yarn's tension law add up to minus that of the force."""
    force, names = 100.0, ("bending_rigidity", "core_stiffness")
    fabric = replace(ACRYLIC, law=TensionLaw([0.0, 0.02], [0.0, 2.0]))
    rows = sensitivity_table(
        fabric, names, standard_results(force, force, curvature=None), resolution=COARSE
    )
    effect = {(row.input, row.result): row for row in rows}
    for direction in ("course", "wale"):
        own = [effect[name, f"{direction}_strain"] for name in names]

        def effect_of(change, direction=direction, value=own[0].value):
            high, low = (strain_at(*change(f, direction)) for f in (1.01, 0.99))
            return (high - low) / 0.02 / value

        by_force = effect_of(lambda f, direction: (fabric, direction, f * force))
        by_law = effect_of(
            lambda f, direction: (replace(fabric, law=fabric.law.scaled(f)), direction, force)
        )
        assert by_force > 0.1
        total = by_law + sum(row.per_cent for row in own)
        assert total == pytest.approx(-by_force, rel=0.01)
        assert all(row.noise < 0.05 for row in own)


@pytest.mark.slow
def test_an_input_of_zero_is_changed_one_way():
    rows = sensitivity_table(
        ACRYLIC, ["friction"], standard_results(50.0, 50.0, curvature=None), resolution=COARSE
    )
    row = next(r for r in rows if r.result == "wale_strain")
    rubbed = strain_at(replace(ACRYLIC, friction=0.01), "wale", 50.0)
    assert row.per_cent == pytest.approx((rubbed / row.value - 1.0) / 0.01, rel=0.1)
    assert row.per_cent < 0


@pytest.mark.slow
def test_results_scale_with_the_forces():
    # All stiffnesses by one factor: moments by it, strains at forces by it the same.
    factor, force = 1.5, 50.0
    own = standard_results(force, force)
    scaled = standard_results(factor * force, factor * force)
    fabric = replace(ACRYLIC, friction=0.2)
    stiff = varied(
        replace(fabric, law=fabric.law.scaled(factor)),
        {"bending_rigidity": factor * 0.045e-6, "core_stiffness": factor * 0.0012e9},
    )
    before, after = own(relax(fabric, COARSE)), scaled(relax(stiff, COARSE))
    assert {"course_B", "wale_2HB", "course_strain", "wale_spacing"} <= set(before)
    for name, value in before.items():
        power = 1 if name.endswith(("_B", "_2HB")) else 0
        assert after[name] == pytest.approx(factor**power * value, rel=2e-3), name
    # Without friction there is no hysteresis to tell of.
    assert "course_2HB" not in own(relax(ACRYLIC, COARSE))

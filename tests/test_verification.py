"""The verification itself: every case within its limit, and a wrong solver does not pass."""

import csv
import math

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from knitsim.errors import ComputationError
from knitsim.figures import style
from knitsim.figures.verification import fig17_verification
from knitsim.stages.verification import ACCURACY_COLUMNS, accuracy_table, run
from knitsim.store.writer import write
from knitsim.verification import cases_contacts as verification_contacts
from knitsim.verification import cases_rods as verification_rods
from knitsim.verification.case import (
    CONTACT_LIMIT,
    CONTACTS,
    ELEMENTS,
    LIMIT,
    Case,
    Comparison,
    check,
    observed_order,
)
from knitsim.verification.cases import cases


@pytest.fixture(scope="module")
def verified():
    """(dataset, rows) of all cases."""
    return run()[:2]


def value_of(dataset, case, quantity):
    return float(dataset.computed_value.sel(comparison=f"{case}: {quantity}", elements=80))


def test_every_case_is_within_its_limit(verified):
    dataset, rows = verified
    last = dataset.relative_error.sel(elements=80)
    assert not dataset.comparison.values[(last > dataset.error_limit).values].tolist()
    assert {row[8] for row in rows} == {"yes"}
    contact = dataset.case_group == CONTACTS
    assert (dataset.error_limit == xr.where(contact, CONTACT_LIMIT, LIMIT)).all()
    assert len(np.unique(dataset.case)) == len(cases())


def test_computed_values_are_the_published_ones(verified):
    """Answers from formulas or tables that no part of knitsim computes here."""
    dataset = verified[0]
    known = {
        # Bisshopp and Drucker's elliptic integrals
        ("cantilever, tip load 1 EI/L2", "deflection/L"): 0.3017207738,
        ("cantilever, tip load 1 EI/L2", "shortening/L"): 0.0564332363,
        ("cantilever, tip load 4 EI/L2", "deflection/L"): 0.6699641813,
        # the master curve of the cantilever test
        ("cantilever, own weight 10 EI/L2", "height/width"): 1.066802320433,
        ("cantilever, own weight 100 EI/L2", "height/width"): 5.888104623327,
        ("rolled up to kappa L = 1", "tip along/L"): math.sin(1.0),
        ("rolled up to kappa L = 1", "tip across/L"): 1.0 - math.cos(1.0),
        ("hinged strut, ends at 0.8 L", "force L2/EI"): 10.9822909670,
        ("hinged strut, ends at 0.5 L", "force L2/EI"): 13.3185281491,
        # each quarter of it is half of a hinged strut
        ("clamped strut, ends at 0.8 L", "force L2/EI"): 4.0 * 10.9822909670,
    }
    for key, exact in known.items():
        assert value_of(dataset, *key) == pytest.approx(exact, rel=1e-4), key
    # Ends at 2 E(k)/K(k) - 1 of the length, deflection k/K(k).
    k = brentq(lambda k: 2.0 * ellipe(k * k) / ellipk(k * k) - 1.5, 0.1, 0.99, xtol=1e-14)
    middle = value_of(dataset, "hinged strut, ends at 0.5 L", "deflection/L")
    assert middle == pytest.approx(k / ellipk(k * k), rel=1e-4)
    ratio = value_of(dataset, "capstan, friction 0.3, turn 1 pi", "T2/T1, exp(mu phi)")
    assert ratio == pytest.approx(math.exp(0.3 * math.pi), rel=5e-3)


def test_orders(verified):
    """Cubic splines: at least 3 in all loaded rods; contact is not smooth, at least 1."""
    dataset = verified[0]
    order = dataset.observed_order
    contact = (dataset.case_group == CONTACTS).values
    known = np.isfinite(order.values)
    assert (order.values[known & ~contact] > 3.0).all()
    assert (order.values[known & contact] > 1.0).all()
    # Every cantilever and strut, and every contact case, shows one.
    with_order = set(dataset.case.values[known].tolist())
    without = set(dataset.case.values.tolist()) - with_order
    assert without == {
        "straight yarn pulled to 1 %",
        "straight yarn pulled to 5 %",
        "yarn hanging under its own weight",
    }


def test_observed_order_of_a_power_law():
    elements = np.array(ELEMENTS)
    error = 7.0 * elements**-3.5
    assert observed_order(elements, error, 0.0) == pytest.approx(3.5, rel=1e-12)
    # What lies below the floor does not count.
    floored = np.maximum(error, 1e-5)
    assert observed_order(elements, floored, 2e-5) == pytest.approx(3.5, rel=1e-12)
    assert observed_order(elements, floored, 0.0) < 3.4
    assert math.isnan(observed_order(elements, error, 0.5 * error[0]))


def test_error_is_relative_and_absolute_about_zero():
    assert Comparison("a", -2.2, -2.0, 0.0).error == pytest.approx(0.1)
    assert Comparison("a", 3e-4, 1e-17, 0.0).error == pytest.approx(3e-4)


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_a_rod_a_thousandth_too_stiff_or_soft_does_not_pass(monkeypatch, factor):
    monkeypatch.setattr(verification_rods, "RIGIDITY", factor * verification_rods.RIGIDITY)
    for case in (
        verification_rods.tip_load_case(1.0),
        verification_rods.own_weight_case(10.0),
        verification_rods.roll_up_case(1.0, "1"),
        verification_rods.strut_case(0.8, "hinged"),
    ):
        assert max(found.error[-1] for found in check(case)) > LIMIT, case.name


def test_the_law_counts(monkeypatch):
    law = verification_rods._KNEE
    wrong = type(law)(law.strain, law.tension * 1.001)
    case = verification_rods.pulled_case(0.05)
    monkeypatch.setattr(verification_rods, "_KNEE", wrong)
    assert [found.error[-1] > LIMIT for found in check(case)] == [True, True]


def test_friction_counts(monkeypatch):
    solve = verification_contacts.solve_open

    def with_less(yarns, *, friction, **options):
        return solve(yarns, friction=0.99 * friction, **options)

    monkeypatch.setattr(verification_contacts, "solve_open", with_less)
    found = check(verification_contacts.capstan_case(0.3, math.pi))
    assert [one.error[-1] > CONTACT_LIMIT for one in found] == [True, True]


def test_failures_name_the_case():
    def fails(elements):
        raise ComputationError("no state")

    with pytest.raises(ComputationError, match="the case, 10 elements: no state"):
        check(Case("the case", CONTACTS, fails))
    # A turn of 1 rad is far beyond that at which the yarn lifts off.
    with pytest.raises(ComputationError, match=r"round a cylinder.*meant to touch along a point"):
        check(verification_contacts.wrapped_case(1.0, 4e-7, "point"))


def test_file_and_table(tmp_path, verified):
    dataset, rows = verified
    for name in ("a.nc", "b.nc"):
        write(dataset, tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    with xr.open_dataset(tmp_path / "a.nc") as again:
        xr.testing.assert_equal(again.load(), dataset)
        assert again.relative_error.attrs["units"] == "1"
    accuracy_table(rows, tmp_path / "accuracy.csv")
    with (tmp_path / "accuracy.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == list(ACCURACY_COLUMNS)
    for row, label in zip(table, dataset.comparison.values, strict=True):
        assert f"{row['case']}: {row['name']}" == label
        stored = dataset.sel(comparison=label, elements=int(row["elements"]))
        assert float(row["value"]) == pytest.approx(
            float(stored.computed_value), rel=1e-6, abs=1e-9
        )
        assert float(row["error"]) == pytest.approx(float(stored.relative_error), rel=1e-2)
        assert float(row["limit"]) == float(stored.error_limit)
        shown = float(row["observed_order"] or "nan")
        assert shown == pytest.approx(
            float(stored.observed_order), abs=5.001e-3, nan_ok=True
        )  # two decimals


def test_two_runs_are_the_same(verified):
    names = {"cantilever, own weight 10 EI/L2", "two yarns crossing"}
    again = run([case for case in cases() if case.name in names])[0]
    first = verified[0].sel(comparison=again.comparison)
    assert again.sizes["comparison"] == 3
    for name in ("computed_value", "residual", "iterations"):
        np.testing.assert_array_equal(again[name], first[name])


def test_figure(tmp_path, verified):
    dataset = verified[0]
    with style.context():
        fig = fig17_verification(dataset)
        groups = list(dict.fromkeys(dataset.case_group.values.tolist()))
        drawn = {}
        for ax in fig.axes:
            assert ax.get_xlabel() == "elements (1)"
            assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
            drawn |= {line.get_gid(): line for line in ax.lines if line.get_gid()}
        assert fig.axes[0].get_ylabel() == "relative error (1)"
        assert len(fig.axes) == len(groups)
        # One line a case, with the errors of the file, and its order in the legend.
        legend = [text.get_text() for ax in fig.axes for text in ax.get_legend().get_texts()]
        assert len(drawn) == len(cases()) == len(legend)
        for label, line in drawn.items():
            one = dataset.sel(comparison=label)
            known = np.isfinite(one.relative_error.values)
            np.testing.assert_array_equal(line.get_xdata(), dataset.elements.values[known])
            np.testing.assert_array_equal(
                line.get_ydata(), np.maximum(one.relative_error.values[known], 1e-8)
            )
            order = float(one.observed_order)
            shown = f"order {order:.1f}" if np.isfinite(order) else "no order"
            assert f"{one.case.item()}: {shown}" in legend
        first = [path.read_bytes() for path in style.save(fig, tmp_path / "one")]
        again = [
            path.read_bytes() for path in style.save(fig17_verification(dataset), tmp_path / "two")
        ]
    assert first == again

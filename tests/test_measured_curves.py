"""Measured curves of a fabric: units, corrections, and what is refused by name."""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.measured.fabric_curve import (
    LOADING,
    RECOVERY,
    read_bending,
    read_tension,
)

STRAIN = np.array([0.01, 0.03, 0.06, 0.10, 0.15])
FORCE = np.array([4.0, 10.0, 30.0, 70.0, 150.0])  # N/m


@pytest.fixture
def write(tmp_path):
    def write(header, *columns, comments=()):
        rows = [f"# {comment}" for comment in comments] + [header]
        rows += [",".join(f"{v:.12g}" for v in row) for row in zip(*columns, strict=True)]
        path = tmp_path / "curve.csv"
        path.write_text("\n".join(rows) + "\n")
        return path

    return write


@pytest.mark.parametrize(
    ("header", "strain", "force", "comments"),
    [
        ("strain,force_per_width_N_per_m", 1.0, 1.0, ()),
        ("strain_percent,force_per_width_gf_per_cm", 100.0, 1.0 / 0.980665, ()),
        ("Strain [%],Force per width [N/mm]", 100.0, 1e-3, ()),
        ("extension_mm,force_N", 80.0, 0.05, ("gauge_length_mm: 80", "width_mm: 50")),
        ("extension_mm,force_cN", 80.0, 5.0, ("gauge_length_mm: 80", "width_mm: 50")),
    ],
)
def test_every_way_to_give_a_tension_test_is_the_same_curve(write, header, strain, force, comments):
    found = read_tension(write(header, strain * STRAIN, force * FORCE, comments=comments), "wale")
    assert found.strain == pytest.approx(STRAIN)
    assert found.force_per_width == pytest.approx(FORCE)
    assert (found.direction, found.pretension, found.corrections) == ("wale", 0.0, ())
    assert (found.phase == LOADING).all()


def test_recovery_lateral_strain_and_band_are_read(write):
    strain = np.concatenate([STRAIN, [0.11, 0.08, 0.05]])
    force = np.concatenate([FORCE, [60.0, 20.0, 0.0]])
    path = write(
        "strain,force_per_width_N_per_m,lateral_strain_percent,strain_low,strain_high",
        strain, force, -40 * strain, strain - 0.01, strain + 0.02,
    )  # fmt: skip
    found = read_tension(path, "course")
    assert list(found.phase) == [LOADING] * 5 + [RECOVERY] * 3
    assert list(found.loading) == [0, 1, 2, 3, 4]
    assert found.lateral_strain == pytest.approx(-0.4 * strain)
    assert found.low == pytest.approx(strain - 0.01)
    assert found.high == pytest.approx(strain + 0.02)


def test_the_machine_is_subtracted_from_the_extension(write):
    # 100 mm of a specimen 40 mm wide on a machine that gives 0.02 mm per newton.
    gauge, width, compliance = 0.1, 0.04, 2e-5
    extension = gauge * STRAIN + compliance * FORCE * width
    columns = 1e3 * extension, FORCE * width
    comments = ["gauge_length_mm: 100", "width_mm: 40", "machine_compliance_mm_per_N: 0.02"]
    found = read_tension(write("extension_mm,force_N", *columns, comments=comments), "wale")
    assert found.strain == pytest.approx(STRAIN)
    share = compliance * 150.0 * width / extension[-1]
    assert f"{100 * share:.2g} %" in found.corrections[0]
    plain = write("extension_mm,force_N", *columns)
    stated = read_tension(
        plain, "wale", gauge_length=gauge, width=width, machine_compliance=compliance
    )
    assert stated.strain == pytest.approx(STRAIN)


def test_strain_counts_from_the_pretension(write):
    comments = ["pretension_N_per_m: 7"]
    columns = STRAIN, FORCE, -0.5 * STRAIN
    path = write("strain,force_per_width_N_per_m,lateral_strain", *columns, comments=comments)
    found = read_tension(path, "wale")
    assert found.lateral_strain == pytest.approx((1.0 - 0.5 * STRAIN[1:]) / 0.99 - 1.0)
    # 7 N/m lie half way between the first two points.
    length = 1.0 + STRAIN[1:]
    assert found.strain == pytest.approx(length / 1.02 - 1.0)
    assert found.force_per_width == pytest.approx(FORCE[1:])
    assert found.pretension == 7.0
    assert "2 %" in found.corrections[0]
    # What the caller states comes first; a file that starts above it has its zero there.
    stated = read_tension(path, "wale", pretension=2.0)
    assert stated.strain == pytest.approx(STRAIN)
    assert stated.corrections[0].endswith("0 % of strain in the file")


def test_the_recovery_below_the_pretension_is_left_out(write):
    strain = np.concatenate([STRAIN, [0.11, 0.08, 0.05]])
    force = np.concatenate([FORCE, [60.0, 20.0, 0.0]])
    path = write("strain,force_per_width_N_per_m", strain, force)
    found = read_tension(path, "wale", pretension=15.0)
    assert list(found.force_per_width) == [30.0, 70.0, 150.0, 60.0, 20.0]
    assert list(found.phase) == [LOADING] * 3 + [RECOVERY] * 2


NEEDED = "strain,force_per_width_N_per_m"
FAULTS = {
    "strain in per cent": (NEEDED, 100 * STRAIN, FORCE, (), "strain_percent"),
    "strain a fraction of a fraction": (NEEDED, STRAIN / 200, FORCE, (), "wrong unit"),
    "force that falls": (NEEDED, STRAIN, FORCE[::-1], (), "force falls on loading"),
    "force negative": (NEEDED, STRAIN, FORCE - 20, (), "must not be negative"),
    "no force": (NEEDED, STRAIN, 0 * FORCE, (), "must rise above 0"),
    "force in the wrong unit": (NEEDED, STRAIN, 1e5 * FORCE, (), "unit in the header"),
    "unsorted": (NEEDED, STRAIN[[0, 3, 1, 2, 4]], FORCE, (), "strain falls on loading"),
    "recovery first": (NEEDED, STRAIN[::-1], FORCE[::-1], (), "points of loading"),
    "not a number": (NEEDED, [0.01, np.nan, 0.03, 0.04], FORCE[:4], (), "finite"),
    "too few": (NEEDED, STRAIN[:3], FORCE[:3], (), "at least 4"),
    "compressed": (NEEDED, [-0.6, 0.1, 0.2, 0.3], FORCE[:4], (), "above -0.5"),
    "no width": ("strain,force_N", STRAIN, FORCE, (), "width_mm"),
    "no gauge length": ("extension_mm,force_per_width_N_per_m", STRAIN, FORCE, (), "gauge_length"),
    "no unit": ("strain,force_per_width", STRAIN, FORCE, (), "lacks its unit"),
    "unknown unit": ("strain,force_per_width_kN_per_m", STRAIN, FORCE, (), "unknown unit"),
    "compliance without width": (
        NEEDED, STRAIN, FORCE, ("machine_compliance_mm_per_N: 0.1", "gauge_length_mm: 100"),
        "width_mm",
    ),
    "compliance beyond the extension": (
        NEEDED, STRAIN, FORCE,
        ("machine_compliance_mm_per_N: 10", "gauge_length_mm: 100", "width_mm: 50"),
        "nothing is left",
    ),
    "pretension above all forces": (
        NEEDED, STRAIN, FORCE, ("pretension_N_per_mm: 0.2",), "below the largest force",
    ),
    "width of no length": (NEEDED, STRAIN, FORCE, ("width_mm: 0",), "above 0"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_curve_that_makes_no_sense_is_refused_by_name(write, fault):
    header, strain, force, comments, right = FAULTS[fault]
    path = write(header, strain, force, comments=comments)
    with pytest.raises(InputError) as refused:
        read_tension(path, "wale")
    text = str(refused.value)
    assert right in text
    assert "curve.csv" in text
    assert "\n" not in text


def test_a_refused_number_stands_as_in_the_file(write):
    header = "strain_percent,force_per_width_gf_per_cm"
    with pytest.raises(InputError, match=r"curve\.csv:5: force_per_width_gf_per_cm = 3:"):
        read_tension(write(header, 100 * STRAIN, [1.0, 4.0, 30.0, 3.0, 50.0]), "wale")
    with pytest.raises(InputError, match=r"curve\.csv:2: strain_percent = -60:"):
        read_tension(write(header, [-60.0, 1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0]), "wale")


def test_a_band_has_both_ends_and_holds_its_strain(write):
    header = NEEDED + ",strain_low"
    with pytest.raises(InputError, match="strain_high"):
        read_tension(write(header, STRAIN, FORCE, STRAIN - 0.01), "wale")
    header += ",strain_high"
    with pytest.raises(InputError, match=r"curve\.csv:2: strain_low"):
        read_tension(write(header, STRAIN, FORCE, STRAIN + 0.01, STRAIN + 0.02), "wale")


def test_noise_is_no_disorder(write):
    noisy = FORCE + np.array([0.0, -2.0, 3.0, -3.0, 0.0])
    strain = STRAIN + np.array([0.0, 0.002, -0.002, 0.0, 0.0])
    found = read_tension(write(NEEDED, strain, noisy), "wale")
    assert found.force_per_width == pytest.approx(noisy)


def bent():
    up = np.linspace(0.0, 2.5, 11)
    curvature = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    rising = np.sign(np.diff(curvature, prepend=-0.25))
    return curvature, 0.05 * curvature + 0.01 * rising


def test_a_bending_test_in_units_of_kes(write):
    curvature, moment = bent()
    found = read_bending(
        write("curvature_per_cm,moment_per_width_gf_cm_per_cm", curvature, moment), "course"
    )
    assert found.curvature == pytest.approx(100.0 * curvature)
    assert found.moment_per_width == pytest.approx(9.80665e-3 * moment)


def test_a_bending_test_that_makes_no_sense_is_refused(write):
    curvature, moment = bent()
    header = "curvature_per_cm,moment_per_width_gf_cm_per_cm"
    for wrong, right in (
        ((curvature, -moment), "must rise with the curvature"),
        ((1e3 * curvature, moment), "at most 100 per cm"),
        ((1e-4 * curvature, moment), "0.01 per cm or more"),
        ((np.tile(curvature, 2), np.tile(moment, 2)), "one cycle"),
    ):
        with pytest.raises(InputError, match=right):
            read_bending(write(header, *wrong), "course")

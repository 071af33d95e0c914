"""Bending in the stages: conditions, stored states, KES and curl tables, yarn to fabric."""

import copy
import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from conftest import COTTON
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

import knitsim as ks
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.errors import InputError
from knitsim.kes import rigidity as short
from knitsim.kes.curl import is_none, rolls_to
from knitsim.stages import equilibrium_bending as bending
from knitsim.stages import kes, vtk_states, yarn_to_fabric
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.stages.kes_table import curl_table, kes_table
from knitsim.stages.laws import laws_of
from knitsim.stages.ledger import effect_dataset
from knitsim.store.results import labels_of
from knitsim.store.writer import write
from knitsim.study.study import load_study

YARN = {
    "count_tex": 56,
    "fibres": 40,
    "bending_rigidity_N_mm2": 0.005,
    "tension_law": {"kind": "points", "strain": [0, 0.05], "tension_N": [0, 2.0]},
}
FABRIC = {"yarn": "y", "wales_per_cm": 6.67, "courses_per_cm": 8.33, "loop_length_mm": 5.56}


def made(tmp_path, **tests):
    """The fabric of a study with these tests, and the laws of its yarn."""
    scenes = {"paper_yarn": {"tensile_test": {}}, "paper_fabric": tests}
    for name, data in (("yarns", {"y": YARN}), ("fabrics", {"f": FABRIC}), ("scenes", scenes)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(data))
    fabric = load_study(tmp_path).fabrics["f"]
    return fabric, laws_of(fabric.yarn, None)


@pytest.fixture(scope="module")
def tested(tmp_path_factory):
    """Fabric, laws and the dataset of its wale bending without friction, held, and with set."""
    fabric, laws = made(
        tmp_path_factory.mktemp("study"),
        equilibrium_rest={"points": 32},
        equilibrium_bending={
            "states": 5,
            "variants": {
                "free": {},
                "held": {"spacings": "held", "max_curvature_per_cm": 1.0},
                "set": {"set": 0.9, "states": 2},
            },
        },
    )
    return fabric, laws, bending.run(fabric, laws, "wale")[0]


# The test as the scene asks for it


def test_curvatures_go_to_both_sides_and_end_flat():
    choice = {"max_curvature": 0.3, "states": 3, "cycles": 2}
    once = [0.1, 0.2, 0.3, 0.2, 0.1, 0, -0.1, -0.2, -0.3, -0.2, -0.1, 0]
    found = bending.curvatures_of(choice)
    assert found == pytest.approx([0, *once, *once])
    assert found.max() == 0.3 and found.min() == -0.3
    assert (found[[0, 6, 12, 18, 24]] == 0).all()


@pytest.mark.parametrize("direction", ["course", "wale"])
def test_yarn_strain_is_that_of_the_bent_positions(cotton_law, direction):
    """Against the length of the loop in space, as drawn straight between its points."""
    relaxed = relax(Fabric(**COTTON, bending_rigidity=5e-9, law=cotton_law), Resolution(32))
    curve = bend(relaxed, direction, [100.0, -250.0])

    def length(line):
        return np.linalg.norm(np.diff(CubicSpline(along, line)(fine), axis=0), axis=1).sum()

    along = np.linspace(0.0, 1.0, curve.centreline.shape[1])
    fine = np.linspace(0.0, 1.0, 20_001)
    for k in range(curve.steps):
        strain = length(curve.centrelines_bent(k)[0]) / COTTON["loop_length"] - 1.0
        assert curve.yarn_strain[k] == pytest.approx(strain, abs=2e-5)
        unbent = length(curve.centreline[k]) / COTTON["loop_length"] - 1.0
        assert abs(unbent - strain) > 1e-4


def test_stored_states_are_those_of_the_test(tested):
    _, _, dataset = tested
    free, held, with_set = (dataset.sel(variant=name) for name in ("free", "held", "set"))
    assert dataset.sizes["step"] == 21
    assert free.curvature.values == pytest.approx(
        50 * np.array([*range(6), *range(4, -6, -1), *range(-4, 1)])
    )
    outward = [True] * 6 + [False] * 5 + [True] * 5 + [False] * 5
    assert ((free.phase.values == "loading") == outward).all()
    assert (free.cycle.values == 1).all()
    assert held.curvature.max() == 100
    for name in ("wale", "course"):
        spacing = held[f"{name}_spacing"].values
        assert np.ptp(spacing) < 1e-12 < 1e-6 < np.ptp(free[f"{name}_spacing"].values)
    # The variant of two states a quarter is padded: no numbers, not converged.
    assert np.isnan(with_set.moment_per_width.values[9:]).all()
    assert with_set.status.values[[8, 9]].tolist() == [0, 3]
    assert (dataset.crossings_intact.sel(variant="free").values == 1).all()
    assert (np.abs(dataset.numerical_error.values[0]) < 0.05).all()
    assert json.loads(dataset.attrs["readings"])["set"]["set"] == 0.9
    # Without friction nothing is lost, and the moment does the work that changes the energy.
    energy, angle = (
        free.energy.sum("term").values,
        free.curvature.values * free.course_spacing.values,
    )
    couple = free.moment_per_width.values * float(free.wale_spacing[0])
    work = cumulative_trapezoid(couple, angle, initial=0.0)
    assert np.abs(work - (energy - energy[0])).max() < 0.01 * np.abs(work).max()
    assert free.dissipated.values == pytest.approx(0, abs=1e-15)
    # Set takes the curl, which stays to the same side.
    flat = [float(one.moment_per_width[0]) for one in (free, with_set)]
    assert 0 < flat[1] < 0.3 * flat[0]


def test_rigidity_of_the_ledger_is_the_one_that_kes_reads(tested):
    fabric, laws, dataset = tested
    [(_, found)] = kes.bending_of(dataset.sel(variant="free"))
    relaxed = relax(solver_fabric(fabric, laws["continuous"]), settings_of(fabric).resolution)
    rigidity, curl = short.rigidity_and_curl(relaxed, "wale")
    assert rigidity == pytest.approx(found["B"].value, rel=2e-3)
    assert curl == pytest.approx(found["M0"].value, rel=1e-6)
    assert dataset.headline.values == pytest.approx([rigidity, curl])


def test_too_tight_cylinders_are_refused_by_their_key(tmp_path, tested):
    # Half of 1/0.279 mm: more is refused before anything is computed.
    with pytest.raises(InputError, match=r"variants\.tight\.max_curvature_per_cm = 20: must be at"):
        variants = {"free": {}, "tight": {"max_curvature_per_cm": 20.0}}
        made(tmp_path, equilibrium_rest={}, equilibrium_bending={"variants": variants})
    fabric, laws, _ = tested
    tight = copy.copy(fabric)
    tight.scene = copy.deepcopy(fabric.scene)
    tight.scene["equilibrium_bending"]["variants"]["free"]["max_curvature"] = 1700.0
    relaxed = relax(solver_fabric(fabric, laws["continuous"]), settings_of(fabric).resolution)
    with pytest.raises(InputError, match=r"variants\.free\.max_curvature_per_cm = 17: .*too thick"):
        bending.bent(tight, relaxed, "wale", "free")


def test_hysteresis_of_the_yarn_counts_where_there_is_friction(tested):
    fabric, laws, _ = tested
    lagging = fabric.with_value("yarn.bending_hysteresis_mN_mm", 0.7)
    for friction, lag in ((True, 0.7e-6), (False, 0.0)):
        choice = {"friction": friction, "set": 0.2}
        relaxed = bending.relaxed_for(
            lagging, laws["continuous"], choice, settings_of(lagging).resolution
        )
        built = relaxed.model.fabric
        assert built.bending_hysteresis == pytest.approx(lag)
        assert (built.friction > 0) == friction and built.set_fraction == 0.2


def test_vtk_shows_each_curvature_once(tested, tmp_path):
    _, _, dataset = tested
    states = list(vtk_states._states(dataset))
    shown = [fields["curvature"] for _, _, fields, _ in states]
    assert sorted(shown) == pytest.approx(np.arange(-250.0, 251.0, 50.0))


# Tables


def ideal(direction, offset, rigidity, half_width, most=250.0, error=0.0, pattern="jersey"):
    """Dataset of a test whose moment is offset + rigidity curvature +- half_width."""
    x = most * np.concatenate(
        [np.linspace(0, 1, 11), np.linspace(1, -1, 21)[1:], np.linspace(-1, 0, 11)[1:]]
    )
    way = np.concatenate([np.ones(11), -np.ones(20), np.ones(10)])
    moment = offset + rigidity * x + half_width * way
    return xr.Dataset(
        {
            "moment_per_width": (("variant", "step"), [moment]),
            "numerical_error": (("variant", "step"), [np.full(41, error)]),
        },
        {
            "variant": ["ideal"],
            "curvature": (("variant", "step"), [x]),
            "cycle": (("variant", "step"), [np.ones(41, dtype=int)]),
        },
        {
            **labels_of("equilibrium_bending", "f", "y", direction=direction, pattern=pattern),
            "configuration": json.dumps({"name": "f"}),
            "assumptions": "[]",
        },
    )


def stored(tmp_path, direction, **values):
    path = tmp_path / "bending" / "f" / f"equilibrium_{direction}.nc"
    path.parent.mkdir(parents=True, exist_ok=True)
    ideal(direction, **values).to_netcdf(path, engine="netcdf4")
    return path


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_kes_table_gives_rigidity_and_hysteresis_of_an_ideal_curve(tmp_path):
    path = stored(tmp_path, "wale", offset=8e-4, rigidity=5e-6, half_width=2e-4)
    write(kes.run([path]), tmp_path / "kes.nc")
    kes_table([tmp_path / "kes.nc"], tmp_path / "kes.csv")
    rows = {row["name"]: row for row in read(tmp_path / "kes.csv")}
    labels = {rows["B"][name] for name in ("fabric", "test", "model", "direction", "variant")}
    assert labels == {"f", "bending", "equilibrium", "wale", "ideal"}
    for name in ("B", "B_face", "B_back"):
        assert float(rows[name]["value"]) == pytest.approx(5e-6, rel=1e-9)
    # 1 N m2/m is 1e3/9.80665 gf times 1e4 cm2 over 1e2 cm.
    assert float(rows["B"]["kes_value"]) == pytest.approx(5e-6 * 1e5 / 9.80665, rel=1e-7)
    assert float(rows["2HB"]["value"]) == pytest.approx(4e-4, rel=1e-7)
    # -(8e-4 + 2e-4)/5e-6 on the way up, -(8e-4 - 2e-4)/5e-6 on the way down.
    found = [float(rows[name]["value"]) for name in ("K0_rising", "K0_falling", "K0")]
    assert found == pytest.approx([-200.0, -120.0, -160.0])


def test_curl_table_names_side_and_curvature(tmp_path):
    other = tmp_path / "loop.nc"
    xr.Dataset(attrs=labels_of("loop", "f", "y")).to_netcdf(other, engine="netcdf4")
    paths = [
        stored(tmp_path, "wale", offset=1e-3, rigidity=5e-6, half_width=0.0, error=0.01),
        stored(tmp_path, "course", offset=-4e-3, rigidity=5e-6, half_width=0.0, error=0.01),
        other,
    ]
    curl_table(paths, tmp_path / "curl.csv")
    wale, course = read(tmp_path / "curl.csv")
    assert (wale["edges"], wale["rolls_to"]) == ("top and bottom", "face")
    assert (course["edges"], course["rolls_to"]) == ("sides", "back")
    for row in (wale, course):
        assert row["rolls_to"] == row["known_to_roll_to"]
    assert float(wale["moment_error_N"]) == pytest.approx(1e-5)
    assert float(wale["curvature_at_zero_moment_per_cm"]) == pytest.approx(-2.0)
    # There the moment vanishes: 1 % of 1 % of the largest, 2.25e-3 N, over the slope.
    error = 0.01 * 0.01 * 2.25e-3 / 5e-6 / 100.0
    assert float(wale["curvature_error_per_cm"]) == pytest.approx(error, rel=1e-3)
    assert course["curvature_at_zero_moment_per_cm"] == "not reached: above 2.5"
    assert "not extrapolated" in course["why_not"]
    assert rolls_to(1e-3, 2e-3) == "neither"


def test_a_curl_that_is_the_solvers_error_is_none(tmp_path):
    """Of a rib, whose face and back are alike: 1e-8 N beside a moment of 1.25e-3 N at 2.5 per cm."""
    path = stored(
        tmp_path, "wale", offset=1e-8, rigidity=5e-6, half_width=0.0, error=0.0, pattern="kp"
    )
    curl_table([path], tmp_path / "curl.csv")
    (row,) = read(tmp_path / "curl.csv")
    assert float(row["moment_at_zero_curvature_N"]) == 0.0
    assert (row["rolls_to"], row["known_to_roll_to"]) == ("neither", "")
    assert float(row["curvature_at_zero_moment_per_cm"]) == 0.0
    # What is more than a thousandth of the moment at 1 per cm is told.
    assert not is_none(1.1e-3, 1.0) and is_none(-0.9e-3, 1.0)


# Yarn to fabric


def test_affine_rigidity_is_that_of_straight_rods():
    w, c, rigidity = 1.6e-3, 1.1e-3, 5e-9
    along = np.linspace([0, 0, 0], [w, 0, 0], 7)
    assert short.affine_rigidity(along, rigidity, w, c) == pytest.approx([5e-9 / c, 0])
    up, down = np.linspace([0, 0, 0], [0, c, 0], 5), np.linspace([0, c, 0], [0, 0, 0], 5)
    legs = np.concatenate([up, down[1:]])
    found = short.affine_rigidity(legs, rigidity, w, c)
    assert found == pytest.approx([0, 2 * 5e-9 / w])
    slanted = np.linspace([0, 0, 0], [w, w, 0], 9)
    expected = 5e-9 / (w * c) * np.sqrt(2) * w * np.cos(np.pi / 4) ** 4
    found = short.affine_rigidity(slanted, rigidity, w, c)
    assert found == pytest.approx([expected, expected])


def test_yarn_to_fabric_changes_one_thing_at_a_time(tmp_path):
    section = {
        "points": 2, "set_compared": [0.0], "diameter_low": 0.9, "diameter_high": 1.0,
        "loop_length_low": 0.15, "loop_length_high": 1.1,
    }  # fmt: skip
    fabric, laws = made(tmp_path, equilibrium_rest={"points": 32}, yarn_to_fabric=section)
    dataset, _ = yarn_to_fabric.run(fabric, laws)
    assert dataset.swept.values.tolist() == ["loop_length"] * 2 + ["diameter"] * 2 + ["set"] * 2
    d = fabric.yarn["diameter"]
    assert dataset.swept_loop_length.values == pytest.approx(
        1e-3 * np.array([0.834, 6.116, 5.56, 5.56, 5.56, 5.56])
    )
    assert dataset.swept_diameter.values == pytest.approx(d * np.array([1, 1, 0.9, 1, 1, 1]))
    assert dataset.swept_set.values == pytest.approx([0, 0, 0, 0, 0, 0.95])
    # A loop of less than three diameters has no room for its yarn; the rest is there.
    rigidity = dataset.fabric_rigidity.values
    assert np.isnan(rigidity[0]).all() and np.isfinite(rigidity[1:]).all()
    assert dataset.attrs["not_reached"].startswith("loop_length 0.000834, set_fraction 0: diameter")
    assert (rigidity[1:] > 0).all()
    # The stated fabric stands in two sweeps; a longer loop gives a softer fabric.
    assert rigidity[3] == pytest.approx(rigidity[4], rel=1e-12)
    assert (rigidity[1] < rigidity[3]).all()
    assert dataset.curl_moment.values[3, 0] < 0 < dataset.curl_moment.values[3, 1]
    assert json.loads(dataset.attrs["settings"]) == {"accuracy": None, "points": 32}
    write(dataset, tmp_path / "yarn_to_fabric.nc")


def test_a_path_that_ends_early_has_no_rigidity(monkeypatch):
    curve = SimpleNamespace(stop_reason="stopped", flat_moment=0.5, moment_per_width=np.zeros(2))
    monkeypatch.setattr(short, "bend", lambda *args, **options: curve)
    rigidity, curl = short.rigidity_and_curl(None, "wale")
    assert np.isnan(rigidity) and curl == 0.5


def test_a_rib_is_balanced_and_no_part_of_its_curl_is_told():
    """By symmetry it has no curl: a change in per cent would be that of the solver's error."""
    yarn = ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3)
    rib = ks.Fabric(yarn, pattern="rib_1x1", loop_length_mm=2.9)
    found = bending.headlines(rib, Resolution(24), "course")
    assert found["moment that holds it flat"][0] == 0.0 < found["rigidity B"][0]
    effects = effect_dataset(
        rib, {"equilibrium_bending"}, lambda one: {"curl": (0.0 * one.yarn["diameter"], "N")}
    )
    assert effects.sizes["alternative"] and not np.isfinite(effects.assumption_effect).any()

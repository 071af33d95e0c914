"""The public library: what a fabric made by keywords gives, against the stages and the solver itself."""

import doctest
import importlib
import inspect
import json
import subprocess
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray as xr

import knitsim as ks
from knitsim.equilibrium.contact import LAWS, BarrierContact
from knitsim.equilibrium.pull import tensile
from knitsim.errors import InputError
from knitsim.stages import equilibrium_bending, equilibrium_rest, equilibrium_tension
from knitsim.stages.laws import laws_of
from knitsim.store.schema import COORDINATES, VARIABLES
from knitsim.store.writer import with_attributes

matplotlib.use("agg")
CONFIG = Path(__file__).parents[1] / "config"
DOCUMENTED = (
    "knitsim.library.rest", "knitsim.library.tests", "knitsim.library.result", "knitsim.library.kes",
    "knitsim.library.sweep", "knitsim.library.inference", "knitsim.study.study", "knitsim.study.count",
    "knitsim.measured.read",
)  # fmt: skip


@pytest.fixture(scope="module")
def fabric():
    yarn = ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3, friction=0.25)
    return ks.Fabric(yarn, wales_per_cm=14, courses_per_cm=20, loop_length_mm=2.9)


@pytest.fixture(scope="module")
def rest(fabric):
    return ks.relax(fabric)


@pytest.fixture(scope="module")
def results(rest):
    return {
        "rest": rest,
        "pull": ks.pull(rest, "course", to_strain=0.2, recovery=True, states=6),
        "wale": ks.pull(rest, "wale", to_force_gf_per_cm=30, states=6),
        "bend": ks.bend(rest, "wale", states=4),
        "shear": ks.shear(rest, to_deg=4, states=8),
        "biaxial": ks.biaxial(rest, 0.1, 0.05, states=3),
    }


@pytest.mark.parametrize("module", DOCUMENTED)
def test_examples(module, monkeypatch):
    monkeypatch.chdir(CONFIG.parent)
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried and not failed


def test_every_public_name_has_an_example():
    for name in ks.__all__:
        one = getattr(ks, name)
        if name in ("__version__", "open_store", "scalar_table"):
            continue
        text = inspect.getdoc(import_module("knitsim.library.kes").kes if name == "kes" else one)
        assert ">>>" in text or name in ("load_study", "read_measured"), name
    # The two stand at the head of their modules.
    for name in ("load_study", "read_measured"):
        assert f"{name}(" in sys.modules[getattr(ks, name).__module__].__doc__


def test_importing_it_is_light():
    code = (
        "import sys, knitsim; dir(knitsim); heavy = {'numba', 'numpy', 'xarray', 'scipy'}; "
        "sys.exit(len(heavy & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
    # A curve on the screen needs no tables and datasets.
    code = "import sys, knitsim; knitsim.pull; sys.exit('xarray' in sys.modules or 'pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'knit'"):
        _ = ks.knit


def test_a_fabric_made_here_is_one_of_a_study(tmp_path):
    (tmp_path / "yarns.yaml").write_text("yarn: {count: 30/2 Ne, friction: 0.3, scene: y}\n")
    (tmp_path / "fabrics.yaml").write_text(
        "fabric: {yarn: yarn, scene: f, wales_per_inch: 36, courses_per_inch: 50, tightness_factor: 15}\n"
    )
    (tmp_path / "scenes.yaml").write_text("y: {tensile_test: {}}\nf: {equilibrium_rest: {}}\n")
    read = ks.load_study(tmp_path).fabrics["fabric"]
    yarn = ks.Yarn(count="30/2 Ne", friction=0.3)
    made = ks.Fabric(yarn, wales_per_inch=36, courses_per_inch=50, tightness_factor=15)
    assert type(read) is type(made) is ks.Fabric
    for one, other in ((read, made), (read.yarn, made.yarn)):
        values, others = ({k: v for k, v in x.values.items() if k != "scene"} for x in (one, other))
        assert values == others and one.derived == other.derived
    assert [row.key for row in read.yarn._rows] == [row.key for row in made.yarn._rows]
    assert read.config("equilibrium_rest") == made.config("equilibrium_rest")


BAD = (
    (
        lambda f: ks.Yarn(count_tex=20, friction=2),
        "yarn.friction = 2: must be at least 0 and at most 1",
    ),
    (
        lambda f: ks.Yarn(count_tex=20, frictoin=2),
        "yarn.frictoin: is no key; the nearest is friction",
    ),
    (lambda f: ks.Yarn(friction=0.2), "yarn.count_dtex: is missing; give count_dtex or count_tex"),
    (lambda f: ks.Yarn(count_tex=20, scene="x"), "yarn.scene: is a key of a study"),
    (
        lambda f: ks.Fabric("cotton", loop_length_mm=3),
        "fabric.yarn = 'cotton': must be a knitsim.Yarn",
    ),
    (
        lambda f: ks.Fabric(f.yarn, loop_length_mm=[3, 4]),
        "loop_length_mm = [3, 4]: must be one value",
    ),
    (lambda f: ks.pull(f, "bias"), "pull.direction = 'bias': must be course or wale"),
    (
        lambda f: ks.pull(f, "course", to_strain=9),
        "pull.to_strain = 9: must be above 0 and at most 5",
    ),
    (lambda f: ks.pull(f, "course", cycles=2), "pull.cycles = 2: needs recovery=True"),
    (
        lambda f: ks.pull(f, "course", lateral="loose"),
        "pull.lateral = 'loose': must be free or held or",
    ),
    (lambda f: ks.bend(f, "course", to_per_cm=99), "bend.to_per_cm = 99: must be at most"),
    (lambda f: ks.shear(f, to_deg=60), "shear.to_deg = 60: must be above 0 and at most 45"),
    (lambda f: ks.biaxial(f, -2, 0.1), "biaxial.course = -2: must be a strain"),
    (lambda f: ks.pull(None, "course"), "pull = None: needs a Fabric"),
    (lambda f: ks.relax(f, points=7), "relax.points = 7: must be at least 24"),
    (lambda f: ks.relax(f, accuracy="1%"), "relax.accuracy = '1%': must be a number; 0.01 is 1 %"),
    (lambda f: ks.relax(f.yarn), "relax = <Yarn"),
    (lambda f: ks.scalar_table("no/such"), "no/such: no such directory"),
    (lambda f: ks.relax(f, points=48, accuracy=0.1), "chooses what points states"),
    (lambda f: ks.kes(f), "needs a pull, a bend, a shear or a measured test"),
    (lambda f: ks.predict(f, "course"), "needs to_N_per_mm (tension) or to_per_cm (bending)"),
)


@pytest.mark.parametrize(("call", "words"), BAD, ids=[words[:30] for _, words in BAD])
def test_refused(fabric, call, words):
    with pytest.raises(InputError) as refused:
        call(fabric)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_datasets_are_those_of_the_store(results, tmp_path):
    for name, one in results.items():
        dataset = one.to_dataset()
        for variable in dataset.variables:
            entry = (COORDINATES if variable in dataset.coords else VARIABLES)[variable]
            assert dataset[variable].attrs.get("units") == entry.units, (name, variable)
        assert json.loads(dataset.attrs["configuration"])["name"] == "fabric"
        assert {"kind", "model", "direction", "fabric", "yarn", "pattern"} <= set(dataset.attrs)
        path = tmp_path / f"{name}.nc"
        one.to_netcdf(path)
        with xr.open_dataset(path) as stored:
            assert set(stored.variables) == set(dataset.variables)


def test_the_numbers_are_those_of_the_stages(fabric):
    """The stage, asked for the same test, is the independent way to the file."""
    laws = laws_of(fabric.yarn, None)
    condition = {"friction": True, "recovery": True, "max_strain_course": 0.2, "states": 6}
    fabric = fabric.with_rest(points=48)
    asked = fabric.with_tests(equilibrium_tension={**condition, "variants": {"pull": {}}})
    staged, _ = equilibrium_tension.run(asked, laws, "course")
    own = ks.pull(fabric, "course", to_strain=0.2, recovery=True, states=6).to_dataset()
    staged = with_attributes(staged).isel(variant=0)
    for name in (
        "strain",
        "force_per_width",
        "work",
        "dissipated",
        "numerical_error",
        "wale_spacing",
    ):
        np.testing.assert_array_equal(staged[name].values, own[name].values)
        assert staged[name].attrs == own[name].attrs
    assert set(own.variables) <= set(staged.variables) | {"variant"}
    for name in ("kind", "model", "direction", "fabric", "references", "summary", "schema_version"):
        assert staged.attrs[name] == own.attrs[name]
    bent = fabric.with_tests(
        equilibrium_bending={"friction": True, "states": 4, "variants": {"bend": {}}}
    )
    staged, _ = equilibrium_bending.run(bent, laws, "wale")
    own = ks.bend(fabric, "wale", states=4).to_dataset()
    np.testing.assert_array_equal(
        staged["moment_per_width"].values[0], own["moment_per_width"].values
    )


def test_rest_is_that_of_the_stage(fabric, rest):
    staged, _ = equilibrium_rest.run(fabric, laws_of(fabric.yarn, None))
    own = rest.to_dataset()
    for name in (
        "wale_spacing",
        "course_spacing",
        "kc",
        "kw",
        "spacing_error",
        "stated_wale_spacing",
    ):
        assert float(staged[name]) == float(own[name])
    assert own.attrs["title"] == staged.attrs["title"]


def test_a_density_that_nobody_stated_is_no_number():
    rest = ks.relax(ks.Fabric(ks.Yarn(count_tex=20), loop_length_mm=2.9), points=48)
    assert np.isnan(rest.to_dataset()["stated_wale_spacing"])


def test_what_nobody_stated_is_printed_in_ten_lines():
    assumed = ks.Fabric(ks.Yarn(count_tex=20), loop_length_mm=2.9).assumptions()
    lines = repr(assumed).splitlines()
    assert lines[0].startswith("fabric: set = 0 (0 to 0.9); ") and len(lines) <= 10
    told = " ".join(line.strip() for line in lines)
    assert all(f"{row.key} = " in told for row in assumed)
    assert "to_dataframe()" in lines[-1] and len(assumed.to_dataframe()) == len(assumed)
    few = type(assumed)(assumed[:2])
    assert repr(few).splitlines()[0].startswith("fabric.set = 0 (0 to 0.9): not stated")


def test_pulling_is_the_solver_and_friction_is_on(rest, results):
    curve = results["pull"]
    again = tensile(curve.curve.start, "course", curve.strain[1:7], recovery=True,
                    increment=curve.curve.increment)  # fmt: skip
    np.testing.assert_allclose(curve.force_per_width[1:7], again.force_per_width[:6], rtol=1e-9)
    assert curve.curve.dissipated[-1] > 0
    without = ks.pull(rest, "course", to_strain=0.2, states=6, friction=False)
    assert (without.force_per_width[1:] < curve.force_per_width[1:7]).all()
    assert without.curve.dissipated.max() == 0.0


def test_both_directions_at_once_agree_with_one():
    """A biaxial path along the states of a pull with free sides needs no force across."""
    rest = ks.relax(ks.Fabric(ks.Yarn(count_tex=20, friction=0.0), loop_length_mm=2.9), points=48)
    pull = ks.pull(rest, "course", to_strain=0.1, states=5)
    across = float(pull.curve.transverse_strain[-1])
    both = ks.biaxial(rest, 0.1, across, states=2)
    assert both.force_per_width[-1] == pytest.approx(pull.force_per_width[-1], rel=1e-4)
    assert abs(both.wale_force_per_width[-1]) < 1e-3 * both.force_per_width[-1]


def test_tables_and_one_line(results, capsys):
    for one in results.values():
        frame = one.to_dataframe()
        assert len(frame) == (1 if one is results["rest"] else one.curve.steps)
        assert frame.select_dtypes("number").notna().all().all() or one is results["biaxial"]
        assert "\n" not in repr(one) and len(repr(one)) < 200
    for public in (
        *results.values(),
        ks.kes(results["pull"]),
        ks.kes(results["bend"]),
        ks.Pull("wale"),
    ):
        print(public)
        assert len(capsys.readouterr().out.splitlines()) <= 10


def test_plots_are_in_textile_units(results):
    for one in results.values():
        axes = one.plot()
        assert axes.get_xlabel() and axes.get_ylabel()
    drawn = results["pull"].plot().lines
    assert {line.get_linestyle() for line in drawn} == {"-", "--"}
    # 1 gf/cm = 0.980665 N/m.
    top = max(line.get_ydata().max() for line in drawn)
    assert top == pytest.approx(results["pull"].force_per_width.max() / 0.980665)
    given = results["wale"].plot()
    assert results["pull"].plot(given) is given


def test_a_curve_that_locks_is_read_where_it_rises():
    """A limp fabric takes hardly any force until its yarn is straight: work as the solver has done it."""
    yarn = ks.Yarn(count="20 dtex", fibres=1, bending_rigidity_N_mm2=1e-6, density_g_per_cm3=1.14)
    fabric = ks.Fabric(yarn, loop_length_mm=3.0)
    pull = ks.pull(fabric, "course", to_force_gf_per_cm=50, friction=False)
    found = ks.kes(pull)
    assert "50 gf/cm" in repr(found) and "too few" not in repr(found)
    assert np.diff(pull.force_per_width).max() < 0.25 * pull.force_per_width[-1]
    area = pull.rest.wale_spacing * pull.rest.course_spacing
    assert found["WT"].value == pytest.approx(pull.curve.work[-1] / area, rel=0.02)


def test_kes_by_hand(rest):
    pull = ks.pull(rest, "course", to_force_gf_per_cm=20, recovery=True, states=60)
    found = ks.kes(pull)
    up = pull.curve.phase == 0
    assert found["EMT"].value == pytest.approx(pull.strain.max())
    work = np.trapezoid(pull.force_per_width[up], pull.strain[up])
    assert found["WT"].value == pytest.approx(work, rel=2e-3)
    top = np.flatnonzero(up)[-1]  # recovery begins there
    back = -np.trapezoid(pull.force_per_width[top:], pull.strain[top:])
    assert found["RT"].kes_value == pytest.approx(100 * back / work, rel=1e-2)
    assert ks.kes(pull, to_force_gf_per_cm=10)["EMT"].value < found["EMT"].value


def test_a_contact_law_of_ones_own():
    """One class, registered under the name of its section: keyword, check and solver follow."""

    @dataclass(frozen=True)
    class Stiffer(BarrierContact):
        """The barrier, three times as stiff as it says."""

        def for_kernels(self, diameter):
            return BarrierContact(3.0 * self.stiffness).for_kernels(diameter)

    plain = ks.Fabric(ks.Yarn(count_tex=20, compression_stiffness_N_per_m=3000), loop_length_mm=2.9)
    LAWS["stiffer_law"] = Stiffer
    try:
        yarn = ks.Yarn(count_tex=20, stiffer_law={"compression_stiffness_N_per_m": 1000})
        own = ks.relax(ks.Fabric(yarn, loop_length_mm=2.9), points=48)
        with pytest.raises(
            InputError, match=r"stiffer_law\.compression_stiffness_N_per_m = -1: must be above 0"
        ):
            ks.Yarn(count_tex=20, stiffer_law={"compression_stiffness_N_per_m": -1})
    finally:
        del LAWS["stiffer_law"]
    same = ks.relax(plain, points=48)
    assert own.wale_spacing == pytest.approx(same.wale_spacing, rel=1e-3)
    soft = ks.relax(replace_stiffness(plain, 1000), points=48)
    assert abs(soft.wale_spacing / same.wale_spacing - 1) > 5e-3


def replace_stiffness(fabric, value):
    return fabric.with_value("yarn.compression_stiffness_N_per_m", value)


def test_a_study_read_is_tested_as_its_scene_says():
    """The accuracy of the scene counts until the call says otherwise."""
    cotton = ks.load_study(CONFIG).fabrics["cotton"].with_rest(points=48)
    assert ks.relax(cotton).state.model.cell.points == 48
    assert ks.relax(cotton, points=72).state.model.cell.points == 72


def pulled_along_the_course(folder, bending_rigidity):
    """A fabric, a pull of it with another rigidity (N mm2) of its yarn, and the file of that curve."""
    yarn = ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3, friction=0.0)
    fabric = ks.Fabric(yarn, loop_length_mm=2.9)
    other = fabric.with_value("yarn.bending_rigidity_N_mm2", bending_rigidity)
    made = ks.pull(other, "course", to_strain=0.4, states=12)
    path = folder / "course.csv"
    rows = [f"{e},{f / 1000}" for e, f in zip(made.strain, made.force_per_width, strict=True)]
    path.write_text("\n".join(["strain,force_N_per_mm", *rows]))
    return fabric, made, path


def test_calibration_finds_what_made_the_curve(tmp_path):
    fabric, made, path = pulled_along_the_course(tmp_path, 2.7e-3)
    curve = ks.read_measured(path, direction="course")
    found = ks.calibrate(
        fabric,
        curve,
        "bending_rigidity",
        bounds={"bending_rigidity_N_mm2": [1e-3, 5e-3]},
        profile=False,
    )
    assert found.to_dataframe()["value"][0] == pytest.approx(2.7e-3, rel=2e-3)
    predicted = ks.predict(found, "wale", to_N_per_mm=0.02, states=4)
    truth = ks.pull(made.rest, "wale", to_strain=0.2, states=40)
    at = np.interp(predicted["force_per_width"], truth.force_per_width, truth.strain)
    np.testing.assert_allclose(predicted["strain"], at, rtol=0.02)
    assert (predicted["low"] <= predicted["high"]).all() and predicted.plot().get_xlabel()
    assert "\n" not in repr(found) + repr(predicted)
    # Measured curve, fit and a pull of the fitted fabric in one picture: the same units, the same curve.
    drawn = curve.plot(found.plot()).lines
    fitted = next(one for one in drawn if one.get_label() == "course, fitted")
    for line in drawn:
        np.testing.assert_allclose(line.get_xdata()[-8:], 100 * made.strain[-8:], rtol=5e-3)
        np.testing.assert_allclose(line.get_ydata()[-8:], made.force_per_width[-8:] / 0.980665)
    assert (
        fitted.get_linestyle() == "-" and found.plot().get_xlabel() == "Strain along the pull (%)"
    )
    assert ks.kes(curve)["EMT"].kes_value == pytest.approx(
        100 * np.interp(49.03325, made.force_per_width, made.strain), rel=5e-3
    )
    with pytest.raises(InputError, match="is of a parameter that is not free"):
        ks.calibrate(fabric, [curve], bounds={"friction": [0, 1]})


@pytest.mark.slow
def test_without_a_free_parameter_every_input_is_uncertain(tmp_path):
    fabric, made, path = pulled_along_the_course(tmp_path, 2.4e-3)
    found = ks.calibrate(fabric, ks.read_measured(path, direction="course"), (), fabrics=40)
    told = found.to_dataframe().set_index("input")
    assert (told["low"] < told["high"]).all() and told["narrowed"]["bending_rigidity"] < 0.9
    names = [text.get_text() for text in found.plot().get_yticklabels()]
    assert names == [one.replace("_", " ") for one in told.index[:-1]]
    assert found.next_tests("wale")["deviation_after_over_before"].is_monotonic_increasing
    predicted = ks.predict(found, "wale", to_N_per_mm=0.02, states=4)
    truth = ks.pull(made.rest, "wale", to_strain=0.2, states=40)
    at = np.interp(predicted["force_per_width"], truth.force_per_width, truth.strain)
    assert ((predicted["low"] < at) & (at < predicted["high"])).all()
    assert "\n" not in repr(found) + repr(predicted)
    with pytest.raises(InputError, match="needs a calibration with free parameters"):
        ks.predict(found, "wale", to_per_cm=1.0)


@pytest.mark.slow
def test_types_are_checked():
    pytest.importorskip("mypy")
    done = subprocess.run(
        [sys.executable, "-m", "mypy"], cwd=CONFIG.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout

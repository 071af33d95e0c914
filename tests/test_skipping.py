"""What is left out changes nothing beyond its tolerance; one place decides."""

import numpy as np
import pytest

from knitsim.benchmark.skipping import measure
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.whole_test import there_and_back
from knitsim.stages import skipping
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.stages.laws import ledger_laws
from knitsim.stages.needs import SKIPS, skips_of, solves_recovery, stores_fibres
from knitsim.study.study import load_study


@pytest.fixture(scope="module")
def cotton():
    return load_study("config").fabrics["cotton"]


@pytest.mark.parametrize("what", SKIPS)
def test_a_skip_changes_no_more_than_its_tolerance(cotton, what):
    measured = skipping.MEASURES[what](cotton, settings_of(cotton).resolution)
    assert measured.within, measured
    assert 0.0 < measured.tolerance <= (5e-3 if what == "full cell" else 5e-6)
    assert measured.what == what


def test_the_table_names_every_skip_of_the_scene(cotton, monkeypatch):
    calls = []

    def fake(what):
        def call(fabric, resolution):
            calls.append(what)
            return measure(what, "nothing", lambda: [1.0], lambda: [1.0], 1e-6)

        return call

    monkeypatch.setattr(skipping, "MEASURES", {what: fake(what) for what in SKIPS})
    rows = skipping.run([cotton, cotton])
    assert all(set(row) == {*skipping.COLUMNS, *skipping.TIMES} for row in rows)
    skips = skips_of(cotton.scene)
    # Each is measured once, and its row names all tests and conditions that make it.
    assert calls == [row["skipped"] for row in rows] == list(dict.fromkeys(s.what for s in skips))
    named = {row["skipped"]: row["tests"] for row in rows}
    assert all(s.test in named[s.what] and s.condition in named[s.what] for s in skips)
    assert named["friction at zero coefficient"] == (
        "equilibrium_tension (frictionless, held); equilibrium_bending (frictionless, held)"
    )


def test_needs(cotton):
    scene = cotton.scene
    assert stores_fibres(["centreline", "fibres"]) and not stores_fibres(["centreline"])
    assert solves_recovery({"recovery": True, "friction": True})
    assert not solves_recovery({"recovery": True, "friction": False})
    named = {(s.test, s.condition, s.what) for s in skips_of(scene)}
    assert ("equilibrium_tension", "frictionless", "friction at zero coefficient") in named
    assert ("equilibrium_tension", "friction", "friction at zero coefficient") not in named
    assert ("equilibrium_tension", "", "full cell") in named
    assert ("equilibrium_shear", "", "full cell") in named
    whole = cotton.with_value("scene.equilibrium_rest.cell", "full").scene
    assert "full cell" not in {skip.what for skip in skips_of(whole)}


def test_way_back_without_friction_is_the_way_there(cotton):
    """As the solver itself goes back, to its tolerance; of two cycles as of one."""
    relaxed = relax(solver_fabric(cotton, ledger_laws(cotton.yarn)["continuous"]))
    strains = [0.1, 0.2, 0.3]
    solved = tensile(relaxed, "course", strains, recovery=True, cycles=2)
    read = there_and_back(tensile(relaxed, "course", strains), 2)
    assert read.steps == solved.steps == 12
    for name in ("phase", "cycle", "status"):
        assert np.array_equal(getattr(read, name), getattr(solved, name))
    force = np.abs(solved.force_per_loop).max()
    assert read.strain == pytest.approx(solved.strain, abs=1e-6)
    assert read.force_per_loop == pytest.approx(solved.force_per_loop, abs=1e-5 * force)
    assert read.force_per_loop[[5, 11]].tolist() == [0.0, 0.0]
    whole = solved.energy.sum(1)
    assert read.energy.sum(1) == pytest.approx(whole, rel=1e-6)
    assert read.y == pytest.approx(solved.y, abs=1e-4 * cotton.yarn["diameter"])
    stopped = read.replaced(stop_reason="here")
    assert there_and_back(stopped) is stopped


def test_measured_difference():
    same = measure("x", "y", lambda: [1.0, 2.0], lambda: [1.0, 2.0 + 4e-6], 1e-6)
    assert same.difference == pytest.approx(2e-6, rel=1e-5)
    assert not same.within
    assert same.saved == same.without_skip - same.with_skip
    # A test that ended early, or gave no number, is not the same result.
    assert measure("x", "y", lambda: [1.0], lambda: [1.0, 2.0], 1.0).difference == np.inf
    assert not measure("x", "y", lambda: [np.nan], lambda: [1.0], 1.0).within

"""Sweeps: which fabrics, what stands in the dataset, failures, going on, processes."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import knitsim as ks
from knitsim.errors import InputError
from knitsim.library import sweep as module
from knitsim.library.design import design_of


@pytest.fixture(scope="module")
def fabric():
    yarn = ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3)
    return ks.Fabric(yarn, loop_length_mm=2.9).with_rest(points=48)


TESTS = [
    ks.Pull("course", to_strain=0.1, recovery=True, states=4),
    ks.Bend("wale", states=3, friction=False),
]


@pytest.fixture(scope="module")
def many(fabric):
    return ks.sweep(
        fabric,
        tests=TESTS,
        loop_length_mm=[2.8, 0.5, 3.0],
        friction=[0.1, 0.3],
        processes=1,
        progress=False,
    )


def test_each_row_is_that_fabric_alone(fabric, many):
    assert many.sizes["fabric"] == 6 and many["friction"].dims == ("fabric",)
    at = {"loop_length_mm": 3.0, "yarn.friction": 0.3}
    row = many.isel(
        fabric=int(np.flatnonzero((many.loop_length_mm == 3.0) & (many.friction == 0.3))[0])
    )
    rest = ks.relax(fabric.with_values(at))
    assert float(row["kc"]) == rest.kc and float(row["wale_spacing"]) == rest.wale_spacing
    pull, bent = (test.run(rest) for test in TESTS)
    first = row.isel(test=0)
    held = np.isfinite(first["strain"].values)
    np.testing.assert_array_equal(first["strain"].values[held], pull.strain)
    np.testing.assert_array_equal(first["force_per_width"].values[held], pull.force_per_width)
    assert first["phase"].values[held].tolist() == pull.to_dataset()["phase"].values.tolist()
    second = row.isel(test=1)["moment_per_width"].values
    np.testing.assert_array_equal(second[np.isfinite(second)], bent.moment_per_width)
    found = ks.kes(bent)["B"]
    cell = row["parameter_value"].sel(kes_parameter="B").values
    assert np.isnan(cell[0]) and cell[1] == found.value
    assert str(row["value_units"].sel(kes_parameter="B").values) == found.units


def test_a_fabric_that_fails_is_a_row_with_its_reason(many):
    short = many.loop_length_mm.values == 0.5
    assert all(
        "computed to work" in why or "diameters of its yarn" in why
        for why in many["reason"].values[short]
    )
    assert (many["reason"].values[~short] == "").all()
    assert np.isnan(many["kc"].values[short]).all() and np.isfinite(many["kc"].values[~short]).all()
    assert many["loop_length_mm"].attrs["units"] == "mm" and many.attrs["kind"] == "sweep"


def test_processes_give_the_same(fabric, many):
    again = ks.sweep(
        fabric,
        tests=TESTS,
        loop_length_mm=[2.8, 0.5, 3.0],
        friction=[0.1, 0.3],
        processes=2,
        progress=False,
    )
    xr.testing.assert_identical(again, many)


def test_a_sweep_that_was_stopped_goes_on(fabric, tmp_path, monkeypatch, capsys):
    path = tmp_path / "sweep.nc"
    asked = {"loop_length_mm": [2.7, 2.8, 2.9], "file": path, "processes": 1}
    done = []

    def stops(*arguments):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(arguments)
        return row(*arguments)

    row = module._row
    monkeypatch.setattr(module, "_row", stops)
    with pytest.raises(KeyboardInterrupt):
        ks.sweep(fabric, **asked)
    assert not path.exists()
    part = path.with_name("sweep.nc.part")
    lines = part.read_text().splitlines()
    assert len(lines) == 3
    part.write_text("\n".join([*lines, '[2, {"rest": {"kc"']))  # cut off in the midst of a line
    solved = []
    monkeypatch.setattr(module, "_row", lambda *a: solved.append(a) or row(*a))
    whole = ks.sweep(fabric, **asked)
    assert len(solved) == 1 and path.exists() and not part.exists()
    monkeypatch.setattr(module, "_row", row)
    fresh = ks.sweep(fabric, loop_length_mm=[2.7, 2.8, 2.9], processes=1, progress=False)
    xr.testing.assert_identical(whole, fresh)
    # A finished one is read, another one is made anew.
    monkeypatch.setattr(module, "_row", stops)
    xr.testing.assert_equal(ks.sweep(fabric, **asked), fresh)
    assert "3 of 3 fabrics" in capsys.readouterr().err
    first = path.read_bytes()
    monkeypatch.setattr(module, "_row", row)
    path.unlink()
    ks.sweep(fabric, **asked)
    assert path.read_bytes() == first
    with xr.open_dataset(path) as stored:
        assert json.loads(stored.attrs["configuration"])["fabric"]["name"] == "fabric"


def test_tables(tmp_path):
    path = tmp_path / "fabrics.csv"
    path.write_text(
        "\ufefffabric;count;loop_length_mm;wales_per_cm\nfine;40/1;2,6;15\ncoarse;2/28 Nm;4,1;\n"
    )
    design = design_of({}, path, None, 0)
    assert design.names == ("fine", "coarse")
    assert design.changes[0] == {"yarn.count": "40/1", "loop_length_mm": 2.6, "wales_per_cm": 15}
    assert design.changes[1] == {"yarn.count": "2/28 Nm", "loop_length_mm": 4.1}
    frame = pd.DataFrame({"friction": [0.1, 0.2]})
    assert design_of({}, frame, None, 0).changes == ({"yarn.friction": 0.1}, {"yarn.friction": 0.2})


def test_a_latin_hypercube_has_one_fabric_in_every_layer():
    design = design_of({"loop_length_mm": (2, 4), "friction": (0.1, 0.3)}, None, 50, 7)
    for path, low, high in (("loop_length_mm", 2, 4), ("yarn.friction", 0.1, 0.3)):
        layer = [int((one[path] - low) / (high - low) * 50) for one in design.changes]
        assert sorted(layer) == list(range(50))
    assert (
        design.changes
        == design_of({"loop_length_mm": (2, 4), "friction": (0.1, 0.3)}, None, 50, 7).changes
    )
    assert (
        design.changes
        != design_of({"loop_length_mm": (2, 4), "friction": (0.1, 0.3)}, None, 50, 8).changes
    )


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({}, "needs lists of values"),
        ({"loop_lenght_mm": [3]}, "is no key of a fabric or yarn; the nearest is loop_length_mm"),
        ({"loop_length_mm": 3}, "must be a list of values"),
        ({"loop_length_mm": []}, "must hold at least one value"),
        ({"loop_length_mm": [2, 3, 4], "samples": 5}, "must be lowest and highest"),
        ({"loop_length_mm": [2, 3], "samples": 0}, "must be a whole number from 1"),
        ({"loop_length_mm": [2, 3], "tests": ["pull"]}, "must be Pull, Bend, Shear or Biaxial"),
        ({"table": "nowhere.csv"}, "no such file"),
        ({"table": "x.csv", "friction": [0.1]}, "stands alone"),
    ],
)  # fmt: skip
def test_refused(fabric, asked, words):
    with pytest.raises(InputError, match=words):
        ks.sweep(fabric, **asked)

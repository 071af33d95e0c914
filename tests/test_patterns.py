"""Patterns of knit and purl: what must hold exactly, whatever the solver says."""

from dataclasses import replace

import numpy as np
import pytest

from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.fold import lowest_mode
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.model import build_model, carried
from knitsim.equilibrium.pattern import Pattern
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax, settle, start_from
from knitsim.equilibrium.solve import gradient_at
from knitsim.errors import InputError
from knitsim.yarn.law import paper_k3

COTTON = dict(
    wale_spacing=None, course_spacing=None, loop_length=5.56e-3, diameter=0.2793e-3,
    bending_rigidity=5e-9, law=paper_k3(continuous=True),
)  # fmt: skip
FULL = Resolution(cell="full")
DIRECTIONS = ("course", "wale")


@pytest.fixture(scope="module")
def rest():
    """Fabrics at rest by pattern, solved once."""
    found = {}

    def of(pattern, resolution=None):
        if (pattern, resolution) not in found:
            found[pattern, resolution] = relax(Fabric(**COTTON, pattern=pattern), resolution)
        return found[pattern, resolution]

    return of


@pytest.fixture(scope="module")
def jersey_moment(rest):
    return {d: bend(rest("jersey"), d, [0.0]).flat_moment for d in DIRECTIONS}


def test_all_purl_is_jersey_from_the_back(rest, jersey_moment):
    jersey, purl = rest("jersey"), rest("p")
    np.testing.assert_allclose(purl.centreline, jersey.centreline * [1, 1, -1], rtol=0, atol=1e-15)
    for direction, moment in jersey_moment.items():
        assert abs(moment) > 1e-3
        assert bend(purl, direction, [0.0]).flat_moment == pytest.approx(-moment, rel=1e-12)


def test_names_and_rows_of_the_same_pattern_are_one():
    assert Pattern.of("pk") != Pattern.of("kp")
    assert Pattern.of("kpkp") == Pattern.of("kp") == Pattern.of(["kp", "kp"])
    assert Pattern.of("kk/kk") == Pattern.of("jersey")


@pytest.mark.parametrize(("one", "other"), [("kp", "pk"), ("k/p", "p/k"), ("kp/pk", "pk/kp")])
def test_where_a_pattern_begins_does_not_matter(rest, one, other):
    first, second = rest(one), rest(other)
    assert second.energy.sum() == pytest.approx(first.energy.sum(), rel=1e-9)
    assert second.wale_spacing == pytest.approx(first.wale_spacing, rel=1e-6)
    assert second.course_spacing == pytest.approx(first.course_spacing, rel=1e-6)


def test_jersey_in_the_general_cell_is_the_quarter(rest):
    for direction in DIRECTIONS:
        quarter, whole = (
            tensile(state, direction, [0.1, 0.3]).force_per_loop
            for state in (rest("jersey"), rest("jersey", FULL))
        )
        np.testing.assert_allclose(whole, quarter, rtol=1e-7)


def test_two_periods_in_a_cell_are_the_pattern(rest):
    twice = rest("garter", Resolution(cell="full", wales=2))
    np.testing.assert_allclose(twice.energy, rest("garter").energy, rtol=1e-9, atol=1e-18)


def disturbed(state, part=0.02):
    """The state found again from a start without any symmetry."""
    model, d = state.model, state.model.fabric.diameter
    noise = np.random.default_rng(1).standard_normal(model.cell.count)
    y = state.y.copy()
    y[: model.cell.count] += part * d * noise
    return settle(model, y, model.free(0, 3))


@pytest.mark.parametrize(("pattern", "limit"), [("garter", 1e-6), ("rib_1x1", 1e-4)])
def test_face_and_back_alike_do_not_curl(rest, jersey_moment, pattern, limit):
    """In the full cell, from a start that no symmetry helps.

    Of garter 4e-8 of jersey's moment is left, the solver's tolerance; of rib 2e-5: points at which contact
    is read feel a little of the sliding that the cell holds at its first loop.
    """
    state = disturbed(rest(pattern, FULL))
    for direction, moment in jersey_moment.items():
        assert abs(bend(state, direction, [0.0]).flat_moment) < limit * abs(moment)


@pytest.mark.parametrize("pattern", ["garter", "seed"])
def test_the_symmetric_cell_does_not_curl_at_all(rest, jersey_moment, pattern):
    for direction, moment in jersey_moment.items():
        assert abs(bend(rest(pattern), direction, [0.0]).flat_moment) < 1e-9 * abs(moment)


def full_energy(state):
    """Energy per loop of a state in the cell without symmetry, before anything moves."""
    one = state.model
    full = build_model(
        one.fabric, Resolution(one.cell.points, one.cell.contacts), "none", sparse=False
    )
    y, work = carried(full, one, state.y), new_work(full.scene)
    energy_of(full.scene, y, pairs_at(full.scene, y, 0.0, work), (), np.int64(0), work)
    return work.terms.sum() / full.loops, full, y


@pytest.mark.parametrize("pattern", ["garter", "rib_1x1", "seed", "rib_2x2"])
def test_what_symmetry_skips_is_there_in_the_full_cell(rest, pattern):
    """Energy of the whole cell, yarns slid to where it holds them: to 1e-5, for contact points slide too."""
    state = rest(pattern)
    energy, full, y = full_energy(state)
    assert energy == pytest.approx(state.energy.sum(), rel=1e-5)
    # Nothing falls from there: the state is stable, or as good as.
    assert lowest_mode(full, y)[0] > -1e-8


@pytest.mark.parametrize(
    "pattern", ["garter", "rib_1x1", "rib_2x2", "seed", "double_seed", "kkp/kpk"]
)
def test_images_reach_as_far_with_symmetry_as_without(pattern):
    """Loops pushed into each other, so that wales far apart touch: the energy of the whole cell."""
    fabric = Fabric(**COTTON, pattern=pattern)
    one, full = build_model(fabric), build_model(fabric, kept="none", sparse=False)
    y = start_from(one, 0.3e-3, 0.3e-3, 1.5e-3, 1.0e-3)
    y[one.lattice : one.lattice + 4] *= 0.6
    terms = []
    for model, at in ((one, y), (full, carried(full, one, y))):
        work = new_work(model.scene)
        energy_of(model.scene, at, pairs_at(model.scene, at, 0.0, work), (), np.int64(0), work)
        terms.append(work.terms[2] / model.loops)
    assert terms[0] == pytest.approx(terms[1], rel=1e-9)


def test_a_rib_folds_and_jersey_does_not(rest):
    rib, jersey = rest("rib_1x1"), rest("jersey")
    assert not jersey.passed and not rest("garter").passed
    (flat,) = rib.passed
    assert rib.energy.sum() < 0.98 * flat[2]
    assert rib.wale_spacing < 0.6 * jersey.wale_spacing
    assert np.ptp(rib.centrelines[..., 2]) > 2.0 * np.ptp(jersey.centrelines[..., 2])


def test_what_knitters_expect(rest):
    at = {
        name: tensile(rest(name), "course", [0.5]).force_per_width[0]
        for name in ("jersey", "rib_1x1")
    }
    assert at["rib_1x1"] < 0.6 * at["jersey"]
    along = {
        name: tensile(rest(name), "wale", [0.3]).force_per_width[0] for name in ("jersey", "garter")
    }
    assert along["garter"] < 0.2 * along["jersey"]
    assert rest("garter").course_spacing < 0.75 * rest("jersey").course_spacing


@pytest.mark.parametrize("pattern", ["rib_1x1", "seed"])
def test_mirror_images_are_mirrored(rest, pattern):
    rows = tuple(row[::-1] for row in Pattern.of(pattern).rows)
    mirrored = rest("/".join(rows))
    assert mirrored.energy.sum() == pytest.approx(rest(pattern).energy.sum(), rel=1e-9)


def test_courses_of_unequal_loop_length(rest):
    fabric = replace(rest("garter").model.fabric, course_lengths=(1.0, 1.2))
    found = relax(fabric)
    length = np.linalg.norm(np.diff(found.centrelines, axis=1), axis=-1).sum(-1)
    assert length[1] / length[0] == pytest.approx(1.2, rel=2e-3)
    with pytest.raises(InputError, match="2 courses of the pattern"):
        replace(fabric, course_lengths=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("stated", ["kx", "", "k/kp", "k" * 9, ["k"] * 9, 3])
def test_what_is_no_pattern_is_refused(stated):
    with pytest.raises(InputError, match="pattern"):
        Pattern.of(stated)


@pytest.mark.parametrize("pattern", ["kp", "kkp/kpk"])
def test_the_held_loop_of_a_set_is_in_equilibrium_in_the_full_cell(pattern):
    stated = {"wale_spacing": 1.6e-3, "course_spacing": 0.9e-3, "set_fraction": 0.6}
    set_ = Fabric(**COTTON | stated, pattern=pattern)
    model = relax(set_, Resolution(cell="full")).model
    bare = build_model(set_, model.resolution, model.cell.symmetries, model.sparse, True)
    left, _ = gradient_at(bare, bare.scene, model.held)
    assert np.abs(left[: bare.lattice]).max() < 1e-2 * set_.bending_rigidity / set_.loop_length**2

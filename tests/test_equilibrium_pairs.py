"""Lists of touching pairs: what a list covers, by every pair there is, and that no energy lacks one."""

import numpy as np
import pytest

from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.kernels import newton
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.newton import CONVERGED
from knitsim.equilibrium.kernels.pairs import (
    Listed,
    covers,
    expand,
    find_pairs,
    flat_distance,
    pairs_at,
    passes,
    place_frames,
    place_points,
)
from knitsim.equilibrium.kernels.records import Bend
from knitsim.equilibrium.large import newton as large
from knitsim.equilibrium.large.linear import new_sparse_work, sparse_pairs
from knitsim.equilibrium.model import build_model, carried
from knitsim.equilibrium.relax import relax
from knitsim.yarn.law import paper_k3

COTTON = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
D = COTTON.diameter


@pytest.fixture(scope="module")
def cotton():
    return relax(COTTON, Resolution(24, 160))


def model_and_state(cotton, kind):
    """A model with symmetries or of two loops, and its state at rest."""
    if kind == "symmetric":
        return cotton.model, cotton.y
    model = build_model(COTTON, Resolution(24, 160, "full", 2, 1), sparse=kind == "sparse")
    return model, carried(model, cotton.model, cotton.y)


def touching(scene, y, work):
    """All pairs (i, k, g) with i <= k whose cells touch in space, brute force.

    Somewhere in a cell the squared distance, expanded by the numbers of the two points, is below d^2.
    """
    lattice = expand(scene.map, y, work.x)
    place_frames(scene.touch, work.x, work.points)
    touch, found = scene.touch, set()
    own = work.points.reshape(-1, 3, 3)  # place and derivatives
    bent = scene.bend.direction if scene.bend else 0
    kappa = lattice[4] / lattice[3 * bent] if scene.bend else 0.0
    small = 0.05

    def square(p, o):
        d = p[:, None] - o
        arc, axis = d[..., bent], d[..., 1 - bent]
        if not kappa:
            return (d**2).sum(-1)
        r, q = 1.0 / kappa + p[:, None, 2], 1.0 / kappa + o[None, :, 2]
        return r**2 + q**2 - 2.0 * r * q * np.cos(kappa * arc) + axis**2

    def along(points, s):
        return points[:, 0] + s * points[:, 1] + 0.5 * s**2 * points[:, 2]

    for g, image in enumerate(touch.images):
        other = own * image.sign
        other[:, 0, :2] += image.steps @ lattice[:4].reshape(2, 2)
        p, o = own[:, 0], other[:, 0]
        here, least = square(p, o), 0.0
        first = [square(along(own, s), o) for s in (small, -small)]
        second = [square(p, along(other, s)) for s in (small, -small)]
        for up, down in (first, second):
            least += (up - 2.0 * here + down) / small**2 / 24.0 - np.abs(up - down) / (4.0 * small)
        arc = (p[:, None] - o)[..., bent]
        near = (here + least < D**2) & (np.abs(kappa * arc) < np.pi)
        apart = np.abs(
            touch.points.arc[:, None] - image.arc_sign * touch.points.arc - image.arc_shift
        )
        alike = touch.points.yarn[:, None] == image.turn * touch.points.yarn + image.up
        near &= ~(alike & (apart < touch.exclude))
        found |= {(i, k, g) for i, k in np.argwhere(near).tolist() if i <= k}
    return found


def missing_from(listed, scene, y, work):
    """How many of the pairs that touch at y are not listed."""
    known = set(map(tuple, listed.pairs.tolist()))
    back = scene.touch.images.inverse
    # Of a point with its own image, one of the operation and its inverse stands for both.
    known |= {(i, k, int(back[g])) for i, k, g in known if i == k}
    return len(touching(scene, y, work) - known)


@pytest.mark.parametrize(
    ("kind", "bent"),
    [("symmetric", None)]
    + [
        pytest.param(*kind, marks=pytest.mark.slow)
        for kind in [
            ("symmetric", 1),
            *(("dense", bent) for bent in (None, 0, 1)),
            ("sparse", None),
        ]
    ],
)
def test_a_list_that_covers_a_shape_has_all_that_touch_in_it(cotton, kind, bent):
    model, rest = model_and_state(cotton, kind)
    scene = model.scene if bent is None else model.scene._replace(bend=Bend(bent))
    work, rng = new_work(scene), np.random.default_rng(7)
    said = lacked = 0
    trials = 120 if kind == "symmetric" else 40
    for trial in range(trials):
        center, skin = rest.copy(), D * rng.uniform(0.0, 0.4)
        center[: model.lattice] += 0.05 * D * rng.standard_normal(model.lattice)
        at = model.lattice + 3 * (bent or 0)
        if bent is not None:
            center[-1] = rng.uniform(-700.0, 700.0) * center[at]
        if kind == "sparse":
            listed = sparse_pairs(scene, center, skin, new_sparse_work(model.cell, scene))
        else:
            listed = pairs_at(scene, center, skin, work)
        assert covers(scene, listed, center, work)
        y = center.copy()
        size = skin * 10.0 ** rng.uniform(-2.0, 1.0)
        y[: model.lattice] += 0.2 * size * rng.standard_normal(model.lattice)
        y[model.lattice] += 0.2 * size * rng.standard_normal()
        y[model.lattice + 3] += 0.2 * size * rng.standard_normal()
        if bent is not None:
            y[-1] = (center[-1] / center[at] + 300.0 * rng.standard_normal() * (trial % 2)) * y[at]
        lacks, known = missing_from(listed, scene, y, work), covers(scene, listed, y, work)
        assert not (known and lacks)
        said, lacked = said + known, lacked + (lacks > 0)
    # Neither answer is given throughout.
    assert said > trials / 6 and lacked > trials / 12


@pytest.mark.parametrize("kappa", [0.0, 150.0, -400.0, 700.0])
def test_places_that_touch_are_no_further_apart_in_flat_coordinates(cotton, kappa):
    """The bound is reached by places on the inner side of the bent fabric."""
    scene, y = cotton.model.scene._replace(bend=Bend(0)), cotton.y.copy()
    y[-1] = kappa * y[cotton.model.lattice]
    work = new_work(scene)
    lattice = expand(scene.map, y, work.x)
    thick = np.abs(work.x[:, 2]).max()
    bound = flat_distance(scene, lattice, D, work.x)
    z = -np.sign(kappa) * thick
    # Two places at that height whose chord is a diameter.
    angle = 2.0 * np.arcsin(0.5 * D / (1.0 / kappa + z)) if kappa else 0.0
    apart = abs(angle / kappa) if kappa else D
    assert apart <= bound <= (1.0 + 1e-12) * apart


@pytest.mark.parametrize(
    ("kind", "bent"), [("symmetric", None), ("symmetric", 1), ("sparse", None)]
)
def test_no_energy_of_a_search_lacks_a_pair(cotton, kind, bent, monkeypatch):
    """Every energy that the search for a minimum takes, against that of all pairs."""
    model, rest = model_and_state(cotton, kind)
    scene = model.scene if bent is None else model.scene._replace(bend=Bend(bent))
    fresh, asked = new_work(scene), []

    def checked(scene, y, listed, slip, order, work):
        lattice = expand(scene.map, y, fresh.x)
        place_points(scene.touch, fresh.x, fresh.points)
        every = Listed(
            *find_pairs(scene.touch, fresh.points, lattice, 3.0 * D), y, np.full(1, 3 * D)
        )
        whole = energy_of(scene, y, every, slip, np.int64(0), fresh)
        energy = energy_of(scene, y, listed, slip, order, work)
        assert energy == pytest.approx(whole, rel=1e-12)
        asked.append(len(every.pairs) > len(listed.pairs))
        return energy

    module = large if kind == "sparse" else newton
    monkeypatch.setattr(module, "energy_of", checked)
    renewed = 0
    for seed in range(4):
        rng, y = np.random.default_rng(seed), rest.copy()
        y[: model.lattice] += 0.1 * D * rng.standard_normal(model.lattice)
        y[model.lattice + 3] *= 1.0 + 0.1 * rng.standard_normal()
        if bent is not None:
            y[-1] = 300.0 * y[model.lattice + 3]
        free, control = model.free(0), model.control._replace(limit=100)
        if kind == "sparse":
            work = new_sparse_work(model.cell, scene)
            listed = first = sparse_pairs(scene, y, control.skin, work)
            status, _, _, listed = large.sparse_minimise(
                scene, y, free, listed, (), control, False, work
            )
        else:
            work = new_work(scene)
            listed = first = pairs_at(scene, y, control.skin, work)
            status, _, _, listed = newton.minimise.py_func(
                scene, y, free, listed, (), control, False, work
            )
        assert status == CONVERGED
        renewed += listed is not first
    assert renewed > 0 and all(asked) and len(asked) > 20


def test_ways_on_which_nothing_can_meet_need_no_search():
    relaxed = relax(Fabric(None, None, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(True), pattern="seed"))
    scene, y = relaxed.model.scene, relaxed.y
    rng, seen = np.random.default_rng(5), []
    for size in (0.01, 0.1, 0.3, 1.0, 2.0):
        for _ in range(4):
            after = y.copy()
            free = relaxed.model.free(0, 3)
            after[free] += size * relaxed.model.fabric.diameter * rng.uniform(-1.0, 1.0, len(free))
            work = new_work(scene)
            energy_of(scene, after, pairs_at(scene, after, 0.0, work), (), np.int64(0), work)
            quick = passes(scene, y, after, work)
            # As if two places had met: every pair is looked at.
            work.closest[0] = 0.0
            assert quick == passes(scene, y, after, work)
            seen.append(quick)
    assert any(seen) and not all(seen)

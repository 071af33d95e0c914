"""Contact averaged over cells against a fine grid; friction told anew against many small steps."""

import dataclasses
import itertools

import numpy as np
import pytest
from judge_tools import BARRIER, CORE, D, cell_of, placed, sized, turning

from knitsim.verification.judge.contact import cell_mean
from knitsim.verification.judge.friction import Friction
from knitsim.verification.judge.measure import Energy

# ---------------------------------------------------------------- contact


def cell_by_cell(given, control, lattice, curvature, bent, yarns, at, image):
    """Mean energy over the cell of two places, by brute force, and the force between them (J/m2, N/m2)."""
    h, fine = given.points / given.contacts, 400

    def square(u, v):
        ends = [
            placed(given, control, lattice, curvature, bent, np.atleast_1d(x), yarn, of)
            for x, yarn, of in ((u, yarns[0], (0, 0)), (v, yarns[1], image))
        ]
        return ((ends[0] - ends[1]) ** 2).sum(1)[0]

    s, u, v = 1e-2 * h, *at
    q, along, other = (
        [square(u + i * s, v + k * s) for i, k in way]
        for way in (((0, 0),), ((-1, 0), (0, 0), (1, 0)), ((0, -1), (0, 0), (0, 1)))
    )
    a, b = ((w[2] - w[0]) / (2 * s) * h for w in (along, other))
    lift = sum((w[2] - 2 * w[1] + w[0]) / s**2 * h * h for w in (along, other)) / 24.0
    x = (np.arange(fine) + 0.5) / fine - 0.5

    def energy(q):
        far = np.sqrt(q + lift + a * x[:, None] + b * x)
        v, _ = given.contact.at(np.minimum(far, given.diameter), given.diameter)
        return v.mean()

    step = 1e-3 * q[0]
    slope = (energy(q[0] + step) - energy(q[0] - step)) / (2 * step)
    return energy(q[0]), -2.0 * np.sqrt(q[0]) * slope


@pytest.mark.parametrize(("curvature", "bent"), [(0.0, 0), (400.0, 0), (-250.0, 1)])
def test_contact_averaged_over_cells(rough, curvature, bent):
    """Energy and force of pairs in space by the definition: a grid over each cell, the square of the distance
    linear in it."""
    given = dataclasses.replace(BARRIER, contacts=160)
    energy = Energy(given, 3, 160, True, bent)
    shape = energy.shape(*rough, curvature)
    found, force = energy.energies(shape), energy.press(shape)
    area, u = energy.length**2, (np.arange(160) + 0.5) * 12 / 160
    # The rough loop runs through itself: only what a yarn can be pressed to.
    real = (shape.distance > 0.65 * D) & (found > 0.0)
    order = np.flatnonzero(real)[np.argsort(-found[real])]
    found, force = found * real, force * real
    for j in order[:: len(order) // 12]:
        at = u[shape.i[j]], u[shape.k[j]]
        exact = cell_by_cell(
            given, *energy_args(shape), curvature, bent, (0, 0), at, shape.image[j]
        )
        assert found[j] / area == pytest.approx(exact[0], rel=1e-3, abs=1e-5 * found.max() / area)
        assert force[j] / area == pytest.approx(exact[1], rel=5e-3, abs=1e-4 * force.max() / area)


def energy_args(shape):
    return shape.control, shape.lattice


def test_averages_of_a_core_law_take_the_distance_to_be_linear():
    law, q = CORE.contact, (0.5 * D) ** 2
    a, b = 0.1 * D * D, -0.05 * D * D
    x = (np.arange(600) + 0.5) / 600 - 0.5
    far = 0.5 * D + (a * x[:, None] + b * x) / (2 * 0.5 * D)
    given = dataclasses.replace(CORE, contact=dataclasses.replace(law, core=0.1 * D))
    v, _ = given.contact.at(np.minimum(far, D), D)
    args = (np.array([value]) for value in (q, a, b))
    assert cell_mean(given, *args) == pytest.approx([v.mean()], rel=1e-4)
    # No corner comes nearer the core than half way, however wide the cell.
    wide = cell_mean(given, *(np.array([value]) for value in (q, 27 * a, b)))
    assert np.isfinite(wide).all() and wide > v.mean()


# ---------------------------------------------------------------- friction

WAY = 5e-7  # m: of the control points in a step


def moved(energy, rough, parts, seed=5):
    """Shapes on a way of all that is free: at these parts of it."""
    control, lattice = cell_of(energy.given, rough)
    random = np.random.default_rng(seed)
    way = WAY * random.standard_normal(control.shape)
    along = WAY * np.array([1.0, 0.0, 0.0, -1.0])
    return way, along, [
        energy.shape(control + p * way, lattice + p * along, 300.0 + 1e-3 * p) for p in parts
    ]  # fmt: skip


def fine_pair(given, gaps, shell, press):
    """Elongation, energy lost and held of one pair by two hundred small steps along its straight way."""
    held, lost, normal, parts = np.zeros(3), 0.0, gaps[0] / np.linalg.norm(gaps[0]), 200
    ways = np.linspace(gaps[0], gaps[1], parts + 1)
    for n in range(parts):
        ahead = ways[n + 1] / np.linalg.norm(ways[n + 1])
        leant = held @ ahead / (1.0 + normal @ ahead)
        held = held - leant * (normal + ahead) + ways[n + 1] - ways[n]
        held -= held @ ahead * ahead
        part = (n + 1) / parts
        limit = given.friction * ((1.0 - part) * press[0] + part * press[1])
        size = np.linalg.norm(held)
        if shell * size > limit:
            lost += limit * (size - limit / shell)
            held *= limit / (shell * size)
        normal = ahead
    return held, lost, 0.5 * shell * held @ held


@pytest.mark.parametrize(("friction", "ratio"), [(0.3, 1.0), (0.05, 3.0), (0.6, 0.3)])
def test_friction_of_a_step_against_many_small_ones(rough, friction, ratio):
    """Springs that stick, slide and come loose, pair by pair; what acts does their work."""
    given = dataclasses.replace(
        sized(BARRIER, 1, 2), contacts=160, friction=friction, tangential_ratio=ratio
    )
    energy = Energy(given, 3, 160, True, 1)
    way, along, shapes = moved(energy, rough, (0.0, 1.0, 1.0 + 1e-6))
    rub = Friction(energy)
    first = rub.step(*shapes[:2], rub.begun(shapes[0]))
    gap = 0.1 * D
    shell = ratio * 2e3 / gap**2 * (1 - 0.9**2) ** 2 / 0.9**2 * (given.loop_length / 160) ** 2
    assert rub.shell == pytest.approx(shell, rel=1e-9)
    at = shapes[1].i, shapes[1].k, shapes[1].image
    press = [energy.press(s, at) for s in shapes[:2]]
    gaps = [energy.gaps(s, *at) for s in shapes[:2]]
    lost = held = 0.0
    kept = {tuple(p): h for p, h in zip(first.memory.pairs, first.memory.held, strict=True)}
    stuck = 0
    for j in range(len(at[0])):
        exact = fine_pair(given, [g[j] for g in gaps], rub.shell, [p[j] for p in press])
        lost, held = lost + exact[1], held + exact[2]
        stuck += exact[1] == 0.0 and exact[2] > 0.0
        own = kept.get((at[0][j], at[1][j], *at[2][j]), np.zeros(3))
        assert own == pytest.approx(exact[0], abs=0.02 * WAY)
    assert 0 < stuck
    assert first.lost * 2 == pytest.approx(lost, rel=0.03, abs=1e-6 * held)
    assert first.held * 2 == pytest.approx(held, rel=0.01)
    # On a little further all that slides does the work of its limit: the energy changes by what acts.
    second = rub.step(*shapes[1:], first.memory)
    work = (first.acting[0] * way).sum() / 2 + first.acting[1] @ along + first.acting[2] * 1e-3
    change = second.lost + second.held - first.held
    assert change / 1e-6 == pytest.approx(work, rel=1e-3)
    assert work > 0.0
    for a, b in zip(first.acting, rub.most(shapes[1]), strict=True):
        assert (np.abs(a) <= b * (1 + 1e-9)).all()


def test_what_lags_in_the_yarn(rough):
    given = dataclasses.replace(BARRIER, friction=0.0, bending_hysteresis=1e-7, stuck_ratio=1e3)
    energy = Energy(given, 3, 40, True, 1)
    _, _, shapes = moved(energy, rough, (0.0, 1.0))
    rub = Friction(energy)
    found = rub.step(*shapes, rub.begun(shapes[0]))
    u = (np.arange(12 * 400) + 0.5) / 400
    turns = [turning(given, s.control, s.lattice, s.curvature, 1, u, 0)[2] for s in shapes]
    change = np.linalg.norm(turns[0], axis=1)
    change = (turns[0] * (turns[1] - turns[0])).sum(1) / change
    stuck, k = 1e-7 / (1e3 * 5e-9), 1e3 * 5e-9
    slid = np.maximum(np.abs(change) - stuck, 0.0)
    assert found.lost == pytest.approx(1e-7 * slid.mean() * given.loop_length, rel=0.05)
    held = 0.5 * k * (np.minimum(np.abs(change), stuck) ** 2).mean() * given.loop_length
    assert found.held == pytest.approx(held, rel=0.05)
    assert min(found.lost, found.held) > 0.0
    # Back again, nothing slides until the couple has turned over.
    back = rub.step(shapes[1], shapes[1], found.memory)
    assert back.lost < 1e-9 * found.lost and back.held == pytest.approx(found.held)
    most = rub.most(shapes[1])
    for a, b in zip(found.acting, most, strict=True):
        assert (np.abs(a) <= b * (1 + 1e-9)).all()


def slid_along(turns, most, steps=200):
    """Elastic parts of a turning that goes straight through vectors (n, 3), by small steps."""
    held, axis, found = 0.0, turns[0], [0.0]
    for before, after in itertools.pairwise(turns):
        held *= np.sign(before @ axis)
        axis = before / np.linalg.norm(before)
        for _ in range(steps):
            held = min(max(held + (after - before) @ axis / steps, -most), most)
        found.append(held)
    return found


def test_what_lags_after_ways_there_and_back(rough):
    """Told step by step it is exact; after an unknown way within bounds, which meet where it slides."""
    given = dataclasses.replace(BARRIER, friction=0.0, bending_hysteresis=1e-7)
    energy = Energy(given, 3, 40, True, 1)
    way, along, shapes = moved(energy, rough, (0.0, 1.0, -1.0, -0.5, 0.2, 3.0, 3.0 + 1e-5, -100.0))
    rub, most = Friction(energy), 1e-7 / (20.0 * 5e-9)
    turns = np.array([energy.turn_of(shape)[:, 0].T for shape in shapes])
    exact = np.array([slid_along(turns[:, p], most) for p in range(turns.shape[1])])
    steps, memory = [None], rub.begun(shapes[0])
    for n in range(1, len(shapes)):
        steps.append(rub.step(*shapes[n - 1 : n + 1], memory))
        memory = steps[-1].memory
        assert memory.lag[:, 0] == pytest.approx(np.array([exact[:, n]] * 3), abs=1e-9 * most)
        assert not any(np.any(part) for part in rub.unsure(shapes[n], memory))
    # What acts does the work that is held or lost.
    on_control, on_lattice, couple = steps[6].acting
    work = (on_control * way).sum() + on_lattice @ along + couple * 1e-3
    assert (steps[6].lost + steps[6].held - steps[5].held) / 1e-5 == pytest.approx(work, rel=1e-4)
    # The way there and back between the states 0 and 3 is not known.
    memory = rub.doubted(rub.step(shapes[0], shapes[3], rub.begun(shapes[0])).memory)
    assert (np.abs(memory.lag[0, 0] - exact[:, 3]) > 0.1 * most).any()
    for n in range(4, len(shapes)):
        found = rub.step(*shapes[n - 1 : n + 1], memory)
        memory, unsure = found.memory, rub.unsure(shapes[n], found.memory)
        least, highest = memory.lag[1:, 0] + 1e-9 * most * np.array([[-1.0], [1.0]])
        assert (least <= exact[:, n]).all() and (exact[:, n] <= highest).all()
        for a, b, off in zip(found.acting, steps[n].acting, unsure, strict=True):
            assert (np.abs(a - b) <= off + 1e-9 * np.abs(b).max()).all()
        if n == 4:
            assert (least < highest - most).any() and max(np.max(off) for off in unsure) > 0.0
    assert not any(np.any(off) for off in unsure)


def test_a_fabric_that_only_rolls_up_does_not_rub(rough):
    """Moved along the cylinder, all pairs see each other as before."""
    energy, (control, lattice) = Energy(BARRIER, 3, 160, True, 0), rough
    shapes = [energy.shape(control + [x, 0, 0], lattice, 300.0) for x in (0.0, 0.3e-3)]
    rub = Friction(energy)

    def taken(*ends):
        found = rub.step(*ends, rub.begun(ends[0]))
        return found.lost + found.held

    # Springs hold the square of what little moves.
    still = taken(*shapes)
    assert still < 1e-12 * energy.terms(shapes[0])[2]
    bent = energy.shape(control, lattice, 301.0)
    assert taken(shapes[0], bent) > 1e3 * still

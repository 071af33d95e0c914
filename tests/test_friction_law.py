"""The friction of a place that rubs: memory, books, closed forms, whatever its history."""

import itertools

import numpy as np
import pytest
from oracles import sliders

from knitsim.equilibrium.kernels.friction import (
    MEMORY,
    RUB,
    across,
    ask,
    begin,
    end,
    precedes,
    recall,
    turn,
)
from knitsim.equilibrium.kernels.pairs import CHUNK
from knitsim.jit import blank, njit

STIFFNESS = 2.0


@njit
def follow(rub, memory, apart, places, limits, stiffness, record):
    """Drive one contact through places (n, 3) with its normals along ``apart`` (n, 3).

    record (n, 6): force, held, loss of the step, work so far.
    """
    work = 0.0
    for j in range(1, places.shape[0]):
        for axis in range(3):
            rub.held[axis], rub.facing[axis] = memory.held[axis], memory.facing[axis]
        rub.limit = 0.0
        here = (places[j - 1, 0], places[j - 1, 1], places[j - 1, 2])
        there = (places[j, 0], places[j, 1], places[j, 2])
        before = (apart[j - 1, 0], apart[j - 1, 1], apart[j - 1, 2])
        after = (apart[j, 0], apart[j, 1], apart[j, 2])
        begin(rub, before, here, limits[j - 1], stiffness)
        ask(rub, limits[j])
        turn(rub, after, there, 1.0)
        u, size = across(there, rub.anchor, rub.normal)
        over = min(stiffness, limits[j] / size) if size > 0.0 else 0.0
        for axis in range(3):
            record[j, axis] = over * u[axis]
            change = places[j, axis] - places[j - 1, axis]
            work += 0.5 * (record[j - 1, axis] + record[j, axis]) * change
        record[j, 4], record[j, 3] = end(rub, after, there, memory)
        record[j, 5] = work


def driven(places, limits, stiffness=STIFFNESS):
    """Record (n, 6), as of ``follow``, of two yarns with the vectors ``places`` between them."""
    record = np.zeros((len(places), 6))
    rub, memory = blank(1, RUB)[0], blank(1, MEMORY)[0]
    follow(rub, memory, places, places, limits, stiffness, record)
    return record


def smooth_history(rng, steps, closed):
    """Places (steps + 1, 3) and limits of a contact that turns, opens, closes and slides.

    The normal force is that of a spring over the distance, as a barrier's: it follows from the place.
    """
    t, waves = np.linspace(0.0, 1.0, steps + 1), np.arange(1, 4)
    sine = np.sin(2.0 * np.pi * waves * t[:, None])
    amplitude = rng.standard_normal((3, 3)) * [[0.3], [0.3], [0.15]] / waves
    places = sine @ amplitude.T + [0.0, 0.0, rng.uniform(0.85, 1.0)]
    if not closed:
        places += np.outer(t, [0.2, -0.1, 0.0] * rng.standard_normal(3))
    distance = np.linalg.norm(places, axis=1)
    return places, 0.5 * np.maximum(1.0 - distance, 0.0)


def test_memory_is_handed_on_as_by_a_dictionary():
    rng = np.random.default_rng(1)
    for _ in range(200):
        every = {
            tuple(np.append(np.sort(rng.integers(0, 4 * CHUNK, 2)), g).tolist())
            for g in rng.integers(0, 4, 120)
        }
        # In the order of the pair search: by operation, runs, places.
        ordered = sorted(every, key=lambda p: (p[2], p[0] // CHUNK, p[1] // CHUNK, p[0], p[1]))
        old, new = (
            [p for p in ordered if rng.random() < share] for share in rng.uniform(0.0, 1.0, 2)
        )
        memory, rubs = blank(len(old), MEMORY), blank(len(new), RUB)
        memory["pair"], rubs["pair"] = np.reshape(old, (-1, 3)), np.reshape(new, (-1, 3))
        memory["held"], memory["facing"] = rng.standard_normal((2, len(old), 3))
        known = {p: (m["held"], m["facing"]) for p, m in zip(old, memory, strict=True)}
        recall(rubs, memory)
        for pair, rub in zip(new, rubs, strict=True):
            held, facing = known.get(pair, (np.zeros(3), np.zeros(3)))
            assert rub["held"].tolist() == held.tolist()
            assert rub["facing"].tolist() == facing.tolist()
        for a, b in itertools.pairwise(memory):
            assert precedes(a["pair"], *b["pair"]) and not precedes(b["pair"], *a["pair"])


def test_books_of_ten_thousand_histories_balance():
    """Of single contacts: nothing lost is negative, and the work is held or lost as the steps shorten."""
    misses, slid = {}, 0
    for steps, count in ((100, 300), (200, 300), (400, 10_000), (1600, 300)):
        rng, off, lost = np.random.default_rng(2), [], []
        for _ in range(count):
            places, limits = smooth_history(rng, steps, closed=False)
            record = driven(places, limits)
            assert record[:, 4].min() >= 0.0
            lost.append(record[:, 4].sum())
            off.append(record[-1, 5] - record[-1, 3] - lost[-1])
            # Never above Coulomb's limit, and across the normal.
            force = np.linalg.norm(record[:, :3], axis=1)
            assert (force <= limits * (1.0 + 1e-12)).all()
            assert np.abs((record[:, :3] * places).sum(1)).max() <= 1e-12
        misses[steps] = np.sqrt(np.mean(np.square(off[:300]))) / np.mean(lost)
        slid += sum(one > 1e-3 for one in lost)
    assert slid > 9000
    assert misses[100] > 3.0 * misses[200] > 9.0 * misses[400] > 18.0 * misses[1600] > 0.0
    assert misses[1600] < 2e-4


def test_losses_of_jumps_are_never_negative():
    """Places and normal forces thrown at random: no step of a programme is too large."""
    rng = np.random.default_rng(3)
    places = rng.standard_normal((30_000, 3)) * [0.3, 0.3, 0.1] + [0.0, 0.0, 0.8]
    limits = rng.uniform(0.0, 0.3, 30_000) * (rng.random(30_000) < 0.8)
    record = driven(places, limits)
    assert record[:, 4].min() >= 0.0 and (record[:, 4] > 0.0).mean() > 0.5
    # What is held never exceeds what a spring can hold at the limit.
    assert (record[:, 3] <= 0.5 * limits**2 / STIFFNESS * (1.0 + 1e-12)).all()


@pytest.mark.slow
def test_no_energy_is_gained_in_ten_thousand_cycles():
    """One contact through cycle after cycle: the work, less what is held, only grows.

    The work is taken from force and way alone.
    """
    rng, steps = np.random.default_rng(4), 400
    cycles = [smooth_history(rng, steps, closed=True)[0] for _ in range(10_000)]
    places = np.concatenate([c[1:] - c[0] + [0.0, 0.0, 0.95] for c in cycles])
    limits = 0.5 * np.maximum(1.0 - np.linalg.norm(places, axis=1), 0.0)
    record = driven(places, limits)
    taken = record[:, 5] - record[:, 3]
    lost = record[:, 4].sum()
    per_cycle = lost / len(cycles)
    assert taken[-1] == pytest.approx(lost, rel=5e-3)
    fallen = np.maximum.accumulate(taken) - taken
    assert fallen.max() < 2e-3 * per_cycle
    ends = taken[steps - 1 :: steps]
    assert np.diff(ends).min() > -1e-3 * per_cycle and len(ends) == 10_000


def network(places, stiffness, limits):
    """Force (N), held (J) and lost (J) of contacts in parallel that all follow one displacement."""
    way = np.zeros((len(places) + 1, 3))
    way[1:, 0] = places
    apart = np.tile([0.0, 0.0, 1.0], (len(way), 1))
    force = np.zeros((len(places), 3))
    for k, limit in zip(stiffness, limits, strict=True):
        record = np.zeros((len(way), 6))
        rub, memory = blank(1, RUB)[0], blank(1, MEMORY)[0]
        follow(rub, memory, apart, way, np.full(len(way), limit), k, record)
        force += np.stack([record[1:, 0], record[1:, 3], np.cumsum(record[1:, 4])], axis=1)
    return force.T


def test_sliders_in_parallel_follow_masing_whatever_the_history():
    rng = np.random.default_rng(5)
    stiffness, limits = rng.uniform(0.5, 3.0, 8), rng.uniform(0.0, 1.0, 8)
    for _ in range(100):
        places = 0.6 * rng.standard_normal(60)
        force, _, _ = network(places, stiffness, limits)
        np.testing.assert_allclose(
            force, sliders.forces(places, stiffness, limits), rtol=0, atol=1e-11
        )
        # Steps in between change nothing.
        fine = np.interp(np.arange(0, 59.01, 0.2), np.arange(60), places)
        np.testing.assert_allclose(network(fine, stiffness, limits)[0, ::5], force, atol=1e-11)


def test_nested_loops_close_exactly_and_forget_what_they_hold():
    rng = np.random.default_rng(6)
    stiffness, limits = rng.uniform(0.5, 3.0, 8), rng.uniform(0.1, 1.0, 8)
    # 30, 15, 30 % and loops within loops, each closed at the place where it began.
    nested = [0.3, 0.15, 0.3, -0.2, 0.1, 0.0, 0.05, 0.0, 0.1, -0.2, 0.3]
    force, held, _ = network(nested, stiffness, limits)
    for first, again in ((0, 2), (0, 10), (3, 9), (4, 8), (5, 7)):
        assert nested[first] == nested[again]
        assert force[again] == pytest.approx(force[first], rel=1e-12)
        assert held[again] == pytest.approx(held[first], rel=1e-12)
    assert abs(force[6] - force[4]) > 0.01 * abs(force[0])
    # A whole cycle loses the area of its loop.
    amplitude = 1.2 * (limits / stiffness).max()
    _, _, lost = network([amplitude, -amplitude, amplitude], stiffness, limits)
    assert lost[2] - lost[0] == pytest.approx(sliders.loop_area(amplitude, stiffness, limits))
    # What is held on the first way out.
    _, held, _ = network([0.5 * amplitude], stiffness, limits)
    assert held[0] == pytest.approx(sliders.spring_energy(0.5 * amplitude, stiffness, limits))

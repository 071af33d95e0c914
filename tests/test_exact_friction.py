"""Exact answers for friction that turns back, against rows of nodes on rough ground, node by node."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from knitsim.errors import InputError
from knitsim.verification import exact_friction

LENGTH, STIFFNESS, SPRING = 0.1, 1e4, 9e7
REST = (SPRING, STIFFNESS, LENGTH)


class Row:
    """Nodes on a rough slope, springs between them, pulled upwards at the last one.

    Each node stands on a spring of friction, its anchor carried along where it would hold more than the
    limit.  Given the place of the free end, all others follow node by node.
    """

    def __init__(self, nodes, limit, slope):
        self.step = LENGTH / nodes
        self.limit, self.weight = limit * self.step, slope * self.step
        self.spring, self.link = SPRING * self.step, STIFFNESS / self.step
        # At rest the springs hold the weight.
        self.anchor = np.full(nodes, self.weight / self.spring)
        self.lost = 0.0

    def march(self, first):
        """Anchors, friction, the pull and the place of the end, for a place of the free end."""
        place, pull = first, 0.0
        anchors, rubs = np.empty((2, len(self.anchor)))
        for i, anchor in enumerate(self.anchor):
            rub = min(max(self.spring * (place - anchor), -self.limit), self.limit)
            anchors[i], rubs[i] = place - rub / self.spring, rub
            pull += rub + self.weight
            place += pull / self.link
        return anchors, rubs, pull, place - 0.5 * pull / self.link

    def go(self, pull):
        """Change the pull (N); how far the end is from where it was at rest (m)."""
        first = brentq(lambda u: self.march(u)[2] - pull, -1e-4, 1e-4, xtol=1e-18, rtol=1e-14)
        anchors, rubs, _, place = self.march(first)
        self.lost += np.abs(rubs) @ np.abs(anchors - self.anchor)
        self.anchor = anchors
        return place


def test_yarn_on_an_incline_is_a_row_of_sliders():
    limit, slope, pull = 2.94, 1.99, 0.3
    row = Row(600, limit, slope)
    assert row.go(0.0) == pytest.approx(0.0, abs=1e-12)
    ways = [row.go(part * pull) for part in (1.0, 0.4, 1.0, 0.0)]
    before = row.lost
    ways.append(row.go(pull))
    up = exact_friction.pulled_end(pull, limit + slope, *REST)
    part, whole = (exact_friction.unpulled_end(p, limit, *REST) for p in (0.6 * pull, pull))
    assert ways == pytest.approx([up, up - part, up, up - whole, up], rel=1e-5)
    # Half a cycle, up again, loses half of it.
    cycle = exact_friction.pull_cycle_loss(pull, limit, *REST)
    assert row.lost - before == pytest.approx(0.5 * cycle, rel=1e-4)
    assert 0.1 * up < ways[3] < 0.5 * up


def test_the_two_parts_of_the_pull_join_and_too_great_a_pull_is_refused():
    decay = math.sqrt(SPRING / STIFFNESS)
    first = 5.0 / decay * math.tanh(decay * LENGTH)
    below, above = (exact_friction.pulled_end(first * f, 5.0, *REST) for f in (1 - 1e-9, 1 + 1e-9))
    assert below == pytest.approx(above, rel=1e-8)
    with pytest.raises(InputError, match="pull"):
        exact_friction.pulled_end(1.01 * 5.0 * LENGTH, 5.0, *REST)


def test_capstan_let_back_is_a_row_of_nodes():
    """Let back little by little: each node slides where the tension beyond it has fallen far enough."""
    friction, turn, low, compliance, tail = 0.3, math.pi, 0.1, 1.2e-5, 3e-6
    errors = []
    for nodes in (500, 1000):
        angle = turn * (np.arange(nodes) + 0.5) / nodes
        half = 0.5 * friction * turn / nodes
        ratio = (1.0 + half) / (1.0 - half)
        tension = low * ratio ** (np.arange(nodes) + 0.5)
        end, way = low * ratio**nodes, 0.0
        asked = [0.9 * end, 0.6 * end, low * 1.2, low / math.exp(friction * turn) * 1.001]
        off = []
        for target in asked:
            for lower in np.linspace(end, target, 20)[1:]:
                least, new = lower * math.sqrt(ratio), tension.copy()
                for i in range(nodes - 1, -1, -1):
                    new[i] = min(tension[i], least)
                    least = new[i] * ratio
                way += compliance * turn / nodes * (tension - new).sum() + tail * (end - lower)
                tension, end = new, lower
            exact = exact_friction.unloading_way(friction, low, end, turn, compliance, tail)
            profile = [exact_friction.unloaded_tension(friction, low, end, turn, a) for a in angle]
            off += [abs(way / exact - 1.0), np.abs(tension / profile - 1.0).max()]
        errors.append(max(off))
    assert errors[1] < 1e-4
    assert errors[1] < 0.6 * errors[0]

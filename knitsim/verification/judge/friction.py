"""Friction told anew from the shapes of a test alone: what every pair and every place of the yarn remembers.

The method states: two places that touch are joined across their normal by a spring, whose force grows to
Coulomb's limit and no further; the yarn's moment lags behind its curvature likewise.  From one solved step
to the next both follow from the shapes at its ends, as long as every step is among the states.
"""

from dataclasses import dataclass, replace

import numpy as np

from knitsim.verification.judge.measure import size_of

FIRST_TOUCH = 0.1  # of the gap over which the stiffness of a contact at first touch is taken


@dataclass(frozen=True, eq=False)
class Memory:
    """What is remembered: pairs (n, 4), i, k, image; held (n, 3): elongation (m) of their springs; facing
    (n, 3): the normal it lies across; axis (3, yarns, m), lag (3, yarns, m): direction of the yarn's
    turning, and its elastic part (1/m), the least and the most that this can be."""

    pairs: np.ndarray
    held: np.ndarray
    facing: np.ndarray
    axis: np.ndarray
    lag: np.ndarray


@dataclass(frozen=True, eq=False)
class Rubbed:
    """What friction does at the end of a step: acting, as :meth:`.measure.Energy.gradient` gives it; force:
    sum of the friction forces (N); lost, held: energy dissipated in the step, and in the springs at its
    end (J per loop); memory."""

    acting: tuple
    force: float
    lost: float
    held: float
    memory: Memory


class Friction:
    """Friction of a fabric measured with an :class:`.measure.Energy`."""

    def __init__(self, energy):
        self.energy, given = energy, energy.given
        gap = FIRST_TOUCH * (given.diameter - given.contact.core)
        v, _ = given.contact.at(np.array(given.diameter - gap), given.diameter)
        self.shell = given.tangential_ratio * 2.0 * float(v) / gap**2 * energy.length**2
        self.locked = given.stuck_ratio * given.bending_rigidity

    def begun(self, shape):
        """Memory at a shape in which nothing has rubbed yet."""
        turn, none = self.energy.turn_of(shape), np.zeros((0, 3))
        return Memory(np.zeros((0, 4), int), none, none, _unit(turn), np.zeros(turn.shape))

    def doubted(self, memory):
        """Memory after a way that is not known: within the yarn anything may be held, up to the limit."""
        most = np.full_like(memory.lag[0], self.energy.given.bending_hysteresis / self.locked)
        return replace(memory, lag=np.stack([memory.lag[0], -most, most]))

    def step(self, before, after, memory):
        """:class:`Rubbed` at the shape ``after``, reached in one step from ``before``."""
        energy, mu = self.energy, self.energy.given.friction
        pairs, index = _each_once(np.concatenate([_pairs(before), _pairs(after), memory.pairs]))
        at = pairs[:, 0], pairs[:, 1], pairs[:, 2:]
        held, facing = np.zeros((len(pairs), 3)), np.zeros((len(pairs), 3))
        known = index[len(index) - len(memory.pairs) :]
        held[known], facing[known] = memory.held, memory.facing
        then, now = energy.gaps(before, *at), energy.gaps(after, *at)
        normal = _unit(now.T).T
        leant = (held * normal).sum(1) / (1.0 + (facing * normal).sum(1))
        start = held - leant[:, None] * (facing + normal)
        way = start + now - then
        way -= (way * normal).sum(1)[:, None] * normal
        limits = [mu * energy.press(s, at) for s in (before, after)]
        size, k = size_of(way), self.shell
        # Beyond the limit it slides, from where on the growing spring has met the changing limit.
        kept = np.where(k * size > limits[1], limits[1] / np.where(size > 0.0, k * size, 1.0), 1.0)
        rise = limits[1] - limits[0]
        a = k * k * ((way - start) ** 2).sum(1) - rise**2
        b = k * k * (start * (way - start)).sum(1) - limits[0] * rise
        c = np.minimum(k * k * (start**2).sum(1) - limits[0] ** 2, 0.0)
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            onset = np.where(b > 0.0, -c / (b + root), (root - b) / a)
        onset = limits[0] + np.clip(np.nan_to_num(onset, nan=0.0), 0.0, 1.0) * rise
        slid = kept < 1.0
        lost = (0.5 * (onset + limits[1]) * (1.0 - kept) * size)[slid].sum()
        way *= kept[:, None]
        stays = (way != 0.0).any(1)
        pull = energy.pulled(after, k * way, at)
        acting, lag_lost, lag_held, axis, lag = self._lag(before, after, memory, pull)
        return Rubbed(
            energy.told(acting), k * size_of(way).sum(), (lost + lag_lost) / energy.loops,
            (0.5 * k * (way**2).sum() + lag_held) / energy.loops,
            Memory(pairs[stays], way[stays], normal[stays], axis, lag),
        )  # fmt: skip

    def _lag(self, before, after, memory, acting):
        """Derivatives with those of the lagging couples, energy lost and held, new axis and lag."""
        couple, energy = self.energy.given.bending_hysteresis, self.energy
        if couple == 0.0:
            return acting, 0.0, 0.0, memory.axis, memory.lag
        was = energy.turn_of(before)
        axis = _unit(was)
        turned = np.sign((axis * memory.axis).sum(0))
        start = np.where(turned < 0.0, -memory.lag[[0, 2, 1]], turned * memory.lag)
        change = (axis * energy.turn_of(after)).sum(0) - size_of(was.T).T + start
        # What is held at the end rises with what was at the start: bounds stay so, and meet where it slides.
        kept = np.clip(change, -couple / self.locked, couple / self.locked)
        lost = (couple * energy.weight * np.abs(change - kept)[0]).sum()
        held = (0.5 * self.locked * energy.weight * kept[0] ** 2).sum()
        part = self.locked / couple * kept[0] * axis
        acting = energy.lagging(after, lambda slope: (part * slope).sum(0), acting)
        return acting, lost, held, axis, kept

    def most(self, shape):
        """The most that friction may do to what gradient gives, in the same order and units."""
        energy, rub = self.energy, self.energy.given.friction * self.energy.press(shape)
        normal, by = shape.gap / shape.distance[:, None], energy.by_gap(shape)
        across = np.sqrt(np.maximum((by**2).sum(-1) - (by * normal).sum(-1) ** 2, 0.0)) * rub
        on_i, on_k = (energy.by_axis(*across[:2], across[end]) for end in (2, 3))
        at = energy.gathered(shape, on_i, on_k)
        # What the cell moves is the gap: each turn of k's image, less that of i along the yarn.
        turns = np.tile(energy.turns, energy.given.courses)
        steps = np.abs(shape.image - np.outer(turns[shape.i] - turns[shape.k], [1, 0]))
        found = np.abs(energy.place).T @ at, steps.T @ on_i[:, :2], across[4].sum()
        return energy.told(self._couples(shape, 1.0, found))

    def unsure(self, shape, memory):
        """How far what the couples do may be off by the bounds of their memory, as :meth:`most` gives it."""
        wide, none = np.abs(memory.lag[1:] - memory.lag[0]).max(0), np.zeros_like(shape.control)
        if not wide.any():
            return none, np.zeros(4), 0.0
        part = self.locked / self.energy.given.bending_hysteresis * wide
        return self.energy.told(self._couples(shape, part, (none, np.zeros((2, 2)), 0.0)))

    def _couples(self, shape, part, found):
        """Derivatives with the most that a part of the couples, a number or (yarns, m), may do either way."""
        if self.energy.given.bending_hysteresis == 0.0:
            return found
        return self.energy.lagging(shape, lambda slope: part * size_of(slope.T).T, found, np.abs)


def _pairs(shape):
    return np.column_stack([shape.i, shape.k, shape.image])


def _each_once(rows):
    """The different rows of integers, in order, and the place of each given one among them."""
    low = rows.min(0, initial=0)
    one = np.ravel_multi_index((rows - low).T, rows.max(0, initial=0) - low + 1)
    _, first, index = np.unique(one, return_index=True, return_inverse=True)
    return rows[first], index


def _unit(vectors):
    """Unit vectors (3, ...) along vectors (3, ...); zeros where they have no length."""
    size = np.sqrt((vectors**2).sum(0))
    return vectors / np.where(size > 0.0, size, 1.0)

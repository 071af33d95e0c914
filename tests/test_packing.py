"""Where the fibres lie in a section of the yarn."""

import math

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.yarn.packing import RINGS, FibreLayout, pack


def brute_smallest_distance(positions):
    return min(math.dist(a, b) for i, a in enumerate(positions) for b in positions[:i])


@pytest.mark.parametrize("fibres", [20, 72, 500])
def test_many_fibres_have_radii_of_equal_areas(fibres):
    layout = pack(fibres, 0.3e-3)
    # The rings between neighbouring midpoints all have the area of one fibre's share.
    areas = np.diff(math.pi * layout.radii**2)
    np.testing.assert_allclose(areas, math.pi * 0.15e-3**2 / fibres, rtol=1e-9)
    assert math.pi * layout.radii[0] ** 2 == pytest.approx(0.5 * areas[0])


@pytest.mark.parametrize("fibres", RINGS)
def test_few_fibres_stand_on_balanced_rings(fibres):
    layout = pack(fibres, 2.0)
    assert layout.fibres == fibres == sum(RINGS[fibres])
    np.testing.assert_allclose(layout.positions.mean(axis=0), 0.0, atol=1e-15)
    inside = 0
    for count in RINGS[fibres]:
        expected = 0.0 if count == 1 else math.sqrt((inside + count / 2) / fibres)
        np.testing.assert_allclose(layout.radii[inside : inside + count], expected, atol=1e-15)
        inside += count


def test_one_fibre_lies_on_the_axis():
    layout = pack(1, 0.1e-3, fibre_diameter=0.1e-3)
    assert (layout.positions == 0).all()
    assert layout.smallest_distance == math.inf
    assert layout.packing_fraction == 1.0


@pytest.mark.parametrize("fibres", [*range(2, 30), 72, 330, 500])
def test_smallest_distance_is_that_of_all_pairs(fibres):
    layout = pack(fibres, 1.0)
    assert layout.smallest_distance == pytest.approx(brute_smallest_distance(layout.positions))


@pytest.mark.parametrize("fibres", [20, 21, 30, 72, 200, 330, 500])
def test_the_loosened_core_lets_fibres_fill_two_thirds(fibres):
    # Vogel's own lattice: the smallest distance is 1.5460 R/sqrt(n), touching at 0.5976.
    order = np.arange(1, fibres + 1)
    angle = order * math.pi * (3 - math.sqrt(5))
    radius = np.sqrt((order - 0.5) / fibres)
    vogel = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    assert fibres * (brute_smallest_distance(vogel) / 2) ** 2 == pytest.approx(0.5976, abs=1e-4)
    layout = pack(fibres, 2.0)
    assert fibres * (layout.smallest_distance / 2) ** 2 >= 0.687


def test_the_polyester_of_the_paper_fits():
    # 333.33 dtex, 72 filaments, 1.38 g/cm3; diameter after Peirce.
    fibre = math.sqrt(4 * 333.33e-7 / 72 / (math.pi * 1380))
    layout = pack(72, 0.2155e-3, fibre)
    assert layout.packing_fraction == pytest.approx(333.33e-7 / 1380 / (math.pi / 4 * 0.2155e-3**2))
    assert layout.smallest_distance > fibre


def test_fibres_that_just_touch_are_allowed_and_thicker_ones_are_not():
    room = pack(72, 1e-3).smallest_distance
    assert pack(72, 1e-3, room).fibre_diameter == room
    with pytest.raises(InputError) as refused:
        pack(72, 1e-3, 1.001 * room, where="yarns.yaml: thick")
    message = str(refused.value)
    assert message.startswith("yarns.yaml: thick.diameter_mm = ")
    assert "\n" not in message
    # The limits that the message names do fit, and nothing beyond them.
    thinner = float(message.rsplit("thinner than ", 1)[1].split()[0]) * 1e-3
    wider = float(message.rsplit("at least ", 1)[1].split()[0]) * 1e-3
    assert thinner == pytest.approx(room, rel=1e-4)
    pack(72, 1e-3, thinner)
    pack(72, wider, 1.001 * room)
    with pytest.raises(InputError):
        pack(72, wider * (1 - 1e-4), 1.001 * room)


def test_fibres_must_not_fill_more_than_the_yarn():
    # Three fibres on their ring are far apart, but would be more than the yarn.
    with pytest.raises(InputError, match="overlap"):
        pack(3, 1e-3, 0.6e-3)


@pytest.mark.parametrize("fibres", [0, -3, 1001, 7.5, True, math.nan, math.inf])
def test_counts_out_of_range_are_refused(fibres):
    with pytest.raises(InputError, match="whole number from 1 to 1000"):
        pack(fibres, 1e-3)


@pytest.mark.parametrize("size", [0.0, -1e-3, math.nan, math.inf])
def test_sizes_out_of_range_are_refused(size):
    with pytest.raises(InputError, match=r"yarn\.diameter"):
        pack(7, size)
    with pytest.raises(InputError, match=r"yarn\.fibre_diameter"):
        pack(7, 1e-3, size)


@pytest.mark.parametrize(
    "positions",
    [
        [[0.0, 0.0], [0.0, 0.0]],
        [[0.0, 0.6], [0.0, 0.0]],
        [[0.0, math.nan], [0.0, 0.0]],
        [0.0, 0.1],
        [[0.0, 0.1, 0.2]],
        np.empty((0, 2)),
    ],
)
def test_layouts_of_ones_own_are_checked(positions):
    with pytest.raises(InputError):
        FibreLayout(positions, 1.0)


def test_the_same_layout_comes_every_time():
    for fibres in (12, 72):
        first, again = pack(fibres, 0.2e-3), pack(fibres, 0.2e-3)
        assert first.positions.tobytes() == again.positions.tobytes()
        assert not first.positions.flags.writeable

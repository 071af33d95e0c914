"""Crossings against deformations that cannot change them, distances against exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import minimize

from knitsim.errors import InputError
from knitsim.loop.build import build_loop
from knitsim.loop.choi_lo import choi_lo
from knitsim.loop.lattice import (
    PLAIN_KNIT,
    crossings,
    crossings_intact,
    find_crossings,
    smallest_distance,
    smallest_distance_of_spline,
)
from knitsim.loop.length import centre_line_of
from knitsim.loop.proximity_kernels import nearest_on_images, segment_segment

W, C, D = 1e-2 / 6.67, 1e-2 / 8.33, 0.2793e-3
LOOP = build_loop(W, C, D, 5.56e-3)
LATTICE = LOOP.lattice
U = np.arange(201) / 200
POINTS = LOOP.polyline(200)
BACK = tuple((n, "under" if side == "over" else "over") for n, side in PLAIN_KNIT)
LOOPS = {
    "spline": LOOP,
    "curve": build_loop(W, C, D, 5.7e-3, centre_line="curve"),
    "peirce": build_loop(W, C, D, geometry="peirce"),
    "wide": build_loop(2.2e-3, 1.0e-3, 0.3e-3, 6.3e-3),
}


def read(points, lattice):
    return tuple((x.neighbour, x.side) for x in crossings(points, lattice))


def raw_count(points, lattice):
    return len(find_crossings(points, lattice))


def bump(centre, width=0.06):
    return np.clip(1 - ((U - centre) / width) ** 2, 0, None)[:, None] ** 2


@pytest.mark.parametrize("name", LOOPS)
def test_reads_plain_knit_from_the_head(name):
    loop = LOOPS[name]
    for count in (24, 37, 64, 128, 200, 401):
        assert read(loop.polyline(count), loop.lattice) == PLAIN_KNIT
        assert crossings_intact(loop.polyline(count), loop.lattice)


def test_places_of_the_crossings_lie_above_one_another():
    for x in crossings(LOOP.polyline(2000), LATTICE):
        here = LOOP.points(x.place)
        there = LOOP.points(x.other_place) + x.neighbour * LATTICE[1]
        np.testing.assert_allclose(here[:2], there[:2], atol=1e-5 * W)
        assert (here[2] > there[2]) == (x.side == "over")


@pytest.mark.parametrize("start", [0.1, 0.37, 0.5, 0.81])
def test_any_start_of_the_period_reads_the_same(start):
    points = LOOP.points(start + U)
    assert read(points, LATTICE) == PLAIN_KNIT
    assert crossings_intact(points, LATTICE)


@pytest.mark.parametrize("shear", [-0.3, 0.14, 0.5])
def test_shear_and_turning_of_fabric_and_lattice_change_nothing(shear):
    for plane in ([[1, shear], [0, 1]], [[1, 0], [shear, 1]], [[0.8, -0.6], [0.6, 0.8]]):
        change = np.eye(3)
        change[:2, :2] = plane
        assert crossings_intact(POINTS @ change.T, LATTICE @ change.T)


def test_seen_from_the_back_over_and_under_exchange():
    back = POINTS * (1, 1, -1)
    assert read(back, LATTICE) == BACK
    assert not crossings_intact(back, LATTICE)
    assert crossings_intact(back, LATTICE, seen_from="back")
    # The fabric turned over about its wales is the same fabric, not a mirrored one.
    turned = (POINTS * (-1, 1, -1) + (W, 0, 0))[::-1]
    assert crossings_intact(turned, LATTICE, seen_from="back")


def test_mirrored_about_a_wale_it_is_the_same_knit():
    assert crossings_intact((POINTS * (-1, 1, 1) + (W, 0, 0))[::-1], LATTICE)
    # Upside down (fabric pulled from the other end) heads become sinker loops: seen from the face,
    # turned in its plane, plain knit shows the same crossings.
    assert crossings_intact((-POINTS * (1, 1, -1) + (W, 0, 0))[::-1], LATTICE)


@pytest.mark.parametrize(
    ("points", "lattice"),
    [
        (POINTS, LATTICE * [[1, 1, 1], [1, 1.7, 1]]),  # courses drawn out of one another
        (POINTS, LATTICE + np.outer([0, 1], [0.5 * W, 0, 0])),  # heads slid under the next wales
        (POINTS * (1, 0.6, 1), LATTICE),  # loops too low to reach the next course
        (POINTS * (1, 1, 0.2) + (0, 0, 1) * bump(0.554) * 3 * D, LATTICE),  # one leg over its head
        (np.linspace(0, 1, 50)[:, None] * LATTICE[0], LATTICE),  # straight yarns
    ],
)
def test_yarns_pulled_through_one_another_are_noticed(points, lattice):
    assert not crossings_intact(points, lattice)


def test_a_state_that_is_not_finite_is_not_intact():
    points = POINTS.copy()
    points[17, 2] = np.nan
    assert not crossings_intact(points, LATTICE)


def test_courses_that_only_lie_on_one_another_are_not_interlaced():
    # Waves, each course wholly over the one before: all crossings can be slid away.
    wave = np.stack([U, np.sin(2 * np.pi * U), -0.1 * np.sin(2 * np.pi * U)], axis=-1)
    wave[-1, 1:] = 0.0
    lattice = np.array([[1.0, 0, 0], [0.4, 0.7, 0]])
    assert raw_count(wave, lattice) == 2
    assert crossings(wave, lattice) == ()
    assert not crossings_intact(wave, lattice)


def test_crossings_hold_as_long_as_no_yarn_meets_another():
    # Bumps grown on the loop in small steps: while each step is smaller than half the smallest
    # distance between yarns, none can have passed through another, whatever they look like.
    rng = np.random.default_rng(5)
    seen, checked = set(), 0
    for _ in range(12):
        grown = bump(rng.uniform(0.1, 0.9)) * rng.normal(size=3) * (2.5 * D, 2.5 * D, D)
        for amount in np.linspace(0, 1, 41):
            points = POINTS + amount * grown
            step = np.abs(np.linalg.norm(grown, axis=1)).max() / 40
            if 2 * step > smallest_distance(points, LATTICE, D).distance:
                break
            assert crossings_intact(points, LATTICE)
            seen.add(raw_count(points, LATTICE))
            checked += 1
    assert checked > 100
    assert max(seen) > 4  # some of them with crossings that can be slid away


def test_a_benign_overlap_of_a_leg_is_left_out():
    points = POINTS + bump(0.1) * (3.2 * D, 0, 0)
    assert raw_count(points, LATTICE) == 6
    assert read(points, LATTICE) == PLAIN_KNIT
    # Wherever the period is cut, also between the two crossings that belong together.
    for start in range(0, 200, 2):
        cut = np.concatenate([points[start:-1], points[: start + 1] + LATTICE[0]])
        assert crossings_intact(cut, LATTICE)


def exact_square(one, two):
    """Squared distance of two segments with integer ends, in rational arithmetic."""
    one, two = ([[Fraction(int(x)) for x in end] for end in s] for s in (one, two))

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    def minus(a, b):
        return [x - y for x, y in zip(a, b, strict=True)]

    u, v, r = minus(one[1], one[0]), minus(two[1], two[0]), minus(one[0], two[0])

    def value(s, t):
        gap = [r[k] + s * u[k] - t * v[k] for k in range(3)]
        return dot(gap, gap)

    def clamp(x):
        return min(Fraction(1), max(Fraction(0), x))

    uu, vv, uv, ur, vr = dot(u, u), dot(v, v), dot(u, v), dot(u, r), dot(v, r)
    candidates = [value(s, t) for s in (0, 1) for t in (0, 1)]
    for end in (Fraction(0), Fraction(1)):
        if vv:
            candidates.append(value(end, clamp((vr + end * uv) / vv)))
        if uu:
            candidates.append(value(clamp((end * uv - ur) / uu), end))
    det = uu * vv - uv * uv
    if det:
        s, t = (uv * vr - vv * ur) / det, (uu * vr - uv * ur) / det
        if 0 <= s <= 1 and 0 <= t <= 1:
            candidates.append(value(s, t))
    return min(candidates)


def segments():
    rng = np.random.default_rng(3)
    yield from rng.integers(-9, 10, size=(1500, 2, 2, 3))  # skew
    for scale in (1, 2, -3):  # parallel, overlapping or not
        for _ in range(100):
            p, q, u = rng.integers(-5, 6, size=(3, 3))
            yield np.array([[p, p + u], [q, q + scale * u]])
    for _ in range(100):  # points for segments, touching ends, crossing in their middles
        p, q, u, v = rng.integers(-5, 6, size=(4, 3))
        yield np.array([[p, p], [q, q + u]])
        yield np.array([[p, p], [q, q]])
        yield np.array([[p, p + u], [p + u, q]])
        yield np.array([[p - u, p + u], [p - v, p + v]])
    for _ in range(200):  # nearly parallel
        p, u = rng.integers(-1000, 1001, size=(2, 3))
        q, small = rng.integers(-5, 6, size=(2, 3))
        yield np.array([[p, p + u], [p + q, p + u + q + small]])


def test_distance_of_two_segments_against_exact_arithmetic():
    count = 0
    for pair in segments():
        exact = exact_square(*pair)
        one, two = pair.astype(float)
        square, s, t = segment_segment(one, two)
        size = float(np.abs(pair - pair[0, 0]).max()) + 1
        assert square == pytest.approx(float(exact), rel=1e-9, abs=1e-13 * size**2)
        # The places it names are at that distance.
        gap = one[0] + s * (one[1] - one[0]) - two[0] - t * (two[1] - two[0])
        assert 0 <= s <= 1
        assert 0 <= t <= 1
        assert gap @ gap == pytest.approx(square, rel=1e-9, abs=1e-13 * size**2)
        count += 1
    assert count == 2400


def test_nearest_yarns_against_all_pairs_one_by_one():
    count, skip = 20, 1.6 * D
    points = LOOP.polyline(count) + np.array([[0, 0, 1e-4]]) * np.sin(2 * np.pi * U[::10])[:, None]
    sheared = LATTICE + np.outer([0, 1], [2e-4, 0, 0])
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    least = np.inf
    for row in range(-2, 3):
        for k in range(-2, 3):
            moved = points + k * sheared[0] + row * sheared[1]
            for i in range(count):
                for j in range(count):
                    if row == 0:
                        ahead = arc[j] + k * arc[-1] - arc[i + 1]
                        behind = arc[i] - arc[j + 1] - k * arc[-1]
                        if max(ahead, behind) < skip:
                            continue
                    pair = segment_segment(points[i : i + 2], moved[j : j + 2])
                    least = min(least, pair[0])
    nearest = np.empty((13, count, 3))
    found = nearest_on_images(points, sheared[0], sheared[1], arc, skip, 2, 0.0, nearest)
    assert found == pytest.approx(least, rel=1e-12)
    assert nearest[:, :, 0].min() == found
    assert smallest_distance(points, sheared, D).distance == pytest.approx(np.sqrt(least))


def test_smallest_distance_of_the_cotton_curve():
    curve = centre_line_of(choi_lo(W, C, D, 1.0), "curve")
    found = smallest_distance_of_spline(curve, LATTICE, D)
    assert found.distance / D == pytest.approx(0.9385, abs=0.5e-4)
    # Minimised again without derivatives, from many starts.
    starts = np.random.default_rng(4).uniform(size=(40, 2))
    values = [
        minimize(
            lambda x: np.linalg.norm(curve.points(x[0]) - curve.points(x[1]) - LATTICE[1]) / D,
            start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12},
        ).fun
        for start in starts
    ]  # fmt: skip
    assert found.distance / D == pytest.approx(min(values), rel=1e-9)
    offset = found.image[0] * LATTICE[0] + found.image[1] * LATTICE[1]
    gap = curve.points(found.place) - curve.points(found.other_place) - offset
    assert np.linalg.norm(gap) == pytest.approx(found.distance, rel=1e-9)


@pytest.mark.parametrize("name", LOOPS)
def test_stated_errors_of_the_smallest_distance_hold(name):
    loop = LOOPS[name]
    fine = smallest_distance_of_spline(loop.spline, loop.lattice, loop.diameter, 400)
    for count in (25, 31, 60, 120, 240):
        again = smallest_distance_of_spline(loop.spline, loop.lattice, loop.diameter, count)
        assert abs(again.distance - fine.distance) <= again.error + fine.error
        assert again.error < 1e-6 * loop.diameter
    for count in (60, 120, 240):
        polygon = smallest_distance(loop.polyline(count), loop.lattice, loop.diameter)
        assert abs(polygon.distance - fine.distance) <= polygon.error
        assert polygon.error < 50 * loop.diameter / count**1.5
    assert loop.nearest.distance == pytest.approx(fine.distance, rel=1e-6)


def test_straight_yarns_are_one_course_apart_and_not_near_themselves():
    # The next loop of the same yarn begins nearer than anything else, and is not another yarn.
    yarn = np.linspace(0, 1, 9)[:, None] * (D, 0, 0)
    lattice = np.array([[D, 0, 0], [0, 3.7 * D, 0]])
    found = smallest_distance(yarn, lattice, 0.4 * D)
    assert found.distance < D  # of one yarn, more than 1.6 of these thinner diameters apart
    found = smallest_distance(yarn, lattice, 4 * D)
    assert found.distance == pytest.approx(3.7 * D, rel=1e-14)
    assert found.image[1] == 1


@pytest.mark.parametrize(
    ("points", "lattice", "says"),
    [
        (POINTS[:, :2], LATTICE, "must be \\(m \\+ 1, 3\\)"),
        (POINTS[:3], LATTICE, "m >= 4"),
        (POINTS[:-1], LATTICE, "advance by the first lattice vector"),
        (POINTS, LATTICE[0], "two finite vectors"),
        (POINTS, LATTICE[::-1], "plane of the fabric"),
        (POINTS, LATTICE + np.outer([0, 1], [0, 0, 1e-4]), "plane of the fabric"),
        (POINTS * np.nan, LATTICE, "finite"),
    ],
)
def test_refuses_what_is_no_loop_on_a_lattice(points, lattice, says):
    for ask in (crossings, lambda p, q: smallest_distance(p, q, D)):
        with pytest.raises(InputError, match=says) as caught:
            ask(points, lattice)
        assert "\n" not in str(caught.value)


def test_refuses_an_unknown_side():
    with pytest.raises(InputError, match="face or back"):
        crossings_intact(POINTS, LATTICE, seen_from="front")

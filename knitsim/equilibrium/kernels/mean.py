"""Contact laws averaged over the cell that a pair of contact points stands for (compiled).

Two yarns touch in a patch of the plane of their arcs (s1, s2), at whose edge the energy v sets in as the
square of the approach.  Sums of v over a lattice of points are off by what such an edge does: by the 2.5th
to 3.5th power of the spacing h, and by an amount that wavers as points slide past the edge.  The mean of
v over the h by h cell round each pair sums up to the integral instead, exactly if it is exact itself.
Within a cell the squared distance is taken as

    q + a x + b y,   x, y in [-1/2, 1/2],   a = h dq/ds1,   b = h dq/ds2,

with q raised by the mean of its second-order part, h^2 (q_11 + q_22)/24.  The mean of v over the two
boxes is a second difference of its second integral f2 at q +- a/2 +- b/2, over a b: the energy becomes
smooth where the law is not, and what is left of the error falls with the fourth power of h.

Lengths squared are counted in u = (d^2 - q)/d^2 for the barrier, lengths in w = (d - D)/(d - core) for
other laws.
"""

import math

from knitsim.equilibrium.contact import CORE, TERMS
from knitsim.jit import choose, leaf

THIN = 1e-3  # of d^2, d - core: no cell is thinner, in a direction in which the distance does not change
NARROW = 0.05  # half width in u of a cell that touches everywhere and is averaged by derivatives
DEEP = 0.98  # u up to which the corners of a cell are taken; at 1 both yarns have one place
FREELY = 0.05  # of the way to the core: cells up to here are not shrunk (to 1e-11)
APART = 0.25  # of an exponent from one at which a power becomes a logarithm
SERIES = 0.2  # up to here integrals are summed as power series, whose terms cancel nothing


@leaf
def corners(p, r, s, t, a, b):
    """Mean A over a cell and its derivatives A_u, A_a, A_b, A_uu, A_ua, A_ub, A_aa, A_ab, A_bb.

    p, r, s, t: f0, f1, f2 at u + (a + b)/2, u + (a - b)/2, u - (a - b)/2, u - (a + b)/2.
    """
    p0, p1, p2 = p
    r0, r1, r2 = r
    s0, s1, s2 = s
    t0, t1, t2 = t
    area = 1.0 / (a * b)
    mean = (p2 - r2 - s2 + t2) * area
    by_u = (p1 - r1 - s1 + t1) * area
    by_uu = (p0 - r0 - s0 + t0) * area
    by_a = 0.5 * (p1 - r1 + s1 - t1) * area - mean / a
    by_b = 0.5 * (p1 + r1 - s1 - t1) * area - mean / b
    by_ua = 0.5 * (p0 - r0 + s0 - t0) * area - by_u / a
    by_ub = 0.5 * (p0 + r0 - s0 - t0) * area - by_u / b
    by_aa = 0.25 * by_uu - 2.0 * by_a / a
    by_bb = 0.25 * by_uu - 2.0 * by_b / b
    by_ab = 0.25 * (p0 + r0 + s0 + t0) * area - (by_a + mean / a) / b - by_b / a
    return mean, by_u, by_a, by_b, by_uu, by_ua, by_ub, by_aa, by_ab, by_bb


@leaf
def barrier_integrals(u):
    """u^2/(1 - u) and its first and second integral from 0; zeros below 0."""
    if u <= 0.0:
        return 0.0, 0.0, 0.0
    if u < SERIES:
        first = second = 0.0
        for n in range(14, 2, -1):
            first = first * u + 1.0 / n
            second = second * u + 1.0 / (n * (n + 1.0))
        u3 = u * u * u
        return u * u / (1.0 - u), first * u3, second * u3 * u
    log, square = math.log1p(-u), u * u
    return (
        square / (1.0 - u),
        -log - u - 0.5 * square,
        (1.0 - u) * log + u - 0.5 * square - square * u / 6.0,
    )


@leaf
def barrier_mean(square, a, b, law):
    """Mean of the barrier law over a cell; as ``corners``, by q, a and b, these not negative.

    Where all of a narrow cell is in touch, by its derivatives instead: the terms of the corners would
    cancel.  What is left out there jumps as the cell comes to lie whole in touch: 1e-7 of the mean at most.
    """
    d2 = law.diameter * law.diameter
    inverse = 1.0 / d2
    u, a, b = (d2 - square) * inverse, a * inverse, b * inverse
    edge = 0.5 * (a + b)
    k, by = law.stiffness, -law.stiffness * inverse
    if u <= -edge:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    second = law.stiffness * inverse * inverse
    if u < edge or (edge > NARROW and u + edge < DEEP):
        less = 0.5 * (a - b)
        m, mu, ma, mb, muu, mua, mub, maa, mab, mbb = corners(
            barrier_integrals(u + edge), barrier_integrals(u + less),
            barrier_integrals(u - less), barrier_integrals(u - edge), a, b,
        )  # fmt: skip
        return (
            k * m, by * mu, -by * ma, -by * mb, second * muu, -second * mua, -second * mub,
            second * maa, second * mab, second * mbb,
        )  # fmt: skip
    i = 1.0 / (1.0 - u)
    i2 = i * i
    i3, aa, bb = i2 * i, a * a, b * b
    i5 = i3 * i2
    m2, m4 = (aa + bb) / 24.0, (aa * aa + bb * bb) / 1920.0 + aa * bb / 576.0
    # d2 v, d4 v by u, over 2 and 24, and what follows from them by a and b.
    mean = u * u * i + 2.0 * i3 * m2 + 24.0 * i5 * m4
    by_u = i2 - 1.0 + 6.0 * i2 * i2 * m2 + 120.0 * i5 * i * m4
    by_uu = 2.0 * i3 + 24.0 * i5 * m2 + 720.0 * i5 * i2 * m4
    of_a, of_b = a * (aa / 480.0 + bb / 288.0), b * (bb / 480.0 + aa / 288.0)
    by_a, by_b = i3 * a / 6.0 + 24.0 * i5 * of_a, i3 * b / 6.0 + 24.0 * i5 * of_b
    by_ua, by_ub = (
        0.5 * i2 * i2 * a + 120.0 * i5 * i * of_a,
        0.5 * i2 * i2 * b + 120.0 * i5 * i * of_b,
    )
    by_aa = i3 / 6.0 + 24.0 * i5 * (aa / 160.0 + bb / 288.0)
    by_bb = i3 / 6.0 + 24.0 * i5 * (bb / 160.0 + aa / 288.0)
    by_ab = i5 * a * b / 6.0
    return (
        k * mean, by * by_u, -by * by_a, -by * by_b, second * by_uu, -second * by_ua,
        -second * by_ub, second * by_aa, second * by_ab, second * by_bb,
    )  # fmt: skip


@leaf
def core_integrals(w, soft):
    """(1 - w)^(1 - p) - 1 - (p - 1) w and its first and second integral from 0; zeros below 0."""
    if w <= 0.0:
        return 0.0, 0.0, 0.0
    q = soft[2]
    if w < 0.5 * SERIES:
        # Binomial coefficients of (1 - w)^-q from the second on, and of its integrals.
        value = first = second = 0.0
        for n in range(TERMS - 1, -1, -1):
            value = value * w + soft[3 + n]
            first = first * w + soft[3 + TERMS + n]
            second = second * w + soft[3 + 2 * TERMS + n]
        square = w * w
        return value * square, first * square * w, second * square * square
    z, log = 1.0 - w, math.log1p(-w)
    more = math.expm1(-q * log)
    # z^(1 - q) - 1 and z^(2 - q) - 1, over what they become zero with; of the second, of which differences
    # are taken twice, every digit counts.
    if abs(1.0 - q) > APART:
        once = (z * more - w) / (1.0 - q)
    else:
        once = math.expm1((1.0 - q) * log) / (1.0 - q)
    less = math.expm1((2.0 - q) * log) / (2.0 - q) if abs(2.0 - q) > 1e-9 else log
    return (
        more - q * w,
        -once - w - 0.5 * q * w * w,
        (-less - w) / (q - 1.0) - 0.5 * w * w - q * w * w * w / 6.0,
    )


@leaf
def table_integrals(w, table):
    """As of a tabulated law: piece by piece from first touch on, their sums in the table."""
    if w <= 0.0:
        return 0.0, 0.0, 0.0
    z = 1.0 - w
    j = int(-math.log(z) / table[1])
    at = 2 + 8 * j
    if at >= table.size:
        return math.inf, math.inf, math.inf
    low, high = math.exp(-(j + 1) * table[1]), math.exp(-j * table[1])
    h = high - low
    # Of the polynomial in x, 0 at the lower knot and 1 at the upper, from there down to z.
    x, value = (z - low) / h, 0.0
    first = table[at + 6]
    second = table[at + 7] + first * (high - z)
    for k in range(5, -1, -1):
        value = value * x + table[at + k]
    for k in range(6):
        c = table[at + k]
        full = 1.0 - x ** (k + 1)
        first += h * c * full / (k + 1.0)
        second += (
            h * h * c * ((1.0 - x) / (k + 1.0) - (1.0 - x ** (k + 2)) / ((k + 1.0) * (k + 2.0)))
        )
    return value, first, second


@leaf
def soft_integrals(w, soft):
    return core_integrals(w, soft) if soft[0] == CORE else table_integrals(w, soft)


@leaf
def soft_mean(square, a, b, law):
    """As :func:`barrier_mean` of a core law or a tabulated one, by the distance D instead of its square."""
    distance, delta = math.sqrt(square), law.diameter - law.core
    to_w = 0.5 / (distance * delta)
    w, a, b = (law.diameter - distance) / delta, a * to_w, b * to_w
    edge = 0.5 * (a + b)
    if w <= -edge:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if w >= 1.0:
        return math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    # No corner comes nearer the core than half way: a and b shrink by s = (1 + x^8)^(-1/8).
    x, shrunk = (a + b) / (1.0 - w), 1.0
    if x > FREELY:
        shrunk = 1.0 / math.sqrt(math.sqrt(math.sqrt(1.0 + x**8)))
    half, less = 0.5 * (a + b) * shrunk, 0.5 * (a - b) * shrunk
    mean = corners(
        soft_integrals(w + half, law.soft), soft_integrals(w + less, law.soft),
        soft_integrals(w - less, law.soft), soft_integrals(w - half, law.soft),
        a * shrunk, b * shrunk,
    )  # fmt: skip
    if x > FREELY:
        mean = of_shrunk(mean, a, b, x, 1.0 - w)
    m, mw, ma, mb, mww, mwa, mwb, maa, mab, mbb = mean
    scale = 1.0
    if law.soft[0] == CORE:
        p = law.soft[1]
        scale = law.stiffness * delta * delta / (p * (p - 1.0))
    # By D: w = (d - D)/delta falls by to_w with q; a and b go with 1/D, their logarithm falls by e.
    e, wide, turn = 0.5 / square, ma * a + mb * b, mwa * a + mwb * b
    of_a, of_b = maa * a + mab * b, mab * a + mbb * b
    second = (mww * to_w + (mw + 2.0 * turn) * e) * to_w
    second += (3.0 * wide + of_a * a + of_b * b) * e * e
    once, twice = scale * to_w, scale * to_w * to_w
    return (
        scale * m, -scale * (mw * to_w + wide * e), once * ma, once * mb, scale * second,
        -once * (mwa * to_w + (of_a + ma) * e), -once * (mwb * to_w + (of_b + mb) * e),
        twice * maa, twice * mab, twice * mbb,
    )  # fmt: skip


@leaf
def of_shrunk(mean, a, b, x, room):
    """Mean over a cell of a s(x) by b s(x) and its derivatives by w, a, b, from those by w and both widths.

    s = (1 + x^8)^(-1/8), x = (a + b)/room, room = 1 - w.
    """
    m, mw, ma, mb, mww, mwa, mwb, maa, mab, mbb = mean
    more = 1.0 + x**8
    s = 1.0 / math.sqrt(math.sqrt(math.sqrt(more)))
    first = -s * x**7 / more
    second = (-7.0 * s * x**6 + 9.0 * s * x**14 / more) / more
    f, g = first / room, second / (room * room)
    # Both widths by w, a, b.
    aw, aa, ab = a * f * x, s + a * f, a * f
    bw, ba, bb = b * f * x, b * f, s + b * f
    # m by width and what shrinks it: both widths share s.
    pull = ma * a + mb * b
    fw = f / room
    return (
        m, mw + ma * aw + mb * bw, ma * aa + mb * ba, ma * ab + mb * bb,
        mww + 2.0 * (mwa * aw + mwb * bw) + maa * aw * aw + 2.0 * mab * aw * bw + mbb * bw * bw
        + pull * (g * x * x + 2.0 * fw * x),
        mwa * aa + mwb * ba + maa * aw * aa + mab * (aw * ba + bw * aa) + mbb * bw * ba
        + ma * f * x + pull * (g * x + fw),
        mwa * ab + mwb * bb + maa * aw * ab + mab * (aw * bb + bw * ab) + mbb * bw * bb
        + mb * f * x + pull * (g * x + fw),
        maa * aa * aa + 2.0 * mab * aa * ba + mbb * ba * ba + 2.0 * ma * f + pull * g,
        maa * aa * ab + mab * (aa * bb + ba * ab) + mbb * ba * bb + (ma + mb) * f + pull * g,
        maa * ab * ab + 2.0 * mab * ab * bb + mbb * bb * bb + 2.0 * mb * f + pull * g,
    )  # fmt: skip


mean_at = choose("law.soft", soft_mean, barrier_mean)

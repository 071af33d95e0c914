"""Stretch and bending energy of the yarn at its Gauss points (compiled).

With v = dr/du and A = d2r/du2, h the reference length of a unit of u, and a = v.v, b = v.A, c = A.A:
strain = sqrt(a)/h - 1, and kappa^2 = (a c - b^2)/(a h)^2 is the squared turning of the tangent per
reference length.  The energy per reference length is W(strain) + B/2 kappa^2, or with a rest
curvature B/2 (sqrt(kappa^2 + rounding^2) - rest)^2, of a yarn that turns freely about itself: without
torsional stiffness its rest curvature always lies along its curvature.

A yarn that does not turn about itself keeps the direction of its rest curvature.  With the unit tangent t0
and the rest curvature vector c that it had when it took its set, and R the least rotation from t0 to the
tangent t, the energy is B/2 |b - R c|^2, b = v x w/(a h) being the curvature vector.  For planar scenes
that is the signed curvature.  Torsional stiffness itself is left out.
"""

import math

import numpy as np

from knitsim.jit import leaf, njit


@leaf
def stretch_at(e, law):
    """Energy per length, tension and stiffness (N) at the strain e.

    Every kink of the law is rounded over +-half_width: its ramp max(x, 0) becomes the parabola
    (x + b)^2/(4 b), its jump the cubic 1/2 + 3/4 y - y^3/4 with y = x/b.  Outside, the tension is
    exact; inside, it is off by at most slope b/4.
    """
    energy = 0.5 * law.stiffness * e * e
    tension = law.stiffness * e
    stiffness = law.stiffness
    for i in range(law.kinks.size):
        kink = law.kinks[i]
        x, b, s, j = e - kink.strain, kink.half_width, kink.slope, kink.jump
        if x >= b:
            energy += s * (0.5 * x * x + b * b / 6.0) + j * x
            tension += s * x + j
            stiffness += s
        elif x > -b:
            y = x / b
            energy += s * (x + b) ** 3 / (12.0 * b)
            energy += j * b * (0.1875 + 0.5 * y + 0.375 * y * y - 0.0625 * y**4)
            tension += s * (x + b) ** 2 / (4.0 * b) + j * (0.5 + 0.75 * y - 0.25 * y**3)
            stiffness += s * (x + b) / (2.0 * b) + j * 0.75 * (1.0 - y * y) / b
    return energy, tension, stiffness


@leaf
def bend_at(square, bending, rest, rounding):
    """Energy per length and its first two derivatives by the squared curvature."""
    if rest == 0.0:
        return 0.5 * bending * square, 0.5 * bending, 0.0
    m = math.sqrt(square + rounding * rounding)
    return (
        0.5 * bending * (m - rest) ** 2,
        0.5 * bending * (1.0 - rest / m),
        0.25 * bending * rest / (m * m * m),
    )


@leaf
def yarn_point(point, stretch, v, w, order, form, tangent, terms):
    """Energy of a Gauss point (a row of the rod) with velocity v and acceleration w.

    Any orthonormal frame serves.  Adds to terms; fills form (6,), its gradient by (v, w), and with
    order 2 tangent (6, 6).
    """
    h, wt = point.span, point.weight
    a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    b = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
    c = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    root = math.sqrt(a)
    energy, tension, stiffness = stretch_at(root / h - 1.0, stretch)
    ia, ih = 1.0 / a, 1.0 / (h * h)
    square = max((c * ia - b * b * ia * ia) * ih, 0.0)
    psi, psi1, psi2 = bend_at(square, point.stiffness, point.rest, point.rounding)
    terms[0] += wt * energy
    terms[1] += wt * psi
    ka = (-c * ia * ia + 2.0 * b * b * ia**3) * ih
    kb, kc = -2.0 * b * ia * ia * ih, ia * ih
    fa = wt * (0.5 * tension / (root * h) + psi1 * ka)
    fb, fc = wt * psi1 * kb, wt * psi1 * kc
    for i in range(3):
        form[i] = 2.0 * fa * v[i] + fb * w[i]
        form[3 + i] = fb * v[i] + 2.0 * fc * w[i]
    if order < 2:
        return
    faa = wt * (
        0.25 * stiffness * ia * ih
        - 0.25 * tension * ia / (root * h)
        + psi1 * (2.0 * c * ia**3 - 6.0 * b * b * ia**4) * ih
        + psi2 * ka * ka
    )
    fab = wt * (psi1 * 4.0 * b * ia**3 * ih + psi2 * ka * kb)
    fac = wt * (-psi1 * ia * ia * ih + psi2 * ka * kc)
    fbb = wt * (-2.0 * psi1 * ia * ia * ih + psi2 * kb * kb)
    fbc, fcc = wt * psi2 * kb * kc, wt * psi2 * kc * kc
    for i in range(3):
        for j in range(3):
            vv, vw, wv, ww = v[i] * v[j], v[i] * w[j], w[i] * v[j], w[i] * w[j]
            same = 1.0 if i == j else 0.0
            tangent[i, j] = 4 * faa * vv + 2 * fab * (vw + wv) + fbb * ww + 2 * fa * same
            mixed = 2 * fab * vv + 4 * fac * vw + fbb * wv + 2 * fbc * ww + fb * same
            tangent[i, 3 + j] = mixed
            tangent[3 + j, i] = mixed
            tangent[3 + i, 3 + j] = fbb * vv + 2 * fbc * (vw + wv) + 4 * fcc * ww + 2 * fc * same


@njit
def locked_point(point, facing, turning, v, w, order, form, tangent, terms):
    """Add what the rest curvature of a yarn that does not turn does, to yarn_point's with none.

    facing, turning: t0 and c in the frame of v and w.  B (c.c/2 - G) per length, with G = b.R c =
    [(v x w).c - (v.c) (v x w).t0/D]/(a h), D = |v| + v.t0.
    """
    a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    norm, h = math.sqrt(a), point.span
    cc = s = d = 0.0
    for i in range(3):
        cc += turning[i] * turning[i]
        s += v[i] * turning[i]
        d += v[i] * facing[i]
    d += norm
    # Gradients by (v, w): of P = (v x w).c, Q = (v x w).t0, R = s Q/d, and of G.
    of_p, of_q, of_s, of_d = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    p = q = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        p += (v[i] * w[j] - v[j] * w[i]) * turning[k]
        q += (v[i] * w[j] - v[j] * w[i]) * facing[k]
        of_p[i], of_p[3 + i] = (
            w[j] * turning[k] - w[k] * turning[j],
            turning[j] * v[k] - turning[k] * v[j],
        )
        of_q[i], of_q[3 + i] = (
            w[j] * facing[k] - w[k] * facing[j],
            facing[j] * v[k] - facing[k] * v[j],
        )
        of_s[i], of_d[i] = turning[i], v[i] / norm + facing[i]
    r, area = s * q / d, a * h
    g = (p - r) / area
    factor = point.weight * point.stiffness
    terms[1] += factor * (0.5 * cc - g)
    if order == 0:
        return
    of_r, of_g = np.empty(6), np.empty(6)
    for i in range(6):
        of_r[i] = (of_s[i] * q + s * of_q[i] - r * of_d[i]) / d
        of_g[i] = (of_p[i] - of_r[i] - (g * 2.0 * h * v[i] if i < 3 else 0.0)) / area
        form[i] -= factor * of_g[i]
    if order < 2:
        return
    for i in range(6):
        for j in range(6):
            second = of_s[i] * of_q[j] + of_q[i] * of_s[j] - of_r[i] * of_d[j] - of_d[i] * of_r[j]
            if i < 3 and j < 3:
                same = 1.0 if i == j else 0.0
                second -= r * (same - v[i] * v[j] / a) / norm
                value = -second / d - 2.0 * h * (of_g[i] * v[j] + v[i] * of_g[j] + g * same)
            else:
                mixed = 0.0
                if i < 3 <= j or j < 3 <= i:
                    m, n = (i, j - 3) if i < 3 else (j, i - 3)
                    k = 3 - m - n
                    if m != n:
                        sign = 1.0 if n == (m + 1) % 3 else -1.0
                        mixed = sign * (turning[k] - s * facing[k] / d)
                value = mixed - second / d
                if i < 3:
                    value -= 2.0 * h * v[i] * of_g[j]
                if j < 3:
                    value -= 2.0 * h * v[j] * of_g[i]
            tangent[i, j] -= factor * value / area


@leaf
def held_point(point, v, w, order, form, tangent, terms):
    """:func:`locked_point` in the frame of the rod."""
    f, t = point.facing, point.turning
    locked_point(point, (f[0], f[1], f[2]), (t[0], t[1], t[2]), v, w, order, form, tangent, terms)


@leaf
def is_turned(point):
    """Whether a yarn that does not turn about itself has a rest curvature at this point."""
    turning = point.turning
    return turning[0] != 0.0 or turning[1] != 0.0 or turning[2] != 0.0


@leaf
def derivatives_at(point, x):
    """First and second derivative of the centre line by the parameter at a Gauss point, two tuples."""
    f = point.first
    v0 = v1 = v2 = a0 = a1 = a2 = 0.0
    for k in range(4):
        d, s = point.d1[k], point.d2[k]
        v0 += d * x[f + k, 0]
        v1 += d * x[f + k, 1]
        v2 += d * x[f + k, 2]
        a0 += s * x[f + k, 0]
        a1 += s * x[f + k, 1]
        a2 += s * x[f + k, 2]
    return (v0, v1, v2), (a0, a1, a2)


# In line: a call with as many arrays costs more than what it does.
@njit(inline="always")
def scatter(point, form, tangent, order, expanded, half):
    """Add an energy of velocity and acceleration at a Gauss point to the gradient and Hessian.

    form (6,): its gradient by them; tangent (6, 6): its Hessian, used where order is 2.
    """
    f = point.first
    for k in range(4):
        d, s = point.d1[k], point.d2[k]
        for i in range(3):
            expanded[3 * (f + k) + i] += d * form[i] + s * form[3 + i]
    if order == 1:
        return
    for i in range(3):
        for j in range(3):
            for k in range(4):
                dk, sk = point.d1[k], point.d2[k]
                left = dk * tangent[i, j] + sk * tangent[3 + i, j]
                right = dk * tangent[i, 3 + j] + sk * tangent[3 + i, 3 + j]
                row = 3 * (f + k) + i
                for m in range(k):
                    half[row, 3 * (f + m) + j] += left * point.d1[m] + right * point.d2[m]
                half[row, row - i + j] += 0.5 * (left * dk + right * sk)


@njit
def add_flat_yarn(scene, lattice, order, work):
    """Add the yarn's energy to work.terms[0] (stretch) and [1] (bending), at work.x."""
    form, tangent = np.empty(6), np.empty((6, 6))
    for point in scene.rod:
        v, w = derivatives_at(point, work.x)
        yarn_point(point, scene.stretch, v, w, order, form, tangent, work.terms)
        if is_turned(point):
            held_point(point, v, w, order, form, tangent, work.terms)
        if order > 0:
            scatter(point, form, tangent, order, work.expanded, work.half)


@leaf
def add_form(first, axes, weights, matrix, half):
    """Add a Hessian by local variables, sum_k weights[i, k] x[first + k, axes[i]], to ``half``."""
    n = axes.size
    for i in range(n):
        for k in range(4):
            row, left = 3 * (first + k) + axes[i], 0.5 * weights[i, k]
            for j in range(n):
                value = left * matrix[i, j]
                if value == 0.0:
                    continue
                for m in range(4):
                    half[row, 3 * (first + m) + axes[j]] += value * weights[j, m]

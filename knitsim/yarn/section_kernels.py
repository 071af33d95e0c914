"""Energy, gradient and Hessian of one section of a yarn, and its equilibrium (compiled).

Section j + 1 is the image M x of section j, so the chord of a fibre at x spans (M - 1) x in the
section and S along the axis.  With M orthogonal, in two dimensions, the squared in-section part of
the chord, q = x^T Q x with Q = (M - 1)^T (M - 1), says all about the fibre:

    chord^2 = S^2 + q,      sin^2(phi/2) = kappa q / (4 chord^2),

phi the angle between successive chords.  kappa is the eigenvalue of Q that is not 0: 4 sin^2 of
half the turn for a rotation by it, 4 for the reflection of eq (1) as printed.

Arrays: x (n, 2) fibre positions; turn (4,) = Qxx, Qxy, Qyy, kappa; fibres (n, 4), see the columns
below; law (3, m) = strain, tension, energy at the vertices of the tension law; ends (k, 2) the two
fibres of each spring of the section; springs (k, 2) = length at rest, stiffness (N/m).
"""

import math

import numpy as np

from knitsim.jit import njit
from knitsim.yarn.law_kernels import segment_of, slope_of

LENGTH, ANGLE, BEND, LARGEST = 0, 1, 2, 3  # chord and phi as built, bending spring (N m), strain

ITERATIONS = 60
STOP = 1e-12  # residual force at equilibrium, relative to the forces that balance
STEP_STOP = 1e-13  # step at equilibrium, relative to the size of the section


@njit
def fibre_stretch(e, largest, law):
    """Energy per reference length (N), tension (N) and its slope (N) of a fibre at the strain e.

    largest: largest strain the fibre has seen; below it, it unloads along the first slope.  The
    energy is that stored and dissipated since the start.  Reversible: largest = -inf.
    """
    reached = max(e, largest)
    k = segment_of(reached, law[0])
    slope = slope_of(k, law[0], law[1])
    x = reached - law[0, k]
    tension = law[1, k] + slope * x
    energy = law[2, k] + x * (law[1, k] + 0.5 * slope * x)
    if e >= largest:
        return energy, tension, slope
    slope = slope_of(0, law[0], law[1])
    back = largest - e
    return energy - back * (tension - 0.5 * slope * back), tension - slope * back, slope


@njit
def bending(t, built, constant):
    """constant/2 (phi - built)^2 and its first two derivatives by t = sin^2(phi/2)."""
    root = math.sqrt(t)
    phi = 2.0 * math.asin(root)
    if t < 1e-4:
        # phi^2 is smooth where phi is not; its series, as the quotients below lose digits here.
        first = 2.0 + t * (4.0 / 3.0 + t * (16.0 / 15.0 + t * (32.0 / 35.0)))
        second = 4.0 / 3.0 + t * (32.0 / 15.0 + t * (96.0 / 35.0))
    else:
        first = phi / math.sqrt(t * (1.0 - t))
        second = (1.0 - 0.5 * (1.0 - 2.0 * t) * first) / (t * (1.0 - t))
    if built > 0.0 and t > 0.0:
        by_t = 1.0 / math.sqrt(t * (1.0 - t))
        first -= built * by_t
        second += 0.5 * built * (1.0 - 2.0 * t) * by_t**3
    return 0.5 * constant * (phi - built) ** 2, constant * first, constant * second


@njit
def fibre_terms(q, spacing, kappa, fibre, law):
    """Energy of a fibre per section (J) and its derivatives by q, q twice and the spacing."""
    chord2 = spacing * spacing + q
    chord = math.sqrt(chord2)
    built = fibre[LENGTH]
    energy, tension, slope = fibre_stretch(chord / built - 1.0, fibre[LARGEST], law)
    energy *= built
    by_q = 0.5 * tension / chord
    by_qq = 0.25 * (slope / built - tension / chord) / chord2
    by_s = tension * spacing / chord
    if fibre[BEND] > 0.0:
        t = 0.25 * kappa * q / chord2
        bent, first, second = bending(t, fibre[ANGLE], fibre[BEND])
        t_q = 0.25 * kappa * spacing * spacing / chord2**2
        energy += bent
        by_q += first * t_q
        by_qq += second * t_q * t_q - 2.0 * first * t_q / chord2
        by_s -= 2.0 * first * t * spacing / chord2
    return energy, by_q, by_qq, by_s


@njit
def form_of(px, py, turn):
    """q = x^T Q x, which rounding must not take below 0, and the vector Q x."""
    gx = turn[0] * px + turn[1] * py
    gy = turn[1] * px + turn[2] * py
    return max(px * gx + py * gy, 0.0), gx, gy


@njit
def section_gradient(x, spacing, turn, fibres, law, ends, springs, gradient):
    """Fill the gradient (2n,) by x; returns the energy (J) and the largest force that balances."""
    gradient[:] = 0.0
    energy, force = 0.0, 0.0
    for i in range(x.shape[0]):
        q, gx, gy = form_of(x[i, 0], x[i, 1], turn)
        part, by_q, _, _ = fibre_terms(q, spacing, turn[3], fibres[i], law)
        energy += part
        gradient[2 * i] += 2.0 * by_q * gx
        gradient[2 * i + 1] += 2.0 * by_q * gy
        # A rounding error of the strain is worth slope x 1e-16: it sets the least force seen.
        least = 1e-3 * slope_of(0, law[0], law[1]) / fibres[i, LENGTH]
        force = max(force, (2.0 * abs(by_q) + least) * math.hypot(gx, gy))
    for k in range(ends.shape[0]):
        i, j = ends[k, 0], ends[k, 1]
        dx, dy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
        distance = math.hypot(dx, dy)
        pull = springs[k, 1] * (distance - springs[k, 0])
        energy += 0.5 * pull * (distance - springs[k, 0])
        gradient[2 * i] += pull * dx / distance
        gradient[2 * i + 1] += pull * dy / distance
        gradient[2 * j] -= pull * dx / distance
        gradient[2 * j + 1] -= pull * dy / distance
        force = max(force, abs(pull) + 1e-3 * springs[k, 1] * distance)
    return energy, force


@njit
def section_hessian(x, spacing, turn, fibres, law, ends, springs, band):
    """Fill the Hessian by x: band[a, k] (2n, width) holds the entry of the unknowns a + k and a."""
    band[:] = 0.0
    for i in range(x.shape[0]):
        q, gx, gy = form_of(x[i, 0], x[i, 1], turn)
        _, by_q, by_qq, _ = fibre_terms(q, spacing, turn[3], fibres[i], law)
        band[2 * i, 0] += 2.0 * by_q * turn[0] + 4.0 * by_qq * gx * gx
        band[2 * i, 1] += 2.0 * by_q * turn[1] + 4.0 * by_qq * gx * gy
        band[2 * i + 1, 0] += 2.0 * by_q * turn[2] + 4.0 * by_qq * gy * gy
    for k in range(ends.shape[0]):
        i, j = min(ends[k, 0], ends[k, 1]), max(ends[k, 0], ends[k, 1])
        ux, uy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
        distance = math.hypot(ux, uy)
        ux, uy = ux / distance, uy / distance
        across = springs[k, 1] * (1.0 - springs[k, 0] / distance)
        along = springs[k, 1] - across
        xx, xy, yy = across + along * ux * ux, along * ux * uy, across + along * uy * uy
        for m in (i, j):
            band[2 * m, 0] += xx
            band[2 * m, 1] += xy
            band[2 * m + 1, 0] += yy
        away = 2 * (j - i)
        band[2 * i, away] -= xx
        band[2 * i, away + 1] -= xy
        band[2 * i + 1, away - 1] -= xy
        band[2 * i + 1, away] -= yy


@njit
def cholesky(band, least):
    """Factorise in place; False where a pivot is not above ``least`` (not positive definite)."""
    size, width = band.shape
    column = np.empty(width)  # a copy, so that the innermost loop can be vectorised
    for a in range(size):
        if not band[a, 0] > least:
            return False
        root = math.sqrt(band[a, 0])
        reach = min(width, size - a)
        for k in range(reach):
            band[a, k] /= root
            column[k] = band[a, k]
        for k in range(1, reach):
            factor = column[k]
            if factor != 0.0:
                row = band[a + k]
                for m in range(reach - k):
                    row[m] -= factor * column[k + m]
    return True


@njit
def cholesky_solve(band, right):
    """Solve in place for the right-hand side (size,)."""
    size, width = band.shape
    for a in range(size):
        right[a] /= band[a, 0]
        for k in range(1, min(width, size - a)):
            right[a + k] -= band[a, k] * right[a]
    for a in range(size - 1, -1, -1):
        for k in range(1, min(width, size - a)):
            right[a] -= band[a, k] * right[a + k]
        right[a] /= band[a, 0]


@njit
def largest_of(values):
    """Largest absolute value of a vector; nan if there is one."""
    largest = 0.0
    for value in values:
        if not abs(value) <= largest:
            largest = abs(value)
    return largest


@njit
def newton_step(hessian, gradient, held, step):
    """Fill the step (2n,) of Newton's method, the unknown ``held`` staying where it is.

    Where the Hessian is not positive definite its diagonal is raised until it is.  The step is nan
    if the Hessian is.
    """
    size, width = hessian.shape
    largest = largest_of(hessian[:, 0])
    for k in range(1, width):
        hessian[held, k] = 0.0
        if k <= held:
            hessian[held - k, k] = 0.0
    hessian[held, 0] = largest
    raised = 0.0
    while True:
        # Copies, here and below, are not written as slices: those take seconds to compile.
        factor = hessian.copy()
        for a in range(size):
            factor[a, 0] += raised * largest
        if cholesky(factor, 1e-13 * largest):
            break
        raised = max(1e-8, 10.0 * raised)
        if not raised < 1e8:
            step[:] = math.nan
            return
    for a in range(size):
        step[a] = -gradient[a]
    step[held] = 0.0
    cholesky_solve(factor, step)


@njit
def equilibrium(x, spacing, turn, fibres, law, ends, springs, held):
    """Move x (n, 2) to the equilibrium at the spacing; returns the iterations, -1 if it fails.

    held: the unknown (2 fibre + axis) that stays: the energy does not change as the whole section
    turns (rotation) or shifts along the mirror line (reflection), so one unknown is free to choose.
    """
    size = 2 * x.shape[0]
    width = 2
    for k in range(ends.shape[0]):
        width = max(width, 2 * abs(ends[k, 0] - ends[k, 1]) + 2)
    band = np.empty((size, width))
    gradient, step = np.empty(size), np.empty(size)
    trial = np.empty_like(x)
    extent = largest_of(x.ravel())
    energy, force = section_gradient(x, spacing, turn, fibres, law, ends, springs, gradient)
    for iteration in range(ITERATIONS):
        gradient[held] = 0.0
        if largest_of(gradient) <= STOP * force:
            return iteration
        section_hessian(x, spacing, turn, fibres, law, ends, springs, band)
        newton_step(band, gradient, held, step)
        moved = largest_of(step)
        if not moved < math.inf:
            return -1
        descent = 0.0
        for a in range(size):
            descent += gradient[a] * step[a]
        share = 1.0
        while True:
            for a in range(size):
                trial[a // 2, a % 2] = x[a // 2, a % 2] + share * step[a]
            new, force = section_gradient(
                trial, spacing, turn, fibres, law, ends, springs, gradient
            )
            # Close to the equilibrium the energy differs by its rounding error only; the slope
            # along the step, which is exact to the last, then says whether it overshoots.
            if abs(new - energy) <= 1e-12 * abs(energy):
                slope = 0.0
                for a in range(size):
                    slope += gradient[a] * step[a]
                if slope <= -0.5 * descent:
                    break
            elif new <= energy + 1e-4 * share * descent:
                break
            share *= 0.5
            if share < 1e-12:
                return -1
        for a in range(size):
            x[a // 2, a % 2] = trial[a // 2, a % 2]
        energy = new
        if share * moved <= STEP_STOP * extent:
            return iteration + 1
    return -1


@njit
def fibre_states(x, spacing, turn, fibres, law, out):
    """Fill out (n, 5): strain, tension (N), stretch and bending energy per section (J), and the
    derivative of the two by the spacing (N)."""
    for i in range(x.shape[0]):
        q, _, _ = form_of(x[i, 0], x[i, 1], turn)
        chord = math.sqrt(spacing * spacing + q)
        strain = chord / fibres[i, LENGTH] - 1.0
        stretch, tension, _ = fibre_stretch(strain, fibres[i, LARGEST], law)
        stretch *= fibres[i, LENGTH]
        energy, _, _, by_s = fibre_terms(q, spacing, turn[3], fibres[i], law)
        out[i, 0] = strain
        out[i, 1] = tension
        out[i, 2] = stretch
        out[i, 3] = energy - stretch
        out[i, 4] = by_s

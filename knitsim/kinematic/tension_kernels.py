"""Length of a loop whose coordinates are scaled, over a whole test (compiled).

``squares`` (3, n) holds, at Gauss points of the centre line, the squared derivatives of the
coordinate pulled, the one across in the fabric, and the thickness, by the curve parameter;
``weights`` (n,) are the quadrature weights.
"""

import math

from knitsim.jit import njit

# The limit is reached at the last step; round-off there must not end the contraction early.
ROUND_OFF = 1e-12


@njit
def scaled_length(pull, across, squares, weights):
    """Length of the curve scaled by ``pull`` and ``across``, and its derivatives by these."""
    length = by_pull = by_across = 0.0
    p2, q2 = pull * pull, across * across
    for i in range(weights.size):
        speed = math.sqrt(p2 * squares[0, i] + q2 * squares[1, i] + squares[2, i])
        length += weights[i] * speed
        if speed > 0.0:
            by_pull += weights[i] * pull * squares[0, i] / speed
            by_across += weights[i] * across * squares[1, i] / speed
    return length, by_pull, by_across


@njit
def follow_isometric(pulls, limit, squares, weights, out):
    """The yarn keeps its length until the scale across reaches ``limit`` (the jam), then stretches.

    out (3, steps): scale across, length, total derivative of the length by the pull along the path.
    """
    rest = scaled_length(1.0, 1.0, squares, weights)[0]
    across = 1.0
    for step in range(pulls.size):
        pull = pulls[step]
        # Newton on a convex increasing function of the scale across: monotone from the right, and the
        # last step's scale lies there, as more pull leaves less across.
        for _ in range(60):
            length, _by_pull, by_across = scaled_length(pull, across, squares, weights)
            if by_across <= 0.0:
                break
            change = (length - rest) / by_across
            across -= change
            if across <= limit:
                across = limit
                break
            if abs(change) <= 1e-14:
                break
        length, by_pull, by_across = scaled_length(pull, across, squares, weights)
        jammed = across <= limit
        out[0, step] = across
        out[1, step] = length if jammed else rest
        out[2, step] = by_pull if jammed else 0.0


@njit
def follow_linear(pulls, rate, limit, squares, weights, out):
    """The scale across falls by ``rate`` per unit of the pull down to ``limit``; out as above."""
    for step in range(pulls.size):
        across = 1.0 - rate * (pulls[step] - 1.0)
        slope = -rate
        if across < limit - ROUND_OFF:
            across, slope = limit, 0.0
        length, by_pull, by_across = scaled_length(pulls[step], across, squares, weights)
        out[0, step] = across
        out[1, step] = length
        out[2, step] = by_pull + slope * by_across


@njit
def follow_printed(pulls, rate, limit, squares, weights, out):
    """As follow_linear, but the coordinate pulled does not follow the pull: eqs (4), (5) as printed.

    ``squares`` is of the printed positions.  The pull moves nothing along itself, so the length
    changes only by the contraction.
    """
    for step in range(pulls.size):
        across = 1.0 - rate * (pulls[step] - 1.0)
        slope = -rate
        if across < limit - ROUND_OFF:
            across, slope = limit, 0.0
        length, _by_pull, by_across = scaled_length(1.0, across, squares, weights)
        out[0, step] = across
        out[1, step] = length
        out[2, step] = slope * by_across

"""Closed forms of the twisted yarn: helix angles and Hearle's tangent stiffness at zero strain.

J. W. S. Hearle, P. Grosberg, S. Backer, *Structural Mechanics of Fibers, Yarns, and Fabrics*
(1969): the section stays rigid and fibres are stretched only.  A fibre at the angle alpha to the
axis is strained by cos^2 alpha of the yarn's strain and passes on cos alpha of its tension.  So its
share of the stiffness is EA cos^3 alpha; and as it takes up 1/cos alpha of its own area in the
yarn's cross-section, cos^4 alpha of its modulus per area of yarn.
"""

import math

import numpy as np


def surface_angle(twist, diameter):
    """Angle (rad) between the yarn axis and a fibre at its surface; twist: turns per metre."""
    return math.atan(math.pi * diameter * abs(twist))


def twist_of(angle, diameter):
    """Twist (turns per metre) whose surface angle is ``angle`` (rad) at ``diameter`` (m)."""
    return math.tan(angle) / (math.pi * diameter)


def helix_angle(radius, twist):
    """Angle (rad) between the yarn axis and a helix at ``radius`` (m, any shape)."""
    return np.arctan(2.0 * math.pi * np.asarray(radius) * abs(twist))


def chord_angle(radius, twist, spacing):
    """As :func:`helix_angle`, of the chord between sections ``spacing`` (m) apart.

    The chord is short of the helix by (theta^2)/24 of its tangent, theta the turn per section.
    """
    turn = 2.0 * math.pi * abs(twist) * spacing
    return np.arctan(2.0 * np.asarray(radius) * math.sin(0.5 * turn) / spacing)


def stiffness_of_fibres(stiffness, angle):
    """Tangent stiffness (N) of fibres of axial stiffness EA (N) at the angles ``angle``: (n,)."""
    return float(np.sum(stiffness * np.cos(angle) ** 3))


def mean_cos3(angle):
    """Yarn stiffness over that of its fibres side by side; angle: one per fibre (rad)."""
    return float(np.mean(np.cos(angle) ** 3))


def mean_cos4(angle):
    """Yarn modulus over fibre modulus, per area of yarn; angle: one per equal share of the area."""
    return float(np.mean(np.cos(angle) ** 4))


def equal_area_radii(fibres, radius):
    """Radii R sqrt((i - 1/2)/n) of the midpoints of equal shares of a disc, shape (fibres,)."""
    return radius * np.sqrt((np.arange(fibres) + 0.5) / fibres)


def mean_cos3_limit(angle):
    """:func:`mean_cos3` of very many fibres, 2 (1 - cos a)/tan^2 a, a the surface angle (rad)."""
    if angle == 0:
        return 1.0
    # 2 sin^2(a/2) in place of 1 - cos a, which cancels at small angles.
    return 4.0 * math.sin(0.5 * angle) ** 2 / math.tan(angle) ** 2


def mean_cos4_limit(angle):
    """:func:`mean_cos4` of very many fibres: cos^2 of the surface angle (rad), Hearle's law."""
    return math.cos(angle) ** 2

"""Exact answers for friction under loads that turn back: a yarn on an incline, the capstan.

SI units.  Coulomb friction that is elastic up to its limit (k per length of yarn), or rigid where k is
large.  Nothing here knows the solver's law: these are rods of one dimension, solved in closed form.
"""

import math

from scipy.integrate import quad
from scipy.optimize import brentq

from knitsim.errors import number

_ROOT = {"xtol": 1e-300, "rtol": 1e-15, "maxiter": 500}

# ---- a yarn on an incline, pulled at one end ----


def pulled_end(pull, limit, spring, stiffness, length):
    """Way (m) of the end of a yarn that lies on a rough plane and is pulled by ``pull`` (N).

    limit: friction per length q at which it slides (N/m); spring: k of friction before, per length
    (N/m2); stiffness: EA (N); length: L (m), its far end free.  With lambda^2 = k/EA the yarn beyond
    the part s that slides has u = u_y cosh(lambda (L - x))/cosh(lambda (L - s)), u_y = q/k, so that

        P = q s + (q/lambda) tanh(lambda (L - s)),
        delta = u_y + (P - q s) s/EA + q s^2/(2 EA);

    nothing slides up to P = (q/lambda) tanh(lambda L).  Raises InputError for a pull that moves all.
    """
    pull = number("pull", pull, 0.0, limit * length, low_allowed=True)
    decay = math.sqrt(spring / stiffness)
    first = limit / decay * math.tanh(decay * length)
    if pull <= first:
        return pull / (stiffness * decay * math.tanh(decay * length))

    def excess(s):
        return limit * s + limit / decay * math.tanh(decay * (length - s)) - pull

    s = brentq(excess, 0.0, length, **_ROOT)
    return limit / spring + (pull - limit * s) * s / stiffness + limit * s * s / (2.0 * stiffness)


def unpulled_end(less, limit, spring, stiffness, length):
    """Way back (m) of that end when the pull becomes ``less`` (N) lower, or higher again after that.

    As all friction that slides must turn from q to -q, it is twice the way out under half the change
    (Masing); limit: that of the plane, whatever the slope.  Holds as long as less of the yarn slides back
    than slid out.
    """
    return 2.0 * pulled_end(0.5 * less, limit, spring, stiffness, length)


def pull_cycle_loss(less, limit, spring, stiffness, length):
    """Energy (J) lost when the pull becomes ``less`` (N) lower and higher again."""
    way = unpulled_end(less, limit, spring, stiffness, length)
    under = quad(lambda p: unpulled_end(p, limit, spring, stiffness, length), 0.0, less, limit=200)
    return less * way - 2.0 * under[0]


# ---- the capstan, unloaded ----


def unloaded_tension(friction, low, end, turn, angle):
    """Tension (N) at ``angle`` (rad) of a yarn that slid over a cylinder towards its end and then back.

    low: T1 at the start, a dead load (N); end: T_e at the end now (N), between T1 exp(mu turn) and
    T1 exp(-mu turn).  Up to the angle at which the two meet, the tension is still that of sliding out;
    from there on the yarn slides back: min(T1 exp(mu angle), T_e exp(mu (turn - angle))).
    """
    return min(low * math.exp(friction * angle), end * math.exp(friction * (turn - angle)))


def unloading_way(friction, low, end, turn, compliance, tail):
    """Way (m) of the end from the state of sliding throughout back to the tension ``end`` (N).

    compliance: of the yarn on the cylinder, d strain/d tension times the radius (m/N per rad); tail: of
    the straight piece at the end (m/N).  Other arguments as in :func:`unloaded_tension`.  The tension
    falls by T1 exp(mu phi) - T_e exp(mu (turn - phi)) from the angle phi* on where that is zero:

        way = (compliance/mu) [T1 (exp(mu turn) - exp(mu phi*)) - T_e (exp(mu (turn - phi*)) - 1)]
              + tail (T1 exp(mu turn) - T_e).
    """
    grown = math.exp(friction * turn)
    meet = 0.5 * (turn + math.log(end / low) / friction)
    out = low * (grown - math.exp(friction * meet))
    back = end * (math.exp(friction * (turn - meet)) - 1.0)
    return compliance / friction * (out - back) + tail * (low * grown - end)

"""A heavy block that is pushed to and fro over the back of a cylinder, in closed form.

The block lies at the angle a from the crown, its weight W straight down; H pushes it sideways.  With
the normal force N outward and the friction f, positive against a motion to the right, balance is

    N cos a + f sin a = W,   H + N sin a = f cos a,   so that   H = f/cos a - W tan a.

Friction |f| <= mu N becomes  -mu W/(cos a - mu sin a) <= f <= mu W/(cos a + mu sin a): limits that go
with the place alone.  Before it slides, f grows by k r da.  The surface gives way by N/K, so that
r = R - N/K and the place is r sin a.
"""

import math

from scipy.integrate import quad
from scipy.optimize import brentq


class Block:
    """weight W (N), friction mu, spring k (N/m), radius R (m), surface K (N/m).

    At rest on the crown, unstrained.  angle (rad), force f (N), lost (J): where it is.
    """

    def __init__(self, weight, friction, spring, radius, surface):
        self.weight, self.friction, self.spring = weight, friction, spring
        self.radius, self.surface = radius, surface
        self.angle = self.force = self.lost = 0.0

    def limit(self, angle, way):
        """Friction (N) at which the block slides to the right (way 1) or left (-1)."""
        mu = self.friction
        return way * mu * self.weight / (math.cos(angle) + way * mu * math.sin(angle))

    def reach(self, angle, force):
        """r (m) at an angle under a friction."""
        normal = (self.weight - force * math.sin(angle)) / math.cos(angle)
        return self.radius - normal / self.surface

    def push(self, place):
        """Move the block straight to a place (m, to the right); the force H (N)."""
        here = self.reach(self.angle, self.force) * math.sin(self.angle)
        way = math.copysign(1.0, place - here)
        start, force = self.angle, self.force

        def stuck(a):
            return force + self.spring * self.reach(start, force) * (a - start)

        def friction(a):
            return way * min(way * stuck(a), way * self.limit(a, way))

        def ahead(a):
            return self.reach(a, friction(a)) * math.sin(a) - place

        self.angle = brentq(ahead, -1.0, 1.0, xtol=1e-15)
        self.force = friction(self.angle)
        if way * stuck(self.angle) > way * self.force:
            # It has slid since the spring met the limit, which itself went on.
            first = start
            if way * stuck(start) < way * self.limit(start, way):
                first = brentq(lambda a: stuck(a) - self.limit(a, way), start, self.angle)
            moved = quad(lambda a: self.limit(a, way) * self.reach(a, self.limit(a, way)),
                         first, self.angle)[0]  # fmt: skip
            sprung = 0.5 * (self.force**2 - self.limit(first, way) ** 2) / self.spring
            self.lost += moved - sprung
        return self.force / math.cos(self.angle) - self.weight * math.tan(self.angle)

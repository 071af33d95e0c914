"""Patterns of knit and purl stitches, and what follows from them: crossings, symmetry.

A pattern is a grid of k and p that repeats: rows are courses from the bottom up, columns are wales, as
seen from the technical face.  A stitch is knit where the new loop is drawn through the old one from back
to front, purl where it is drawn from front to back.

>>> Pattern.of("rib_2x2").rows
('kkpp',)
>>> Pattern.of("kp/pk") == Pattern.of("seed")
True
>>> [len(Pattern.of(name).symmetries()) for name in ("jersey", "garter", "rib_1x1", "seed")]
[4, 8, 4, 8]

A leg is half a loop: leg 2 i of a course goes up at stitch i, leg 2 i + 1 comes down.  It crosses the
course below where its own stitch is drawn through that, and the course above where the stitch above is
drawn through its loop; so the types of these two stitches say all about it.
"""

import functools
from dataclasses import dataclass

from knitsim.errors import InputError

NAMED = {
    "jersey": ("k",),
    "garter": ("k", "p"),
    "rib_1x1": ("kp",),
    "rib_2x2": ("kkpp",),
    "seed": ("kp", "pk"),
    "double_seed": ("kp", "kp", "pk", "pk"),
}
LARGEST = 8  # stitches along course and wale
# Codes 2 (courses up) + (1 if above) of an upward leg, with the course below and with that above.
_BELOW = {"k": (-2, -1), "p": (-1, -2)}
_ABOVE = {"k": (3, 2), "p": (2, 3)}
_OTHER = {"k": "p", "p": "k"}


@dataclass(frozen=True)
class Symmetry:
    """An operation that maps a pattern onto itself.

    A point goes to sign x + along a1 + up a2; a place u of course j, u counted in loops, to
    sign[0] u + along of course sign[1] j + up.  sign[2] is -1 where face and back are exchanged.
    """

    sign: tuple
    along: float
    up: int


@dataclass(frozen=True)
class Pattern:
    """rows: strings of k and p, courses from the bottom up; the smallest period."""

    rows: tuple

    @classmethod
    def of(cls, stated, where="pattern"):
        """From a name, rows joined by "/" or a list of rows.  Raises InputError."""
        if isinstance(stated, Pattern):
            return stated
        rows = NAMED.get(stated, stated) if isinstance(stated, str) else stated
        if isinstance(rows, str):
            rows = rows.replace(" ", "").split("/")
        known = (
            f"must be one of {', '.join(NAMED)}, or rows of k and p from the bottom up, as kp/pk"
        )
        if not isinstance(rows, (list, tuple)) or not rows:
            raise InputError(where, stated, known)
        rows = tuple(str(row) for row in rows)
        if not rows[0] or any(set(row) - {"k", "p"} or len(row) != len(rows[0]) for row in rows):
            raise InputError(where, stated, f"{known}; rows of equal length")
        if max(len(rows), len(rows[0])) > LARGEST:
            size = f"{len(rows[0])} x {len(rows)}"
            raise InputError(where, size, f"must be at most {LARGEST} x {LARGEST} stitches")
        return cls(rows).smallest()

    def smallest(self):
        """The same pattern with its smallest period."""
        rows = self.rows
        for wales in range(1, len(rows[0]) + 1):
            if len(rows[0]) % wales == 0 and all(
                row == row[:wales] * (len(row) // wales) for row in rows
            ):
                break
        for courses in range(1, len(rows) + 1):
            if len(rows) % courses == 0 and rows == rows[:courses] * (len(rows) // courses):
                break
        return Pattern(tuple(row[:wales] for row in rows[:courses]))

    def __str__(self):
        for name, rows in NAMED.items():
            if Pattern(rows) == self:
                return name
        return "/".join(self.rows)

    @property
    def wales(self):
        return len(self.rows[0])

    @property
    def courses(self):
        return len(self.rows)

    @property
    def uniform(self):
        """Whether all stitches are the same."""
        return self.wales == self.courses == 1

    @property
    def balanced(self):
        """Whether face and back are alike: nothing but the solver's error bends it at rest."""
        return any(one.sign[2] < 0 for one in self.symmetries())

    def stitch(self, wale, course):
        """k or p."""
        return self.rows[course % self.courses][wale % self.wales]

    def leg(self, leg, course):
        """Types of the stitches that a leg is part of: its own and the one above."""
        return self.stitch(leg // 2, course), self.stitch(leg // 2, course + 1)

    def crossings(self, leg, course):
        """Codes of the crossings along a leg, in the direction of the yarn."""
        own, above = self.leg(leg, course)
        codes = (*_BELOW[own], *_ABOVE[above])
        return codes if leg % 2 == 0 else codes[::-1]

    def _maps(self, one):
        """Whether a Symmetry maps every leg onto one that crosses the same way."""
        s0, s1, s2 = one.sign
        for course in range(self.courses):
            for leg in range(2 * self.wales):
                image = leg + round(2 * one.along)
                if s0 < 0:
                    image = round(2 * one.along) - leg - 1
                course_of_image = s1 * course + one.up
                types = self.leg(leg, course)
                types = types if s1 > 0 else types[::-1]
                types = types if s2 > 0 else tuple(_OTHER[t] for t in types)
                if self.leg(image, course_of_image) != types:
                    return False
        return True

    @functools.cache  # noqa: B019  a pattern is small and lives long
    def symmetries(self):
        """All :class:`Symmetry` but for translations by whole periods; the identity first.

        Upside down, heads become sinker arcs, so that the yarn is moved by half a loop.
        """
        found = []
        for s2 in (1, -1):
            for s1 in (1, -1):
                for s0 in (1, -1):
                    for up in range(self.courses):
                        for wale in range(self.wales):
                            along = wale + (0.0 if s1 > 0 else 0.5)
                            one = Symmetry((s0, s1, s2), along, up)
                            if self._maps(one):
                                found.append(one)
        return tuple(found)

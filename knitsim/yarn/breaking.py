"""Noise of a tensile record, and where in it the yarn breaks."""

import numpy as np

# A record that ends below this part of its largest force has seen the break.
_DROP = 0.9


def noise(strain, values):
    """Standard deviation of the scatter of ``values`` (n,) about a smooth curve over strain (n,).

    From the deviation of each point from the chord of its neighbours, by the median, so that kinks
    and drops do not count.
    """
    left, right = strain[1:-1] - strain[:-2], strain[2:] - strain[1:-1]
    width = left + right
    weight = np.where(width > 0, right / np.where(width > 0, width, 1.0), 0.5)
    chord = weight * values[:-2] + (1 - weight) * values[2:]
    scaled = (values[1:-1] - chord) / np.sqrt(1 + weight**2 + (1 - weight) ** 2)
    return 1.4826 * float(np.median(np.abs(scaled)))


def last_before_break(strain, force):
    """(index of the last point before the break, whether the record shows a break).

    The break is a drop by a tenth of the largest force, and by six times the noise, from which the
    force does not come back; points already falling on the way down are not counted as whole yarn.
    strain, force: (n,), n >= 3, rising strain.
    """
    scatter, largest = noise(strain, force), force.max()
    level = largest - max((1 - _DROP) * largest, 6 * scatter)
    last = int(np.flatnonzero(force >= level)[-1])
    if last == force.size - 1:
        return last, False
    top = int(np.argmax(force))
    while last > top and force[last] < force[last - 1] - 4 * scatter:
        last -= 1
    return last, True

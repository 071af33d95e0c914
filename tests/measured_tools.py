"""Measured tests made from arrays, for the tests of what is fitted to them."""

from knitsim.measured.test import MeasuredTest


def tension(name, direction, force, strain, *, low=None, high=None, weight=None, **more):
    """A tension test of a fabric: force per width (N/m) and strain, with a band and weights."""
    values = {"strain": strain, "force_per_width": force}
    for key, value in (("strain_low", low), ("strain_high", high), ("weight", weight)):
        if value is not None:
            values[key] = value
    return MeasuredTest("tension", values, direction=direction, name=name, **more)


def bending(name, direction, curvature, moment, **more):
    """A bending test: curvature (1/m) and moment per width (N)."""
    values = {"curvature": curvature, "moment_per_width": moment}
    return MeasuredTest("bending", values, direction=direction, name=name, **more)

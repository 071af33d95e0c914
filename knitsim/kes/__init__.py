"""KES parameters (Kawabata Evaluation System) of any curve, simulated or measured.

``knitsim.kes(test, to_force_gf_per_cm=None)`` reads a pull, bend, shear or measured test: of a pull EMT, LT,
WT and RT up to 50 gf/cm where it comes so far, else up to its largest force.

>>> import numpy as np
>>> from knitsim import kes
>>> strain = np.concatenate([np.linspace(0, 0.1, 101), np.linspace(0.1, 0, 101)[1:]])
>>> power = np.where(np.arange(201) <= 100, 2.0, 3.0)  # up, and back
>>> found = kes.tension(strain, kes.KNIT_FORCE * (strain / 0.1) ** power, max_force=kes.KNIT_FORCE)
>>> [round(found[name].kes_value, 9) for name in ("LT", "RT", "EMT")]
[0.666666667, 75.0, 10.0]

Three functions take the arrays of a test in SI, as they stand in a result file or in a measured test,
:func:`knitsim.measured.read.read_measured`: :func:`tension`, :func:`bending` and
:func:`shear`; ``tension_of``, ``bending_of`` and ``shear_of`` take single passes, which may also be
functions (:class:`FunctionPass`).  Each gives an :class:`Evaluation`: parameters in SI and gf units
with the definition used and an error estimate, and the reason for each parameter left out.  Nothing
is extrapolated.  Called, the module is that function of the library, :func:`knitsim.library.kes.kes`.
"""

import sys
from importlib import import_module
from types import ModuleType

from knitsim.kes.bending_test import bending, bending_of
from knitsim.kes.result import Evaluation, Parameter
from knitsim.kes.shear_test import shear, shear_of
from knitsim.kes.single_pass import FunctionPass, Pass, passes
from knitsim.kes.tensile_test import KNIT_FORCE, STANDARD_FORCE, tension, tension_of

__all__ = [
    "KNIT_FORCE",
    "STANDARD_FORCE",
    "Evaluation",
    "FunctionPass",
    "Parameter",
    "Pass",
    "bending",
    "bending_of",
    "passes",
    "shear",
    "shear_of",
    "tension",
    "tension_of",
]


class _Room(ModuleType):
    """The room and the function of the library have one name: ``knitsim.kes(test)``."""

    def __call__(self, *arguments, **options):
        # By name, since the library stands above this room.
        return import_module("knitsim.library.kes").kes(*arguments, **options)


sys.modules[__name__].__class__ = _Room

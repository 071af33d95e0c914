"""Cases with an exact answer, run by the solver of the fabric: value, exact value, observed order.

Every case is a scene of open yarns (:mod:`knitsim.equilibrium.open_yarn`) on the kernels of the
fabric, compared with :mod:`knitsim.verification.exact_rods`, ``exact_crimp``, ``exact_contacts``
and ``exact_friction``, which share nothing with the solver.
"""

import math

import numpy as np

from knitsim.verification import exact_crimp
from knitsim.verification.cases_contacts import capstan_case, crossing_case, wrapped_case
from knitsim.verification.cases_friction import incline_case, unloaded_capstan_case
from knitsim.verification.cases_rods import (
    crimp_case,
    hanging_case,
    own_weight_case,
    pulled_case,
    roll_up_case,
    strut_case,
    tip_load_case,
)


def cases():
    """All cases, in the order of the tables."""
    return (
        *(tip_load_case(load) for load in (1.0, 4.0, 10.0)),
        *(own_weight_case(load) for load in (10.0, 100.0)),
        roll_up_case(1.0, "1"),
        roll_up_case(math.pi, "pi"),
        roll_up_case(2.0 * math.pi, "2 pi"),
        *(strut_case(distance, "hinged") for distance in (0.8, 0.5)),
        *(strut_case(distance, "clamped") for distance in (0.8, 0.5)),
        crimp_case(
            "sine", exact_crimp.crimp_sine(0.8),
            lambda t: 0.4 * np.pi * np.cos(0.5 * np.pi * t), 5.0,
        ),
        crimp_case("arcs", exact_crimp.crimp_arcs(0.8), lambda t: 0.8 + 0.0 * t, 10.0),
        *(pulled_case(strain) for strain in (0.01, 0.05)),
        hanging_case(),
        capstan_case(0.3, math.pi),
        unloaded_capstan_case(0.3, math.pi),
        incline_case(0.3, 0.2),
        wrapped_case(math.pi, 4e-7, "line"),
        wrapped_case(0.3, 4e-7, "point"),
        crossing_case(),
    )  # fmt: skip

"""What the tests of a scene need, decided in one place; the rest is not computed.

The stages ask here.  What a skip saves and what it changes is measured with and without it by
:mod:`knitsim.stages.skipping`.
"""

from dataclasses import dataclass

SKIPS = {
    "contact pairs never near": "only pairs that can touch before the list is made anew are listed",
    "friction at zero coefficient": "no slip is followed where the coefficient is zero",
    "full cell": "of a cell only what the symmetry of pattern and test leaves is solved",
    "identical loops": "one loop stands for all of a uniform fabric",
    "identical sections": "one section stands for all of a uniform yarn",
    "fibres": "fibres are placed only where the scene stores them",
    "recovery": "without friction the way back is the way there",
    "states not asked for": "the solver's own steps are as long as the method allows, not kept",
    "rules not affected": "a rule runs again only if what its result depends on has changed",
}

QUARTER_TOLERANCE = 5e-3  # of the force, as long as the symmetric state is stable


@dataclass(frozen=True)
class Skip:
    """Something that one condition of one test does not need.

    test: section of the scene; condition: name of the variant, or empty; what: name in SKIPS.
    """

    test: str
    condition: str
    what: str

    @property
    def because(self):
        return SKIPS[self.what]


def stores_fibres(store):
    """Whether a kinematic test has fibres to place; store: what its scene stores."""
    return "fibres" in store


def solves_recovery(choice):
    """Whether a tensile condition has a way back of its own; choice: the variant's settings."""
    return choice["recovery"] and choice["friction"]


def skips_of(scene):
    """Skips (a list) of all tests that a scene of a fabric asks for."""
    found = []
    for test in ("kinematic_tension", "kinematic_bending"):
        choice = scene.values.get(test)
        if choice is not None and not stores_fibres(choice["store"]):
            found.append(Skip(test, "", "fibres"))
    for test in (
        "equilibrium_rest",
        "equilibrium_tension",
        "equilibrium_bending",
        "equilibrium_shear",
    ):
        choice = scene.values.get(test)
        if choice is None:
            continue
        everywhere = ["contact pairs never near", "identical loops"]
        if scene["equilibrium_rest"]["cell"] == "symmetric":
            everywhere.append("full cell")
        found += [Skip(test, "", what) for what in everywhere]
        conditions = choice["variants"] if "variants" in choice else {"": choice}
        for name, condition in conditions.items():
            if test != "equilibrium_rest" and not condition["friction"]:
                found += [
                    Skip(test, name, "friction at zero coefficient"),
                    Skip(test, name, "states not asked for"),
                ]
            if condition.get("recovery") and not solves_recovery(condition):
                found.append(Skip(test, name, "recovery"))
    found.append(Skip("tensile_test", "", "identical sections"))
    if scene.needs_loop:
        found.append(Skip("", "", "rules not affected"))
    return found

"""The keys of what friction remembers: its laws, what was done to a fabric, programmes of loads."""

from knitsim.study.keys import Key

# Stages that follow friction.
FOLLOWED = (
    "equilibrium_tension", "equilibrium_shear", "equilibrium_bending", "calibration", "sensitivity",
)  # fmt: skip

# fmt: off
FRICTION_KEYS = (
    Key("tangential_stiffness_ratio", "tangential_ratio", "number", "Stiffness of a contact along the yarns "
        "before they slide, over that across them where they first touch.", allowed="[1e-3, 1e3]",
        default=1.0, plausible=(0.67, 2.0), stages=FOLLOWED,
        because="not stated; equal elastic bodies have 0.67 to 1 (Mindlin 1949), a hairy shell more"),
    Key("bending_hysteresis_mN_mm", "bending_hysteresis", "number", "Couple by which the moment of "
        "the bent yarn lags behind its curvature, half the width of its loop; used in tests with friction.",
        unit="mN_mm", allowed="[0, 1e6]", default=0.0, stages=FOLLOWED),
    Key("no_slip_rigidity_ratio", "stuck_ratio", "number", "How much stiffer the yarn bends before its "
        "fibres slide on each other, over its bending rigidity; matters with bending hysteresis only.",
        allowed="[1e-3, 1e6]", default=20.0, stages=FOLLOWED),
)

HISTORY = Key("history", "history", "history", "What was done to the fabric before each test with friction. "
    "as_knitted: nothing, it lies as it came to rest. relaxed_by_shaking: pulled both ways in turn, less "
    "each time. Or steps, after each of which it is released: `[{direction: course, strain: 0.3, times: "
    "1}]`; instead of strain force_gf_per_cm or force_N_per_mm.", default="as_knitted", stages=FOLLOWED)

PROGRAMME = Key("programme", "programme", "turns", "Instead of loading to the largest strain: turning points "
    "to which the fabric is pulled one after the other, `[{strain: 0.3}, {strain: 0.15}, {strain: 0.3}, "
    "release]`; force_gf_per_cm or force_N_per_mm are forces per width, release is no force. cycles "
    "repeats it, states are stored on the way to each strain.")

REST_LINE = Key("rest_line", "rest_line", "flag", "Also find the spacings between which friction lets the "
    "fabric lie at rest: pulled along the one way and the other, and released.", default=True)
# fmt: on

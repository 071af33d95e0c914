"""Checks of a fabric's measured curves and calibrations that need more than one key."""

from dataclasses import dataclass

from knitsim import units
from knitsim.equilibrium.contact import LAWS
from knitsim.errors import InputError
from knitsim.study.check import shown
from knitsim.study.measured_keys import (
    GIVEN,
    MOST_FREE,
    PARAMETERS,
    STAGE,
    key_name,
)

# Bounds of a parameter without a range in the ledger, as factors of its value; from 0 to 1 if it is 0.
FACTORS = (0.5, 2.0)
# A core as thick as the yarn leaves no shell.
THICKEST_CORE = 0.98


@dataclass(frozen=True)
class Free:
    """A free parameter: name (of PARAMETERS), start, low and high in SI."""

    name: str
    start: float
    low: float
    high: float


def names_of(fabric, on_request=None):
    """Names of the calibrations that a FabricInput is predicted with, that as given first; none without
    measured curves, of its own or of the fabric that it is calibrated on.

    on_request: only those that are (True), or are not (False), made on request.
    """
    source = fabric.calibrated_on or fabric
    if not source["measured"]:
        return []
    given = [] if on_request else [GIVEN]
    return given + [
        name for name, entry in source["calibrations"].items()
        if on_request in (None, entry["on_request"])
        and (source is fabric or _of_yarn(entry["free"]))
    ]  # fmt: skip


def _of_yarn(free):
    """Whether parameters, one or more, are all of the yarn."""
    return bool(free) and all(PARAMETERS[name].is_of_yarn for name in free)


def inferred_of(fabric, on_request=None):
    """Those of :func:`names_of` that have no free parameters: every input is uncertain."""
    own = {} if fabric.calibrated_on else fabric["calibrations"]
    return [n for n in names_of(fabric, on_request) if n in own and not own[n]["free"]]


def config_of(fabric, name):
    """What the result of one calibration depends on, as plain data; other calibrations do not matter.

    fabric: FabricInput; name: of a calibration, or GIVEN.
    """
    config = fabric.config(STAGE)
    own = {key: value for key, value in fabric["calibrations"].items() if key == name}
    config["values"] = config["values"] | {"calibrations": own}
    if fabric.calibrated_on is not None:
        config["calibrated_on"] = config_of(fabric.calibrated_on, name)
    return config


def calibrate_on(fabric, fabrics):
    """Tell a FabricInput on which of the ``fabrics`` (by name) it is calibrated, if its study says so.

    Raises InputError for one that does not exist, has another yarn or no calibration.
    """
    name = (fabric["prediction"] or {}).get("calibrated_on")
    if name is None:
        return
    key, other = fabric.where("prediction.calibrated_on"), fabrics.get(name)
    if other is None or other is fabric:
        raise InputError(key, name, "must be another fabric of the study")
    if other.yarn.name != fabric.yarn.name:
        raise InputError(key, name, f"must be of the same yarn, {fabric.yarn.name}")
    if not other["calibrations"]:
        raise InputError(key, name, "must be a fabric with calibrations")
    fabric.calibrated_on = other


def meaningless(yarn, name):
    """Why the parameter ``name`` has no meaning for a YarnInput; "" where it has."""
    laws = [law for law in (*LAWS, "compression_curve") if yarn[law] is not None]
    return PARAMETERS[name].meaningless(laws)


def value_of(fabric, name):
    """SI value of the parameter ``name`` of a FabricInput."""
    one = PARAMETERS[name]
    *sections, key = one.key.removeprefix("yarn.").split(".")
    owner = fabric.yarn if one.is_of_yarn else fabric
    section = owner.section
    for part in sections:
        section = section.section(part)
    return owner[".".join([*sections, section.key(key).quantity])]


def free_of(fabric, calibration):
    """The parameters (Free) that a calibration of a FabricInput frees; calibration: its name.

    Raises InputError for bounds that do not hold the start.
    """
    entry = fabric["calibrations"][calibration]
    where = fabric.where(f"calibrations.{calibration}.bounds")
    return [free_parameter(fabric, name, entry["bounds"] or {}, where) for name in entry["free"]]


def free_parameter(fabric, name, bounds, where):
    """The parameter (Free) of that name; bounds: {name: (low, high) in SI} of those stated."""
    one, start = PARAMETERS[name], value_of(fabric, name)
    low, high = bounds.get(name) or _range_of(fabric, name, start)
    if not bounds.get(name):
        low = max(low, one.least_free)
        high = min(high, THICKEST_CORE * fabric.yarn["diameter"]) if one.within_yarn else high
    if not low <= start <= high:
        unit = f" {units.label(one.unit)}" if one.unit else ""
        ends = " to ".join(f"{_from_si(v, one.unit):.6g}" for v in (low, high))
        raise InputError(
            f"{where}.{key_name(name)}", ends,
            f"must hold the value to start from, {_from_si(start, one.unit):.6g}{unit} ({one.key})",
        )  # fmt: skip
    return Free(name, start, low, high)


def _range_of(fabric, name, start):
    """The range in the ledger, or that by FACTORS (SI)."""
    one = PARAMETERS[name]
    for row in fabric.assumptions():
        if row.path == one.key and row.low is not None and row.low < row.high:
            return tuple(_to_si(v, one.unit) for v in (row.low, row.high))
    if start == 0.0:
        return 0.0, _to_si(min(one.high, 1.0), one.unit)
    low, high = (factor * start for factor in FACTORS)
    return max(low, _to_si(one.low, one.unit)), min(high, _to_si(one.high, one.unit))


def _to_si(value, unit):
    return units.to_si(value, unit) if unit else value


def _from_si(value, unit):
    return units.from_si(value, unit) if unit else value


def check_measured(fabric):
    """Raises InputError if the calibrations of a FabricInput contradict it; reads no curve."""
    measured, calibrations = fabric["measured"], fabric["calibrations"]
    if (measured or calibrations) and fabric.scene["equilibrium_rest"] is None:
        raise InputError(
            fabric.where("measured" if measured else "calibrations"), None,
            f"needs a scene with equilibrium_rest: {fabric.scene.name} has none",
        )  # fmt: skip
    for name, entry in measured.items():
        _ = fabric.measured_paths(name)
        if entry["test"] == "bending":
            for key in ("gauge_length", "width", "pretension", "machine_compliance"):
                if entry[key] is not None:
                    raise InputError(
                        fabric.where(f"measured.{name}.{key}"), None,
                        "is of a tension test, not of bending",
                    )  # fmt: skip
    for name, entry in calibrations.items():
        here = f"calibrations.{name}"
        if name == GIVEN:
            raise InputError(
                fabric.where(here), None,
                "is the name of the prediction without calibration; take another one",
            )  # fmt: skip
        for section in ("range", "tolerance"):
            if entry["free"] and any(v is not None for v in (entry[section] or {}).values()):
                raise InputError(
                    fabric.where(f"{here}.{section}"), None,
                    "is of a calibration without free parameters: take free or this away",
                )  # fmt: skip
        _check_uncertain(fabric, here, entry)
        if len(entry["free"]) > MOST_FREE:
            raise InputError(
                fabric.where(f"{here}.free"), shown(", ".join(entry["free"])),
                f"must be at most {MOST_FREE}: one curve decides no more",
            )  # fmt: skip
        for curve in entry["fit"]:
            if curve not in measured:
                known = f"measured has: {', '.join(measured)}" if measured else "none is measured"
                raise InputError(
                    fabric.where(f"{here}.fit"), shown(curve), f"no such measured curve; {known}"
                )
        _check_free(fabric, here, entry)
        free_of(fabric, name)


def _check_uncertain(fabric, here, entry):
    ranges, tolerances = entry["range"] or {}, entry["tolerance"] or {}
    for name, pair in ranges.items():
        if pair is None:
            continue
        key = f"{here}.range.{key_name(name) if name in PARAMETERS else name}"
        if len(pair) != 2 or not pair[0] <= pair[1]:
            raise InputError(fabric.where(key), shown(list(pair)), "must be [lowest, highest]")
        if tolerances.get(name) is not None:
            raise InputError(
                fabric.where(key), None, f"{name} has a tolerance as well: take one of them away"
            )
    for name in {n for n, v in (ranges | tolerances).items() if v is not None} & set(PARAMETERS):
        why = meaningless(fabric.yarn, name)
        if why:
            raise InputError(fabric.where(here), name, f"{why} ({fabric.yarn.name})")


def assumed_of(fabric):
    """What the ledger says of inputs that nobody gave: {parameter: (low, high, because)}, SI."""
    found = {}
    for row in fabric.assumptions():
        for name, one in PARAMETERS.items():
            if row.path == one.key and row.low is not None and row.low < row.high:
                found[name] = (*(_to_si(v, one.unit) for v in (row.low, row.high)), row.because)
    return found


def _check_free(fabric, here, entry):
    for name in entry["free"]:
        why = meaningless(fabric.yarn, name)
        if why:
            raise InputError(fabric.where(f"{here}.free"), name, f"{why} ({fabric.yarn.name})")
    for name, pair in (entry["bounds"] or {}).items():
        if pair is None:
            continue
        key = f"{here}.bounds.{key_name(name)}"
        if name not in entry["free"]:
            raise InputError(
                fabric.where(key), None,
                f"{name} is not free; free are: {', '.join(entry['free'])}",
            )  # fmt: skip
        if len(pair) != 2 or not pair[0] < pair[1]:
            stated = [float(f"{_from_si(v, PARAMETERS[name].unit):.6g}") for v in pair]
            raise InputError(fabric.where(key), shown(stated), "must be [lowest, highest]")

"""Turning points of a programme of loads and the history of a fabric, as a study states them."""

from knitsim import units
from knitsim.errors import InputError

RELEASE = "release"
HISTORIES = ("as_knitted", "relaxed_by_shaking")
LOWEST, HIGHEST = -0.5, 5.0  # strain
MOST_TIMES = 1000
_FORCES = {"force_gf_per_cm": "gf_per_cm", "force_N_per_mm": "N_per_mm"}
_KNOWN = ("strain", *_FORCES)


def check_turns(raw, where):
    """Turning points as plain data in SI, [{"strain": 1} or {"force": N/m}].  Raises InputError."""
    if not isinstance(raw, list) or not raw:
        raise InputError(where, _shown(raw), f"must be a list of turning points: {_turns()}")
    return [_turn(one, f"{where}[{i}]") for i, one in enumerate(raw)]


def _turns():
    return f"{{{'} or {'.join(f'{name}: ...' for name in _KNOWN)}}}, or {RELEASE}"


def _turn(raw, where):
    if raw == RELEASE:
        return {"force": 0.0}
    if not isinstance(raw, dict) or len(raw) != 1 or next(iter(raw)) not in _KNOWN:
        raise InputError(where, _shown(raw), f"must be one turning point: {_turns()}")
    ((name, value),) = raw.items()
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) >= 1e6:
        raise InputError(f"{where}.{name}", _shown(value), "must be a number")
    if name == "strain":
        if not LOWEST <= value <= HIGHEST:
            right = f"must be at least {LOWEST:g} and at most {HIGHEST:g} (engineering strain)"
            raise InputError(f"{where}.{name}", value, right)
        return {"strain": float(value)}
    return {"force": units.to_si(value, _FORCES[name])}


def check_history(raw, where):
    """A name of HISTORIES, or steps [{"direction", "turn", "times"}].  Raises InputError."""
    if raw in HISTORIES:
        return raw
    if not isinstance(raw, list) or not raw:
        raise InputError(
            where, _shown(raw), f"must be {' or '.join(HISTORIES)}, or a list of steps as "
            "{direction: course, strain: 0.3, times: 1}",
        )  # fmt: skip
    return [_step(one, f"{where}[{i}]") for i, one in enumerate(raw)]


def _step(raw, where):
    if not isinstance(raw, dict):
        raise InputError(
            where, _shown(raw), "must be a step as {direction: course, strain: 0.3, times: 1}"
        )
    rest = dict(raw)
    direction, times = rest.pop("direction", None), rest.pop("times", 1)
    if direction not in ("course", "wale"):
        raise InputError(f"{where}.direction", _shown(direction), "must be course or wale")
    if isinstance(times, bool) or not isinstance(times, int) or not 1 <= times <= MOST_TIMES:
        right = f"must be a whole number from 1 to {MOST_TIMES}"
        raise InputError(f"{where}.times", _shown(times), right)
    return {"direction": direction, "turn": _turn(rest, where), "times": times}


def _shown(raw):
    return None if raw is None else str(raw)

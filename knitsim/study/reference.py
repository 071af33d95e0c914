"""The key reference in config/README.md, written from the table of keys.

``python -m knitsim.study.reference`` brings the file up to date.
"""

import sys
from pathlib import Path

from knitsim import units
from knitsim.study.keys import REQUIRED
from knitsim.study.schema import FABRIC, SCENE, YARN

BEGIN = "<!-- begin of the key reference, written by knitsim.study.reference -->"
END = "<!-- end of the key reference -->"


def key_reference():
    """The reference as Markdown: one table for each section."""
    lines = []
    for section, file in ((YARN, "yarns.yaml"), (FABRIC, "fabrics.yaml"), (SCENE, "scenes.yaml")):
        lines += _section(section, f"Keys of `{file}`", 3)
    return "\n".join(lines)


def _section(section, title, level):
    lines = [f"{'#' * level} {title}", "", section.about, ""]
    if section.keys:
        lines += ["| key | what it is | unit | allowed | default |", "|---|---|---|---|---|"]
        for keys in section.quantities().values():
            lines += [_row(key, keys[0], len(keys) > 1) for key in keys]
        lines.append("")
    if section.default_entries:
        lines += ["If left out:", "", "```yaml", f"{section.name}:"]
        for name, entry in section.default_entries.items():
            stated = ", ".join(f"{key}: {_text(value)}" for key, value in entry.items())
            lines.append(f"  {name}: {{{stated}}}")
        lines += ["```", ""]
    for inner in section.sections:
        lines += _section(inner, f"`{inner.name}`", level + 1)
    return lines


def _row(key, main, has_alternatives):
    about = key.about + (f" Only with kind {' or '.join(key.when)}." if key.when else "")
    unit = units.label(key.unit) if key.unit or key.kind in ("number", "numbers") else ""
    allowed = str(key.interval) if key.interval else ", ".join(key.choices)
    if key.kind == "flag":
        allowed = "true, false"
    elif key.kind == "choices":
        allowed = f"list of {allowed}"
    default = _default(key) if key is main else f"or {main.name}"
    if key is main and has_alternatives and key.default is REQUIRED:
        default = "needed, in one of its units"
    return f"| `{key.name}` | {about} | {unit} | {allowed} | {default} |"


def _default(key):
    if key.default is REQUIRED:
        return "needed"
    if key.default is None:
        return "none"
    rule = callable(key.default)
    value = key.default.__doc__.rstrip(".") if rule else _text(key.default)
    if not key.because:
        return value
    plausible = ""
    if key.plausible:
        low, high = key.plausible
        plausible = f"; plausible: {low:g} to {high:g}{' times that' if rule else ''}"
    return f"{value}, assumed: {key.because}{plausible}"


def _text(value):
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else f"{value:.6g}"


def updated(text):
    """``text`` of config/README.md with the reference between its two marks written anew."""
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{key_reference()}\n{END}{after}"


def main(path="config/README.md"):
    """Bring the file at ``path`` up to date."""
    readme = Path(path)
    readme.write_text(updated(readme.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

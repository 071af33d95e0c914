"""No file is misread: one known curve, rewritten in 500 ways, is the same curve or a question."""

import numpy as np
import pytest

from knitsim.errors import InputError
from knitsim.measured.read import read_measured

GAUGE, WIDTH, DENSITY = 0.12, 0.05, 30e-6  # m, m, kg/m
PULLED = np.linspace(0.0, 0.48, 33)
STRAIN = {
    "tension": np.concatenate([PULLED, PULLED[-2::-3]]),
    "yarn_tension": np.linspace(0.0, 0.064, 41),
}
FORCE = {  # N
    "tension": np.concatenate([
        1.1 * PULLED + 18.0 * PULLED**4,
        0.8 * (1.1 * PULLED + 18.0 * PULLED**4)[-2::-3] * (PULLED / 0.48)[-2::-3],
    ]),
    "yarn_tension": np.interp(STRAIN["yarn_tension"], [0.0, 0.02, 0.064], [0.0, 1.5, 3.4]),
}  # fmt: skip
# Names and units of x and y: {unit: what a value in SI is multiplied with}.
STRAINS = {"%": 100.0, "mm/mm": 1.0}
LENGTHS = {"mm": 1e3 * GAUGE, "cm": 1e2 * GAUGE, "in": GAUGE / 0.0254, "m": GAUGE}
FORCES = {
    "N": 1.0, "cN": 1e2, "mN": 1e3, "kN": 1e-3, "gf": 1e3 / 9.80665, "g": 1e3 / 9.80665,
    "kgf": 1.0 / 9.80665, "lbf": 1.0 / 4.4482216152605,
}  # fmt: skip
PER_WIDTH = {
    "N/m": 1.0 / WIDTH, "N/mm": 1e-3 / WIDTH, "gf/cm": 1e1 / 9.80665 / WIDTH, "N/5cm": 0.05 / WIDTH,
}  # fmt: skip
TENACITIES = {
    "cN/tex": 1e2 / 30.0, "N/tex": 1.0 / 30.0, "cN/dtex": 1e2 / 300.0, "g/den": 1e3 / 9.80665 / 270.0,
}  # fmt: skip
X_NAMES = {
    "strain": (
        "Strain",
        "Tensile strain",
        "Dehnung",
        "Elongation",
        "Déformation",
        "Nominal strain",
    ),
    "extension": (
        "Extension",
        "Displacement",
        "Crosshead",
        "Standardweg",
        "Verlängerung",
        "Allongement",
    ),
}
Y_NAMES = ("Force", "Load", "Standardkraft", "Kraft", "Tensile load", "Charge", "Axial Force")
EXTRA = (
    ("Time", "s"),
    ("Prüfzeit", "s"),
    ("Strain rate", "1/s"),
    ("Temperature", "°C"),
    ("Tensile stress", "MPa"),
)
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252", "latin-1")
SUMMARIES = (
    ["Mean", "12,3"],
    ["Mittelwert", "1.5"],
    ["S.D.", "0,4"],
    ["Maximum", "33"],
    ["Coefficient of variation", "7"],
)


class Rewritten:
    """A way to write the curve, drawn by ``rng``; text: bytes of the file, digits: of its numbers."""

    def __init__(self, rng):
        self.rng = rng
        self.kind = self.one(["tension", "tension", "yarn_tension"])
        self.delimiter = self.one(";;\t\t,|")
        self.comma = self.delimiter != "," and self.chance(0.6)
        self.quoted = self.chance(0.25)
        if self.quoted and self.delimiter == ",":
            self.comma = self.chance(0.5)
        self.noise = 0.004 if self.chance(0.2) else 0.0
        self.minus, self.blank_lines, self.capitals = (self.chance(0.2) for _ in range(3))
        self.columns, self.exponents = [], False
        self.place_curve()
        self.bytes = self.write()

    def one(self, options):
        return options[int(self.rng.integers(len(options)))]

    def chance(self, part):
        return bool(self.rng.random() < part)

    def place_curve(self):
        """Columns (name, unit, numbers, decimals) in a random order, the conditions that they need."""
        rng, fabric = self.rng, self.kind == "tension"
        strain, force = STRAIN[self.kind].copy(), FORCE[self.kind].copy()
        if self.chance(0.2):  # rows doubled, some or all
            some = rng.choice(len(strain), 5) if self.chance(0.5) else np.arange(len(strain))
            twice = np.sort(np.concatenate([np.arange(len(strain)), some]))
            strain, force = strain[twice], force[twice]
        if self.noise:
            force = force + self.noise * force.max() * rng.normal(size=len(force)) * (strain > 0)
            strain = strain + self.noise * strain.max() * rng.normal(size=len(strain)) * (
                strain > 0
            )
        self.strain, self.force = strain, force
        self.conditions = []
        self.x = "extension" if self.chance(0.6) else "strain"
        units = LENGTHS if self.x == "extension" else STRAINS
        self.x_unit = self.one(list(units))
        choices = [FORCES, PER_WIDTH if fabric else TENACITIES]
        units_y = choices[int(self.chance(0.3))]
        self.y_unit = self.one(list(units_y))
        x_name = self.one(X_NAMES[self.x])
        y_name = self.one(Y_NAMES)
        x, y = strain * units[self.x_unit], force * units_y[self.y_unit]
        # As many digits as tell neighbours apart.
        digits = [int(max(0, np.ceil(-np.log10(1e-4 * np.ptp(v))))) for v in (x, y)]
        self.rounding = [
            0.51 * 10.0**-d / scale
            for d, scale in zip(digits, (units[self.x_unit], units_y[self.y_unit]), strict=True)
        ]
        self.as_written = np.round(x, digits[0])
        self.columns = [(x_name, self.x_unit, x, digits[0]), (y_name, self.y_unit, y, digits[1])]
        for name, unit in EXTRA:
            if self.chance(0.3):
                self.columns.append((name, unit, np.arange(len(x)) * 0.25, 2))
        rng.shuffle(self.columns)
        if self.x == "extension":
            self.conditions.append(
                ("gauge_length_mm", "Gauge length", "Einspannlänge", 1e3 * GAUGE, "mm")
            )
        if fabric and units_y is FORCES:
            self.conditions.append(("width_mm", "Width", "Probenbreite", 1e3 * WIDTH, "mm"))
        if not fabric and units_y is TENACITIES:
            self.conditions.append(
                ("linear_density_tex", "Linear density", "Feinheit", 1e6 * DENSITY, "tex")
            )

    def number(self, value, digits):
        text = f"{value:.{digits}e}" if self.exponents else f"{value:.{digits}f}"
        if self.thousands and abs(value) >= 1000:
            whole, point, rest = text.partition(".")
            sign = "." if self.comma else ","
            groups = f"{int(whole):,}".replace(",", "\0")
            return groups.replace("\0", sign) + ("," if self.comma else ".") * bool(point) + rest
        return text.replace(".", ",") if self.comma else text

    def cell(self, text, quoted):
        return f'"{text}"' if quoted else text

    def write(self):
        lines, width = [], len(self.columns)
        self.thousands = self.chance(0.1) and (self.delimiter != "," or self.quoted)
        style = self.one(["bracket", "square", "row", "snake", "in"])
        pad = self.one([0, 0, 1, 3])
        preamble = self.one(["comment", "cells", "cells"])

        def add(cells):
            quoted = self.quoted
            row = [self.cell(cell, quoted and cell != "") for cell in cells]
            lines.append(self.delimiter.join(row + [""] * pad))

        if self.delimiter in ",;" and self.chance(0.15):
            lines.append(f"sep={self.delimiter}")
        if self.chance(0.4):
            lines.append(
                "# "
                + self.one(["Prüfling 3, Länge in mm", "made on 12.03.2024", "wale 3: second bath"])
            )
        elif self.chance(0.4):
            add(["Specimen label", "WALE-01"])
        for key, english, german, value, unit in self.conditions:
            digits = self.one([0, 1, 2])
            text = self.number(value, digits)
            if preamble == "comment":
                lines.append(f"# {key}: {text}" + self.delimiter * pad)
            elif self.chance(0.5):
                add([self.one([english, german]), text, unit])
            else:
                add([f"{self.one([english, german])} ({unit})", text])
        if self.chance(0.4):
            lines.append("")
        names, units = [], []
        for name, unit, _, _ in self.columns:
            snake = {"extension": "extension", "strain": "strain"}.get(
                self.x if name in sum(X_NAMES.values(), ()) else ""
            )
            if style == "snake" and (snake or name in Y_NAMES):
                family = snake or (
                    "force"
                    if unit in FORCES
                    else "force_per_width"
                    if unit in PER_WIDTH
                    else "tenacity"
                )
                spelt = unit.replace("%", "percent").replace("/", "_per_")
                names.append(family if unit == "mm/mm" else f"{family}_{spelt}")
            elif style == "row":
                names.append(name)
                units.append(f"({unit})" if self.quoted else unit)
            else:
                names.append(
                    {"square": f"{name} [{unit}]", "in": f"{name} in {unit}"}.get(
                        style, f"{name} ({unit})"
                    )
                )
        add([name.upper() if self.capitals and style == "row" else name for name in names])
        if style == "row":
            add(units)
        middle = len(self.strain) // 2
        for i in range(len(self.strain)):
            row = [self.number(values[i], digits) for _, _, values, digits in self.columns]
            if self.minus:
                row = [cell.replace("-", "−") for cell in row]
            add(row)
            if i == middle and self.blank_lines:
                add([""] * width)
            if i == middle + 3 and self.blank_lines:
                lines.append("# paused here")
        if self.chance(0.3):
            add([])
            for summary in SUMMARIES[: int(self.rng.integers(1, 5))]:
                add(summary)
        for _ in range(int(self.rng.integers(0, 3))):
            lines.append(self.delimiter * self.one([0, width - 1]))
        text = self.one(["\n", "\r\n", "\r\n", "\r"]).join(lines) + self.one(["", "\n"])
        encoding = self.one(ENCODINGS)
        try:
            return text.encode(encoding)
        except UnicodeEncodeError:
            return text.encode("utf-8")


def outcome(seed, folder):
    """("read", "") of the same curve, ("asked", line) or ("wrong", why) of one rewriting."""
    rng = np.random.default_rng(seed)
    written = Rewritten(rng)
    path = folder / f"curve{seed}.csv"
    path.write_bytes(written.bytes)
    fabric = written.kind == "tension"
    try:
        test = read_measured(path, written.kind, "wale" if fabric else "")
    except InputError as error:
        assert "\n" not in str(error)
        return "asked", str(error)
    y, scale = ("force_per_width", WIDTH) if fabric else ("force", 1.0)
    # A yarn's points are sorted by the strain that stands in the file.
    order = np.arange(len(written.strain))
    order = order if fabric else np.argsort(written.as_written, kind="stable")
    for found, true, rounding in (
        (test["strain"], written.strain[order], written.rounding[0]),
        (test[y] * scale, written.force[order], written.rounding[1]),
    ):
        if len(found) != len(true):
            return "wrong", f"{len(found)} points of {len(true)}"
        apart = np.abs(found - true).max()
        if apart > rounding + 1e-9 * np.abs(true).max():
            return "wrong", f"{apart:.3g} apart, rounded to {rounding:.3g}"
    return "read", ""


def tell(seeds, folder):
    found = {"read": 0, "asked": [], "wrong": []}
    for seed in seeds:
        how, why = outcome(seed, folder)
        if how == "read":
            found["read"] += 1
        else:
            found[how].append((seed, why))
    return found


def test_forty_rewritings_are_the_same_curve_or_a_question(tmp_path):
    found = tell(range(40), tmp_path)
    assert not found["wrong"], found["wrong"]
    assert found["read"] >= 38, found["asked"]


@pytest.mark.slow
def test_five_hundred_rewritings_are_the_same_curve_or_a_question(tmp_path):
    found = tell(range(1000, 1500), tmp_path)
    assert not found["wrong"], found["wrong"]
    assert found["read"] >= 475, found["asked"]

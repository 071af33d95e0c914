"""The tree shows the method: imports run in one direction only."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "knitsim"
FOUNDATION = ("errors", "units", "files", "provenance", "jit")
ORDER = (
    "store", "measured", "yarn", "loop", "kinematic", "equilibrium", "kes", "study", "inference",
    "verification", "benchmark", "figures", "stages", "library", "command",
)  # fmt: skip
# Neither model knows the other, figures know files only, and the readers of files know no model.
APART = {
    "equilibrium": {"kinematic"},
    "loop": {"measured"},
    "kes": {"kinematic"},
    "verification": {"inference", "study"},
    "figures": {
        "measured",
        "yarn",
        "kinematic",
        "equilibrium",
        "kes",
        "study",
        "inference",
        "verification",
        "benchmark",
    },
}


def modules():
    return sorted(path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE)


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module or ""
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("path", modules(), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_imports_run_one_way(path):
    own = path.relative_to(PACKAGE).parts[0]
    for name in imported(path):
        if not name.startswith("knitsim."):
            continue
        other = name.split(".")[1]
        if other in FOUNDATION:
            continue
        assert ORDER.index(other) <= ORDER.index(own), f"{own} imports {name}"
        assert other not in APART.get(own, ()), f"{own} imports {name}"


def test_the_foundation_knows_nothing_above_it():
    for name in FOUNDATION:
        for other in imported(PACKAGE / f"{name}.py"):
            assert not other.startswith("knitsim.") or other.split(".")[1] in FOUNDATION


def test_only_jit_imports_numba():
    for path in modules():
        assert "numba" not in {name.split(".")[0] for name in imported(path)}, path


def test_files_are_short_enough_to_be_read():
    assert {
        path for path in PACKAGE.rglob("*.py") if len(path.read_text().splitlines()) > 450
    } == set()

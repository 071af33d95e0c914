"""The hashes that decide what is made again, on packages built for it and on knitsim itself."""

import importlib.util
import json
import shutil
import subprocess
import sys

import pytest

from knitsim import provenance
from knitsim.provenance import kernel_hash, module_closure, source_hash

SOURCES = {
    "__init__.py": "",
    "jit.py": "def njit(function):\n    return function\n\nCACHE_DIR = None\n",
    "top.py": "from knitsim.middle import value\n",
    "middle.py": "def value():\n    from knitsim.parts import deep\n\n    return deep.number\n",
    "parts/__init__.py": "",
    "parts/deep.py": "import math\nimport os.path as knitsim_path\n\nnumber = math.pi\n",
    "parts/other.py": "from knitsim import apart\n",
    "apart.py": "",
    "kernels.py": "from knitsim.jit import njit\nfrom knitsim.constants import SIZE\n",
    "constants.py": "SIZE = 3\n",
    "cache.py": "from knitsim.jit import CACHE_DIR\nimport knitsim.apart\n",
}


@pytest.fixture
def package(tmp_path):
    """A package named knitsim with a copy of the module under test: (folder, load it afresh)."""
    folder = tmp_path / "knitsim"
    for name, text in SOURCES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    shutil.copy(provenance.__file__, folder / "provenance.py")

    def load():
        spec = importlib.util.spec_from_file_location("provenance_copy", folder / "provenance.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return folder, load


def test_closure_follows_imports_of_every_form(package):
    closure = package[1]().module_closure
    assert closure("knitsim.top") == [
        "knitsim", "knitsim.middle", "knitsim.parts", "knitsim.parts.deep", "knitsim.top",
    ]  # fmt: skip
    # "from knitsim import apart" names a module, "import knitsim.apart" as well.
    assert "knitsim.apart" in closure("knitsim.parts.other")
    assert "knitsim.apart" in closure("knitsim.cache")
    assert closure("knitsim.apart") == ["knitsim", "knitsim.apart"]
    assert closure("knitsim.top", "knitsim.apart") == sorted(
        {*closure("knitsim.top"), *closure("knitsim.apart")}
    )


def test_a_circle_of_imports_ends(package):
    folder, load = package
    (folder / "apart.py").write_text("import knitsim.parts.other\n")
    assert "knitsim.parts.other" in load().module_closure("knitsim.apart")


def test_unknown_module_and_relative_import_are_errors(package):
    folder, load = package
    with pytest.raises(ValueError, match=r"no module named knitsim\.nowhere"):
        load().module_closure("knitsim.nowhere")
    (folder / "middle.py").write_text("from .parts import deep\n")
    with pytest.raises(SyntaxError, match=r"knitsim\.middle: relative imports"):
        load().module_closure("knitsim.top")


@pytest.mark.parametrize(
    ("edited", "changed"),
    [
        ("top.py", True),
        ("middle.py", True),
        ("parts/deep.py", True),
        ("parts/__init__.py", True),
        ("__init__.py", True),
        ("parts/other.py", False),
        ("apart.py", False),
        ("kernels.py", False),
    ],
)
def test_source_hash_changes_with_what_is_imported_only(package, edited, changed):
    folder, load = package
    before = load().source_hash("knitsim.top")
    assert before == load().source_hash("knitsim.top")
    with (folder / edited).open("a") as file:
        file.write("# a comment is enough\n")
    assert (load().source_hash("knitsim.top") != before) is changed


@pytest.mark.parametrize(
    ("edited", "changed"),
    [
        ("kernels.py", True),
        ("constants.py", True),
        ("jit.py", True),
        ("cache.py", False),  # uses the cache's directory, compiles nothing
        ("apart.py", False),
        ("top.py", False),
    ],
)
def test_kernel_hash_changes_with_what_is_compiled_only(package, edited, changed):
    folder, load = package
    before = load().kernel_hash()
    with (folder / edited).open("a") as file:
        file.write("# a comment is enough\n")
    assert (load().kernel_hash() != before) is changed


def test_a_new_kernel_module_changes_the_kernel_hash(package):
    folder, load = package
    before = load().kernel_hash()
    (folder / "parts/more_kernels.py").write_text("from knitsim.jit import njit\n")
    assert load().kernel_hash() != before


def test_renaming_a_module_changes_the_hash(package):
    folder, load = package
    before = load().source_hash("knitsim.top")
    (folder / "parts/deep.py").rename(folder / "parts/deeper.py")
    (folder / "middle.py").write_text(SOURCES["middle.py"].replace("deep", "deeper"))
    assert load().source_hash("knitsim.top") != before


def test_everything_that_python_imports_is_in_the_closure():
    """Against the interpreter: what is loaded with a stage is what its hash covers."""
    stage = "knitsim.stages.kinematic_bending"
    code = (
        f"import sys, json, {stage}\n"
        "print(json.dumps([m for m in sys.modules if m.split('.')[0] == 'knitsim']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True,
        cwd=provenance.PACKAGE.parent,
    )  # fmt: skip
    loaded = set(json.loads(done.stdout))
    assert len(loaded) > 10
    assert loaded <= set(module_closure(stage))


def test_each_stage_depends_on_its_own_kernels_only():
    bending = "knitsim.kinematic.bending_kernels"
    tension = "knitsim.kinematic.tension_kernels"
    assert bending in module_closure("knitsim.stages.kinematic_bending")
    assert tension in module_closure("knitsim.stages.kinematic_tension")
    assert bending not in module_closure("knitsim.stages.kinematic_tension")
    for stage in ("yarn", "loop"):
        assert {bending, tension}.isdisjoint(module_closure(f"knitsim.stages.{stage}"))


def test_hashes_are_short_hex():
    for value in (source_hash("knitsim.stages.loop"), kernel_hash()):
        assert len(value) == 16 and int(value, 16) >= 0
    assert source_hash("knitsim.stages.loop") != source_hash("knitsim.stages.yarn")

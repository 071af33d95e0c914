"""Which sources a result depends on, as a hash, found from the import statements themselves.

Nothing here imports the modules that it hashes: the Snakefile calls it and must start fast.
"""

import ast
import functools
import hashlib
import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
_STATEMENT = re.compile(
    r"^[ \t]*(from[ \t]+[\w.]+[ \t]+import[ \t]+(?:\([^)]*\)|[^\n]+)|import[ \t]+[^\n]+)",
    re.MULTILINE,
)


@functools.cache
def _path(module):
    """File of a dotted ``knitsim`` module name, or None if it is no module of this package."""
    parts = module.split(".")
    if parts[0] != "knitsim":
        return None
    base = PACKAGE.joinpath(*parts[1:])
    for candidate in (base / "__init__.py", base.with_suffix(".py")):
        if candidate.is_file():
            return candidate
    return None


def _import_statements(source):
    """The import statements of a source; only these are parsed, since every job comes here."""
    for text in _STATEMENT.findall(source):
        try:
            yield from ast.parse(text).body
        except SyntaxError:
            continue  # a line of prose that begins with "from" or "import"


@functools.cache
def _imports(module):
    """The knitsim modules that one module names in its import statements, at any depth in it."""
    found = set()
    for node in _import_statements(_path(module).read_text(encoding="utf-8")):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            # "from a.b import c": c may be a module of its own; a.b counts in any case.
            names = [node.module] + [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level:
            raise SyntaxError(f"{module}: relative imports are not used in knitsim")
        found.update(name for name in names if _path(name))
    # Importing a.b.c runs a and a.b as well.
    return frozenset(found.union(*map(_packages, [module, *found])))


def _packages(module):
    """The packages that a module lies in, outermost first."""
    parts = module.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]


def module_closure(*modules):
    """All knitsim modules that ``modules`` import, directly or not, and themselves, sorted."""
    seen, todo = set(), list(modules)
    while todo:
        module = todo.pop()
        if module in seen:
            continue
        if _path(module) is None:
            raise ValueError(f"no module named {module} in knitsim")
        seen.add(module)
        todo.extend(_imports(module))
    return sorted(seen)


def _digest(modules):
    digest = hashlib.sha256()
    for module in modules:
        digest.update(module.encode() + b"\0" + _path(module).read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def source_hash(*modules):
    """Hash (16 hex digits) of the sources that ``modules`` depend on within knitsim."""
    return _digest(module_closure(*modules))


def _has_kernels(source):
    """Whether a source takes a decorator of kernels from knitsim.jit."""
    return "knitsim.jit" in source and any(
        isinstance(node, ast.ImportFrom)
        and node.module == "knitsim.jit"
        and any(alias.name in ("njit", "leaf") for alias in node.names)
        for node in _import_statements(source)
    )


@functools.cache
def kernel_hash():
    """Hash of every module that compiled code can come from: those with kernels, and what they import."""
    users = []
    for path in sorted(PACKAGE.rglob("*.py")):
        if _has_kernels(path.read_text(encoding="utf-8")):
            parts = ("knitsim", *path.relative_to(PACKAGE).with_suffix("").parts)
            users.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return _digest(module_closure(*users))

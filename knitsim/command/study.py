"""``knitsim new DIR`` and ``knitsim check DIR``."""

import os
import shutil
from pathlib import Path

from knitsim.command.sources import STUDIES, study_path
from knitsim.errors import InputError

FILES = ("yarns.yaml", "fabrics.yaml", "scenes.yaml")


def new_options(parser):
    """Options of ``knitsim new``."""
    parser.add_argument("directory", metavar="DIR")
    parser.add_argument(
        "--from", dest="template", choices=tuple(STUDIES), default="jersey",
        help="jersey: one plain fabric of cotton; paper: the default study with all its tests; "
        "small: one that runs in seconds",
    )  # fmt: skip


def new(given):
    """Copy a study into a directory that has none."""
    target, source = Path(given.directory), study_path(given.template)
    for name in FILES:
        if (target / name).exists():
            raise InputError(target / name, None, "is there already; name another directory")
    try:
        target.mkdir(parents=True, exist_ok=True)
        for name in FILES:
            shutil.copyfile(source / name, target / name)
        if given.template == "paper":
            shutil.copytree(source / "curves", target / "curves", dirs_exist_ok=True)
    except OSError as error:
        raise InputError(target, None, f"cannot be written: {error.strerror}") from None
    print(
        f"{target}: {', '.join(FILES)}\nEdit them, then: knitsim check {target} && knitsim run {target}"
    )
    return 0


def check_options(parser):
    """Options of ``knitsim check``."""
    parser.add_argument("directory", metavar="DIR", nargs="?", default=".")


def check(given):
    """Check every key of a study and build every yarn and loop; say what it holds."""
    from knitsim.stages.check import check_study
    from knitsim.study.study import load_study

    target = Path(given.directory)
    if not target.is_dir():
        raise InputError(target, None, "no such directory; knitsim new DIR makes one")
    # As knitsim run does: curve files are looked for from there.
    os.chdir(target)
    study = load_study(".")
    check_study(study)
    for group in ("yarns", "fabrics"):
        names = list(getattr(study, group))
        shown = ", ".join(names[:8]) + (f", ... ({len(names)})" if len(names) > 8 else "")
        print(f"{group}: {shown}")
    print(f"assumed values: {len(study.assumptions())}; nothing to complain about")
    return 0

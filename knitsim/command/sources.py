"""Where the workflow and the studies that come with knitsim lie: in the wheel, or in a clone."""

from pathlib import Path

import knitsim

_PACKAGE = Path(knitsim.__file__).resolve().parent
STUDIES = {"jersey": "config/jersey", "paper": "config", "small": "config/small"}


def root():
    """The directory that holds Snakefile, workflow/ and config/."""
    shipped = _PACKAGE / "_workflow"
    return shipped if (shipped / "Snakefile").is_file() else _PACKAGE.parent


def study_path(name):
    """Directory of one of STUDIES."""
    return root() / STUDIES[name]

"""What every job of the workflow does around its one call: the study that was checked, the log, and
failures in one line.
"""

import os
import sys
import traceback
from contextlib import contextmanager, suppress
from pathlib import Path

from knitsim.errors import ComputationError, InputError
from knitsim.files import full_disk


@contextmanager
def job(snakemake):
    """Run a script's body; a refusal or failed computation ends the job with its one line.

    The line goes to the terminal and, with the traceback, to the job's log.
    """
    log = Path(snakemake.log[0])
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text("")
        yield
    except Exception as error:
        with suppress(OSError):  # on a full disk there is no log
            log.write_text(traceback.format_exc())
        if full_disk(error):
            sys.exit(
                f"knitsim: {snakemake.output[0]}: no space left on the disk; what is done is kept"
            )
        if isinstance(error, (InputError, ComputationError)):
            sys.exit(f"knitsim: {error}")
        if isinstance(error, OSError):
            sys.exit(f"knitsim: {error.filename or snakemake.output[0]}: {error.strerror or error}")
        what = f"{snakemake.rule}: {type(error).__name__}: {error}"
        sys.exit(f"knitsim: a fault of knitsim in {what}; its traceback: {log}")


@contextmanager
def kept_study(snakemake):
    """The Study as the workflow has checked it, whatever was edited since.

    Relative paths mean the kept files inside, so paths of outputs are to be made absolute before.
    """
    from knitsim.study.study import load_study

    here, kept = Path.cwd(), Path(snakemake.config.get("kept", "."))
    try:
        if kept.is_dir():
            os.chdir(kept)
        yield load_study(snakemake.config["study"])
    finally:
        os.chdir(here)


def absolute(paths):
    """Absolute paths, in order."""
    return [Path(path).absolute() for path in paths]

"""What every job of the workflow does around its one call: the log, and failures in one line."""

import sys
import traceback
from contextlib import contextmanager
from pathlib import Path

from knitsim.errors import ComputationError, InputError


@contextmanager
def job(snakemake):
    """Run a script's body; a refusal or failed computation ends the job with its one line.

    The line goes to the terminal and, with the traceback, to the job's log.
    """
    log = Path(snakemake.log[0])
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text("")
    try:
        yield
    except Exception as error:
        log.write_text(traceback.format_exc())
        if isinstance(error, (InputError, ComputationError)):
            sys.exit(f"knitsim: {error}")
        raise

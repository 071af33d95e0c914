"""``knitsim run DIR``: the workflow on a study, a line for each stage, a table at the end."""

import os
import queue
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from knitsim.command import show
from knitsim.command.sources import root
from knitsim.command.study import FILES
from knitsim.errors import InputError
from knitsim.files import full_disk

LOG = "benchmark/logs/snakemake.log"
# What Snakemake says of a job, from its beginning to its end.
_FIELD = re.compile(r"    (jobid|wildcards): (.*)")
_BEGUN = re.compile(r"(?:local)?rule (\w+):")
_ENDED = re.compile(r"Finished jobid: (\d+) \(Rule: (\w+)\)")
_FAULT = re.compile(r"Error in rule \w+:")
_OPTIONS = re.compile(r"\S*__main__\.py: error: (.*)")
_STEPS = re.compile(r"(\d+) of (\d+) steps \(.*\) done")
QUIET = 20.0  # seconds without a line on the screen, after which what is at work is said


def run_options(parser):
    """Options of ``knitsim run``."""
    parser.add_argument("directory", metavar="DIR", nargs="?", default=".")
    parser.add_argument("--results", default="results", help="below DIR, unless absolute")
    parser.add_argument(
        "-c", "--cores", default=None, help="jobs side by side; all cores by default"
    )
    parser.epilog = (
        "Other options go to snakemake: -n shows what would be made, --forceall makes it anew."
    )


def run(given, more):
    """Run the workflow; the exit status of Snakemake."""
    target = Path(given.directory)
    if not target.is_dir():
        raise InputError(target, None, "no such directory; knitsim new DIR makes one")
    for name in FILES:
        if not (target / name).exists():
            raise InputError(target / name, None, "no such file; knitsim new DIR makes a study")
    cores = given.cores or str(os.cpu_count() or 1)
    command = [
        sys.executable, "-m", "snakemake", "--snakefile", str(root() / "Snakefile"),
        "--directory", str(target), "--cores", cores, "--keep-going", *more,
    ]  # fmt: skip
    ours = ["study=.", f"results={given.results}"]
    # A second --config would take the place of the first.
    at = command.index("--config") + 1 if "--config" in command else len(command)
    command[at:at] = ours if "--config" in command else ["--config", *ours]
    results = target / given.results
    if {"-n", "--dry-run", "--dryrun", "--unlock", "--lint", "-h", "--help"} & set(more):
        return subprocess.run(command, check=False).returncode
    begun = time.monotonic()
    try:
        log = results / LOG
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("w", encoding="utf-8") as file:
            status, said = followed(command, file)
    except OSError as error:
        why = "no space left on the disk" if full_disk(error) else error.strerror
        raise InputError(results, None, f"cannot be written: {why}") from None
    if said:  # refused: what an earlier run has left says nothing of this one
        return status
    if (results / show.TABLE).exists():
        show.show_results(results)
    if status:
        print(f"knitsim: not finished; what is done is kept. The log: {log}", file=sys.stderr)
    else:
        print(f"{time.monotonic() - begun:.0f} s; log: {log}")
    return status


def followed(command, log):
    """Run ``command``, all it says into the open file ``log``; on the screen a line of each job that ends,
    and of those at work where none ends for long.

    (exit status, whether it failed before any job and the reason is on the screen).
    """
    environment = os.environ | {"PYTHONUNBUFFERED": "1", "KNITSIM_RUN": "1"}
    at_work, rule, job, ended, locked, refused = {}, "", "", "", False, False
    shown = time.monotonic()
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
        errors="replace",
    ) as process:  # fmt: skip
        try:
            for line in _lines(process.stdout):
                if line is None:
                    if at_work and time.monotonic() - shown >= QUIET:
                        shown = time.monotonic()
                        told = (
                            f"{what} ({shown - since:.0f} s)" for what, since in at_work.values()
                        )
                        print(f"at work: {', '.join(told)}", flush=True)
                    continue
                log.write(line)
                if line.startswith("knitsim: "):
                    print(line, end="", file=sys.stderr, flush=True)
                    refused = refused or not job
                elif found := _BEGUN.match(line):
                    rule = found[1].replace("_", " ")
                elif _FAULT.match(line):
                    rule = ""
                elif found := _FIELD.match(line):
                    if found[1] == "jobid":
                        job = found[2].strip()
                        if rule:
                            at_work[job] = (rule, time.monotonic())
                        else:  # of a job that has failed
                            at_work.pop(job, None)
                    elif job in at_work:
                        of = re.sub(r"\w+=", "", found[2]).strip()
                        at_work[job] = (f"{rule} {of}", at_work[job][1])
                elif found := _ENDED.match(line):
                    ended = at_work.pop(found[1], (found[2].replace("_", " "),))[0]
                elif found := _STEPS.match(line):
                    print(f"[{found[1]:>{len(found[2])}}/{found[2]}] {ended}", flush=True)
                    shown = time.monotonic()
                elif found := _OPTIONS.match(line):
                    print(f"knitsim run: {found[1]}", file=sys.stderr, flush=True)
                    refused = True
                locked = locked or "LockException" in line
        except KeyboardInterrupt:
            process.wait()  # Snakemake was told as well, and ends its jobs
    if locked:
        print(
            "knitsim: another run is at work here, or was killed: after a kill add --unlock once, then "
            "run with --rerun-incomplete",
            file=sys.stderr,
        )
    return process.returncode, process.returncode != 0 and (locked or refused)


def _lines(stream):
    """Lines of a stream as they come, and None for each second without one."""
    lines = queue.Queue()

    def read():
        for line in stream:
            lines.put(line)
        lines.put("")

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=1.0)
        except queue.Empty:
            yield None
            continue
        if not line:
            return
        yield line

"""``knitsim run DIR``: the workflow on a study, a line for each stage, a table at the end."""

import os
import re
import subprocess
import sys
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
_ENDED = re.compile(r"Finished jobid: (\d+) \(Rule: (\w+)\)")
_OPTIONS = re.compile(r"\S*__main__\.py: error: (.*)")
_STEPS = re.compile(r"(\d+) of (\d+) steps \(.*\) done")


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
    """Run ``command``, all it says into the open file ``log``, a line of each job on the screen.

    (exit status, whether it failed before any job and the reason is on the screen).
    """
    environment = os.environ | {"PYTHONUNBUFFERED": "1", "KNITSIM_RUN": "1"}
    wildcards, job, ended, locked, refused = {}, "", "", False, False
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
        errors="replace",
    ) as process:  # fmt: skip
        try:
            for line in process.stdout:
                log.write(line)
                if line.startswith("knitsim: "):
                    print(line, end="", file=sys.stderr, flush=True)
                    refused = refused or not job
                elif found := _FIELD.match(line):
                    if found[1] == "jobid":
                        job = found[2].strip()
                        wildcards[job] = ""
                    elif job:
                        wildcards[job] = re.sub(r"\w+=", "", found[2]).strip()
                elif found := _ENDED.match(line):
                    ended = f"{found[2].replace('_', ' ')} {wildcards.get(found[1], '')}".strip()
                elif found := _STEPS.match(line):
                    print(f"[{found[1]:>{len(found[2])}}/{found[2]}] {ended}", flush=True)
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

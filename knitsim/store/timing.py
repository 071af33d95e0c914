"""Run times: measured in the run that makes the results, kept beside them, never in netCDF."""

import csv
import functools
import os
import platform
import statistics
import time
from contextlib import contextmanager
from pathlib import Path

from knitsim.files import replacing

MEDIAN = "median, compiled"  # note of what is timed by itself, not within a job
LONG = 1.0  # seconds beside which what a first run takes more is nothing
# whole_test: whether it is what the paper calls the computing time of a test.
COLUMNS = (
    "stage", "subject", "direction", "name", "value", "units", "repeats", "whole_test", "note",
    "machine",
)  # fmt: skip


@functools.cache
def machine():
    """Processor, number of processors and Python, in one line."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    return f"{model}, {os.cpu_count()} processors, Python {platform.python_version()}"


class Timings:
    """Rows of run times of one stage on one subject (a yarn, a fabric, or ``all``)."""

    def __init__(self, stage, subject, direction=""):
        self.about, self.rows = (stage, subject, direction), []

    def add(self, name, seconds, repeats=1, note="", whole=False):
        self.rows.append((
            *self.about, name, f"{seconds:.6g}", "s", repeats, "yes" if whole else "", note, machine()
        ))  # fmt: skip

    @contextmanager
    def measure(self, name, note="", whole=False):
        """Record the wall time of the block."""
        start = time.perf_counter()
        yield
        self.add(name, time.perf_counter() - start, note=note, whole=whole)

    def repeat(self, name, call, budget=0.03, whole=False):
        """Record the median wall time of ``call()`` over one to a hundred runs, after one that is not counted
        if it takes less than LONG.

        budget: seconds after which no further run is begun.  Returns the result of the last run.
        """
        start = time.perf_counter()
        result, seconds = call(), []
        first = time.perf_counter() - start
        if first > LONG:
            self.add(name, first, note=MEDIAN, whole=whole)
            return result
        start = time.perf_counter()
        while not seconds or (time.perf_counter() - start < budget and len(seconds) < 100):
            begin = time.perf_counter()
            result = call()
            seconds.append(time.perf_counter() - begin)
        self.add(name, statistics.median(seconds), len(seconds), MEDIAN, whole)
        return result

    def write(self, path):
        """Write the rows as CSV."""
        write_csv(path, COLUMNS, self.rows)


def write_csv(path, columns, rows):
    """Write ``rows`` (sequences, or mappings by column) under ``columns``; whole or not at all."""
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow([row[c] for c in columns] if isinstance(row, dict) else row)

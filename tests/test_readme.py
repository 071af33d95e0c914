"""What the README tells to type works as it stands there."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from knitsim.command import main

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)
COMMANDS = [
    line.partition("#")[0].strip()
    for language, block in BLOCKS if language == "sh"
    for line in block.splitlines() if line.startswith("knitsim ")
]  # fmt: skip
# Those that need a study's results or a file of one's own.
ELSEWHERE = ("knitsim run", "knitsim show", "knitsim read")


def said(call, *arguments):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        status = call(*arguments)
    assert not status
    return out.getvalue()


def test_the_fabric_in_five_lines_is_five_lines_and_agrees_with_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = [block for language, block in BLOCKS if language == "python"]
    assert len([line for line in code.splitlines() if line]) == 5
    told = said(exec, compile(code, "README.md", "exec"), {})
    assert told.startswith("<Pull course") and "EMT" in told
    (command,) = [line for line in COMMANDS if line.startswith("knitsim fabric")]
    shown = said(main, shlex.split(command)[1:])
    assert told.splitlines()[0] in shown.splitlines()
    assert (tmp_path / "states.csv").exists() and (tmp_path / "curve.png").exists()


def test_a_study_is_made_and_checked(tmp_path, monkeypatch):
    for line in COMMANDS:
        if line.startswith(("knitsim new", "knitsim check")):
            monkeypatch.chdir(tmp_path)
            assert said(main, shlex.split(line)[1:])


def test_every_command_is_known():
    for line in COMMANDS:
        if line.startswith(ELSEWHERE):
            with pytest.raises(SystemExit) as ended, contextlib.redirect_stdout(io.StringIO()):
                main([shlex.split(line)[1], "--help"])
            assert ended.value.code == 0


def test_links_lead_somewhere():
    for file in ("README.md", "config/README.md", "results/README.md", "workflow/report/README.md",
                 "workflow/profiles/slurm/README.md"):  # fmt: skip
        for link in re.findall(r"\]\(([^)#]+)", (ROOT / file).read_text(encoding="utf-8")):
            if "://" not in link:
                assert (ROOT / file).parent.joinpath(link).exists(), f"{file}: {link}"


def test_it_keeps_to_one_screen_and_a_half():
    assert len(TEXT.splitlines()) <= 110 and len(TEXT.split()) <= 800

"""Where things are: the repository and its command, built as the package is."""

import json
import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
XYZ = ROOT / "examples/xyz"


@pytest.fixture(scope="session")
def command():
    """Runs the `syncline` command, which the package has to agree with."""
    binary = os.environ.get("SYNCLINE", ROOT / "target/debug/syncline")

    def run(*arguments):
        arguments = [str(argument) for argument in arguments]
        return subprocess.run([binary, *arguments], cwd=ROOT, capture_output=True, text=True)

    return run


@pytest.fixture(scope="session")
def judged(command):
    """What `syncline validate --json` writes, but for where that is from, which no library knows."""

    def judge(machine, program, *options):
        done = command("validate", machine, program, "--json", "-", *options)
        assert done.stdout, done.stderr
        summary = json.loads(done.stdout)
        summary.pop("provenance")
        return summary

    return judge


@pytest.fixture
def part(tmp_path):
    """A program of a second."""
    file = tmp_path / "part.ngc"
    file.write_text("G21 G90 G94\nG0 X5 Y5\nG1 X20 Y10 Z-1 F3000\nG2 X30 Y20 I10 J0\nM2\n")
    return file

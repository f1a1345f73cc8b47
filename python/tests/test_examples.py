"""The examples run."""

import importlib.util
import subprocess
import sys

import nbformat
import syncline
from conftest import ROOT, XYZ
from nbclient import NotebookClient

EXAMPLES = ROOT / "python/examples"


def test_the_sweep_on_two_workers_has_the_results_of_one_process():
    spec = importlib.util.spec_from_file_location("sweep", EXAMPLES / "sweep.py")
    sweep = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sweep)
    machine, program = XYZ / "machine.toml", XYZ / "rosette.ngc"
    command = [sys.executable, EXAMPLES / "sweep.py", machine, program, "--runs", "6"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    _, *rows = [line for line in done.stdout.replace("\r", "\n").splitlines() if "mm" in line or "pass" in line]
    axes = syncline.check(machine)["axes"]
    here = [sweep.run(machine, program, limits) for limits in sweep.draws(axes, 6, 0)]
    times = sorted(f"{it['motion_s']:.3f}" for it in here)
    assert sorted(row.split()[0] for row in rows) == times and len(set(times)) == 6


def test_the_notebook_runs_and_has_no_outputs():
    notebook = nbformat.read(EXAMPLES / "judge.ipynb", as_version=4)
    assert all(not cell.outputs for cell in notebook.cells if cell.cell_type == "code")
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": ROOT}}).execute()
    printed = [output.text for cell in notebook.cells for output in cell.get("outputs", [])]
    assert "verdict            pass" in printed[0]

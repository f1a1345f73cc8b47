#!/usr/bin/env python3
"""Which jerk limits are worth it? Validates a program with drawn limits on the workers of a Dask cluster.

    python sweep.py MACHINE PROGRAM [--runs N] [--scheduler ADDRESS] [--seed S]

Without a scheduler's address two workers are started here. Elsewhere the files have to be where the workers
can read them, under the same paths. The draws are the same for the same seed, whoever computes them.
"""

import argparse
import pathlib
import random

import syncline
from distributed import Client, LocalCluster, as_completed


def draws(axes, runs, seed):
    """Limits of jerk, mm/s³, from 10,000 to 100,000, as many in every decade."""
    draw = random.Random(seed)
    for _ in range(runs):
        yield {f"axis.{axis}.max_jerk": round(10 ** draw.uniform(4, 5), 1) for axis in axes}


def run(machine, program, limits):
    """One validation, on a worker."""
    summary = syncline.validate(machine, program, set=limits, trace=False).summary
    return {
        "limits": limits,
        "verdict": summary["verdict"],
        "motion_s": summary["times"]["motion_s"],
        "following_error_mm": max(axis["max_following_error_mm"] for axis in summary["axes"]),
        "frames_sha256": summary["frames_sha256"],
    }


def sweep(client, machine, program, runs, seed=0):
    """The results of all draws, the shortest motion first."""
    # What is wrong with the input is told here, once.
    axes = syncline.check(machine, program)["axes"]
    jobs = client.map(lambda limits: run(machine, program, limits), list(draws(axes, runs, seed)), pure=False)
    results = []
    for job in as_completed(jobs):
        results.append(job.result())
        print(f"{len(results)} of {runs}", end="\r", flush=True)
    return sorted(results, key=lambda it: (it["motion_s"], it["frames_sha256"]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("machine", type=pathlib.Path)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="as tcp://host:8786")
    given = parser.parse_args()
    machine, program = str(given.machine.resolve()), str(given.program.resolve())
    cluster = given.scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        results = sweep(client, machine, program, given.runs, given.seed)
    print(f"{'motion, s':>10} {'following error, mm':>20}  limits of jerk, mm/s³")
    for result in results:
        limits = ", ".join(f"{key.split('.')[1]} {value:.0f}" for key, value in result["limits"].items())
        print(f"{result['motion_s']:10.3f} {result['following_error_mm']:20.4f}  {limits}  {result['verdict']}")
    if not given.scheduler:
        cluster.close()


if __name__ == "__main__":
    main()

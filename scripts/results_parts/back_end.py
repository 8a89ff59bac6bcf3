"""The back end beside one factorisation by CHOLMOD, Ceres and published times."""

import json
import subprocess
import sys
from pathlib import Path

from .bench import number

ROOT = Path(__file__).resolve().parent.parent.parent
BENCHMARKS = "scripts/benchmarks.py"


def measured(bench, options):
    """Figures of one run of the benchmark program, which renews docs/benchmarks.md as well."""
    file = bench.scratch / "benchmarks.json"
    words = [sys.executable, BENCHMARKS, "--build", bench.program.parent, "--data", bench.data,
             "--json", file]
    if options.quick:
        words.append("--quick")
    done = subprocess.run([str(w) for w in words], cwd=ROOT, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE)
    if not file.exists():
        raise RuntimeError(f"{BENCHMARKS} ended with {done.returncode}")
    return json.loads(file.read_text())


def significant(x):
    return f"{x:#.3g}".rstrip(".")


def ratios(report, sets):
    rows = []
    for data in sets:
        runs = {run["threads"]: run for run in data["with_threads"]}
        seconds = {t: run["mapjoin"]["seconds"] for t, run in runs.items()}
        ceres = runs[1].get("ceres")
        beside = "" if ceres is None else significant(ceres["seconds"])
        if ceres is not None and not data["ceres_reached"]:
            beside += f", ends at {data['ceres_chi2']:.7g}"
        rows.append([data["name"], f"{data['poses']:,}", f"{data['features']:,}",
                     significant(runs[1]["once_seconds"]), significant(seconds[1]),
                     number(runs[1]["ratio"], 2), significant(seconds[2]), number(runs[2]["ratio"], 2),
                     number(runs[2]["times_as_fast"], 2), number(runs[2]["machine_times_as_fast"], 2), beside, f"{data['chi2']:.9g}",
                     data["optimum_from"],
                     report.check(data["reached"], f"{data['name']}: the optimum to 1e-6")])
    report.table(["data set", "poses", "features", "one factorisation, s", "one thread, s", "ratio",
                  "two threads, s", "ratio", "times as fast", "two joins at once", "Ceres, s", "chi2", "optimum known from",
                  "reached"], rows)


def growth(report, worlds):
    rows = []
    for world in worlds:
        for step in world["steps"]:
            one, two = (run["seconds"] for run in step["mapjoin"])
            peak = max(run.get("peak_bytes", 0) for run in step["mapjoin"])
            rows.append([world["world"], f"{step['poses']:,}", f"{step['measurements']:,}",
                         significant(one), significant(two), f"{peak / 2**20:,.0f}",
                         report.check(step["reached"], f"{world['world']} {step['poses']}: the optimum")])
    report.table(["world", "poses", "measurements", "one thread, s", "two threads, s", "memory, MiB",
                  "reached"], rows)


def back_end(bench, report, options):
    report.section(18, "The back end beside one factorisation", "From measurements in memory to the "
                   "optimum (chi2 within 1e-6), no initial values, against ordering, analysis, numbers "
                   "and solve of the final information matrix by CHOLMOD's fastest variant: at most 2.5 "
                   "times that on one thread, 1.6 on two; two threads at least 1.6 times as fast as one "
                   "from 14,000 unknowns; a third of the fastest published time of others on graphs of "
                   "more than 3,000 poses, half of it on smaller ones, CHOLMOD being the measure of both "
                   "machines. Medians of five rounds in one run, of joins alone fifteen, all data sets in turn "
                   "in each; who is quick runs for a fifth of a second in each.")
    report.commands(BENCHMARKS)
    report.say("[benchmarks](benchmarks.md) is of the same run and has phases, memory, kernels, the "
               "others' times, and what simulated worlds are made with.")
    report.say("Two threads are so many *times as fast* as one, the median of the rounds, in which both are "
               "neighbours. *Two joins at once*, on a thread each and sharing nothing but the machine, say "
               "what its processors give at that time to who never waits.")
    found = measured(bench, options)
    ratios(report, found["data_sets"])
    report.say("How seconds grow with a world, sizes and numbers of threads in turn in one process; "
               "memory beyond the measurements:")
    growth(report, found.get("growth", []))
    report.say("Every goal of these figures:")
    rows = []
    for goal in found["goals"]:
        at_most = "at_most" in goal
        rows.append([goal["data"], goal["what"], number(goal["value"], 3), "at most" if at_most else "at least",
                     f"{goal['at_most' if at_most else 'at_least']:.3g}",
                     report.check(goal["holds"], f"{goal['data']}: {goal['what']} {goal['value']:.3f}")])
    report.table(["data", "what", "figure", "goal", "", "holds"], rows)
    report.close()

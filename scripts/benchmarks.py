#!/usr/bin/env python3
"""Measures speed against CHOLMOD and Ceres and writes docs/benchmarks.md. Standard library only.

    cmake --preset release -DMAPJOIN_BUILD_BENCHMARKS=ON && cmake --build --preset release
    scripts/benchmarks.py                 all of it, some fifteen minutes; the machine should be idle
    scripts/benchmarks.py --quick         one round, small worlds, prints to stdout

Runs mapjoin_benchmark on the graphs in ../shared/data (or where MAPJOIN_DATA points) and on simulated
worlds, and mapjoin_kernels. The exit code is 1 when some result is not the optimum.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
WORLDS = ["manhattan:100000", "grid3d:10000", "landmarks2d:20000"]
QUICK_WORLDS = ["manhattan:2000", "grid3d:500"]
GROWTH = ["manhattan:10000,100000,1000000", "sphere:1000,10000,100000"]
QUICK_GROWTH = ["manhattan:1000,2000"]


def graphs(data):
    found = sorted(data.glob("pose_graphs/*.g2o")) + sorted(data.glob("landmark_graphs/*.g2o"))
    if not found:
        sys.exit(f"benchmarks.py: no graphs in {data}: the data sets are not part of the project; "
                 "set MAPJOIN_DATA or say --data")
    return found


def compare(options, sources, svg):
    """Runs mapjoin_benchmark; returns its tables and whether all optima were reached."""
    words = [options.build / "mapjoin_benchmark", *sources, "--threads", "1,2", "--repeat",
             options.repeat, "--ceres-limit", options.ceres_limit, "--svg", svg]
    if options.json:
        words += ["--json", options.json]
    for world in QUICK_WORLDS if options.quick else WORLDS:
        words += ["--simulate", world]
    for world in QUICK_GROWTH if options.quick else GROWTH:
        words += ["--growth", world]
    done = subprocess.run([str(w) for w in words], stdout=subprocess.PIPE, text=True,
                          stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 1):
        sys.exit(f"benchmarks.py: mapjoin_benchmark failed, exit code {done.returncode}")
    return done.stdout, done.returncode == 0


def kernels(options):
    """Runs mapjoin_kernels; returns a table."""
    words = [options.build / "mapjoin_kernels", "--benchmark_format=json"]
    if options.quick:
        words += ["--benchmark_min_time=0.01", "--benchmark_filter=/1000"]
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
    done = subprocess.run([str(w) for w in words], stdout=subprocess.PIPE, text=True, check=True,
                          stdin=subprocess.DEVNULL, env=environment)
    per_second = {"items_per_second": ("M items/s", 1e-6), "bytes_per_second": ("MB/s", 1e-6),
                  "GFlop/s": ("GFlop/s", 1.0)}
    text = "| kernel | dimension | poses | time, us | rate |\n|---|---:|---:|---:|---:|\n"
    for run in json.loads(done.stdout)["benchmarks"]:
        scale = {"ns": 1e-3, "us": 1.0, "ms": 1e3}[run["time_unit"]]
        name, poses = run["name"].split("/")[:2]
        rate = "".join(f"{run[key] * factor:.4g} {unit}"
                       for key, (unit, factor) in per_second.items() if key in run)
        text += (f"| {name.split('<')[0].replace('_', ' ')} | {name.split('<')[1].rstrip('>')} | {poses} "
                 f"| {run['real_time'] * scale:.4g} | {rate} |\n")
    return text


def processor():
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.machine()


def page(options, comparison, kernel_table, svg, load, seconds):
    command = "scripts/benchmarks.py" + (" --quick" if options.quick else "")
    return (f"# Benchmarks\n\nWritten by `{command}`; not edited by hand. `$DATA` is ../shared/data. To "
            "repeat it:\n\n```sh\ncmake --preset release -DMAPJOIN_BUILD_BENCHMARKS=ON\n"
            "cmake --build --preset release\nscripts/benchmarks.py\n```\n\nwhich runs\n\n```sh\n"
            "build/release/mapjoin_benchmark $DATA/pose_graphs/*.g2o $DATA/landmark_graphs/*.g2o \\\n  "
            + " ".join(f"--simulate {w}" for w in (QUICK_WORLDS if options.quick else WORLDS)) + " \\\n  "
            + " ".join(f"--growth {w}" for w in (QUICK_GROWTH if options.quick else GROWTH))
            + f" \\\n  --threads 1,2 --repeat {options.repeat} --ceres-limit {options.ceres_limit:g} "
            "--svg docs/benchmarks.svg\nOPENBLAS_NUM_THREADS=1 build/release/mapjoin_kernels\n```\n\n"
            f"![Time to the optimum in factorisations by CHOLMOD]({svg.name})\n\n{comparison}\n"
            f"## Kernels\n\nOn simulated worlds, streets in the plane and corridors in space; one thread "
            f"where the name does not say two.\n\n{kernel_table}\n## The machine\n\n{processor()}, "
            f"{os.cpu_count()} processors, load {load:.1f} before it began; "
            f"{platform.system()}. All of this took {seconds / 60:.0f} minutes.\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--build", type=Path, default=HERE / "build/release",
                        help="where the programs were built [build/release]")
    parser.add_argument("--data", type=Path,
                        default=os.environ.get("MAPJOIN_DATA", HERE / "../shared/data"))
    parser.add_argument("--output", type=Path,
                        help="the page; the chart goes beside it [docs/benchmarks.md; --quick: stdout]")
    parser.add_argument("--json", help="keep all figures in this file as well")
    parser.add_argument("--repeat", type=int, help="rounds to take the median of [5; --quick: 1]")
    parser.add_argument("--ceres-limit", type=float, default=60.0,
                        help="seconds after which Ceres is stopped [60]")
    parser.add_argument("--quick", action="store_true", help="a look, not the record")
    options = parser.parse_args()
    options.repeat = options.repeat or (1 if options.quick else 5)
    for program in ("mapjoin_benchmark", "mapjoin_kernels"):
        if not (options.build / program).exists():
            sys.exit(f"benchmarks.py: there is no {options.build / program}: build with "
                     "-DMAPJOIN_BUILD_BENCHMARKS=ON, or say --build")
    output = options.output or (None if options.quick else HERE / "docs" / "benchmarks.md")

    start, load = time.monotonic(), os.getloadavg()[0]
    if load > 0.5:
        print(f"benchmarks.py: warning: the machine is busy (load {load:.1f}); figures to be kept want "
              "an idle one", file=sys.stderr)
    with tempfile.TemporaryDirectory(prefix="mapjoin_benchmarks_") as scratch:
        svg = output.with_suffix(".svg") if output else Path(scratch) / "benchmarks.svg"
        comparison, reached = compare(options, graphs(Path(options.data)), svg)
        text = page(options, comparison, kernels(options), svg, load, time.monotonic() - start)
    if output:
        output.write_text(text)
    else:
        print(text)
    if not reached:
        sys.exit("benchmarks.py: some result is not the optimum; the checks say which")


if __name__ == "__main__":
    main()

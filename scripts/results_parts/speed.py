"""Seconds and memory, on the data sets and on simulated worlds."""

import filecmp
import math
import os
import re
import statistics

from .bench import figures, near, number, tests_of
from .data_sets import ALL, GRAPHS, LANDMARKS, MAPS, label, row


def speed(bench, report, options):
    report.section(7, "Speed", "Seconds of `solve` in --json (from parsed input to the result in "
                   "memory, information included), one thread, optimal mode, beside the authors' "
                   "program, which joins once and does not reach the optimum: at most a fifth on sets "
                   f"of more than 800 local maps, below it on the others. Median of {options.repeat}.")
    report.commands("mapjoin solve $DATA/pose_graphs/NAME.g2o --threads 1 --output OUT.g2o --json STATS.json",
                    "mapjoin join NAME --threads 1 --output OUT.g2o --json STATS.json")
    rows = []
    cases = [("graph", n) for n in list(GRAPHS)[:5]] + [("maps", n) for n in MAPS]
    cases += [("landmarks", n) for n in LANDMARKS]
    for kind, name in cases:
        _, _, authors, _, _, maps = row(kind, name)
        seconds = []
        for _ in range(options.repeat):
            stats, _ = bench.solve_row(kind, name, "--threads", "1")
            seconds.append(stats["seconds"]["solve"])
        ours = statistics.median(seconds)
        allowed = authors / 5 if maps > 800 else authors
        holds = ours <= allowed if maps > 800 else ours < allowed
        rows.append([label(kind, name), str(maps), number(authors, 2), number(allowed, 3),
                     number(ours, 3), f"{authors / ours:.1f}",
                     report.check(holds, f"{label(kind, name)}: {ours:.3f} s, {allowed:.3f} s allowed")])
    report.table(["data", "local maps", "authors' seconds", "allowed", "seconds", "times faster",
                  "holds"], rows)
    load = os.getloadavg()[0]
    report.say(f"The machine's load while measuring: {load:.1f} on {os.cpu_count()} cores (1 is this "
               "measurement alone; more than the cores makes seconds longer).")

    report.say("`--threads 2` gives the same bits as `--threads 1`: native maps, with all values, "
               "information and observations, compared byte by byte.")
    report.commands("mapjoin solve GRAPH.g2o --threads 1 --output one.map",
                    "mapjoin solve GRAPH.g2o --threads 2 --output two.map", "cmp one.map two.map")
    rows = []
    for kind, name in ALL:
        seconds = []
        for threads in ("1", "2"):
            stats, _ = bench.solve_row(kind, name, "--threads", threads, output=f"threads{threads}.map")
            seconds.append(stats["seconds"]["solve"])
        same = filecmp.cmp(bench.scratch / "threads1.map", bench.scratch / "threads2.map", shallow=False)
        rows.append([label(kind, name), *(number(s, 3) for s in seconds),
                     report.check(same, f"{label(kind, name)}: bits with two threads")])
    report.table(["data", "seconds, 1 thread", "2 threads", "same bytes"], rows)
    report.close()


def large_worlds(bench, report, options):
    report.section(8, "Large worlds", "200,000 poses of `simulate manhattan` solve to the optimum, the "
                   "chi2 of refinement started from the truth to 1e-6, in less than 4 GiB, without "
                   "deep recursion (run with a stack of 512 KiB); growth from 20,000 poses recorded.")
    report.commands("mapjoin simulate manhattan --poses N --seed 1 --output world.g2o --truth truth.g2o",
                    "ulimit -s 512",
                    "mapjoin solve world.g2o --output OUT.g2o --json STATS.json",
                    "build/release/tests/mapjoin_data_tests --gtest_filter='*LargeWorld*'  # from the truth")
    sizes = (2000, 6300, 20000) if options.quick else (20000, 63000, 200000)
    printed, truths = [], {}
    if not options.quick:
        bench.run_tests("mapjoin_data_tests", "*LargeWorld*", printed)
        for n, joined, truth in re.findall(r"^manhattan (\d+): joined (\S+), refined from the truth (\S+)$",
                                           "".join(printed), re.M):
            truths[int(n)] = float(truth)
    rows, seconds = [], []
    for poses in sizes:
        world, truth = bench.scratch / "world.g2o", bench.scratch / "truth.g2o"
        bench.call("simulate", "manhattan", "--poses", poses, "--seed", "1", "--output", world,
                   "--truth", truth)
        runs = [bench.solve("solve", world, "--threads", "1", stack=512 * 1024)[0]
                for _ in range(1 if poses >= 200000 else options.repeat)]
        stats = sorted(runs, key=lambda s: s["seconds"]["solve"])[len(runs) // 2]
        found = figures(bench.call("evaluate", bench.scratch / "out.g2o", "--graph", world,
                                   "--reference", truth))
        from_truth = truths.get(poses)
        memory = stats["peak_memory_bytes"] / 2**30
        holds = from_truth is not None and near(found["chi2"], from_truth) and memory < 4
        seconds.append(stats["seconds"]["solve"])
        rows.append([f"{poses:,}", f"{stats['measurements']:,}", number(found["chi2"], 4),
                     number(from_truth, 4) if from_truth else "not run",
                     number(found["pose_rmse"], 3), number(stats["seconds"]["read"], 2),
                     number(stats["seconds"]["solve"], 2), number(memory, 2),
                     "not run" if from_truth is None else report.check(holds, f"{poses:,} poses")])
    report.table(["poses", "measurements", "chi2", "refined from the truth", "RMSE to the truth, m",
                  "seconds read", "seconds solve", "peak memory, GiB", "holds"], rows)
    exponent = math.log(seconds[-1] / seconds[0]) / math.log(sizes[-1] / sizes[0])
    report.say(f"Seconds grow as poses to the power {exponent:.2f}.")
    report.close()


def deviations(chi2, freedom):
    """Of chi2 at an optimum from what so many degrees of freedom let one expect."""
    return (chi2 - freedom) / math.sqrt(2 * freedom)


def file_rates(report, what, stats, source, result):
    """Megabytes a second at which a g2o file was read, by one thread, and the result written: no less
    than 100, where a file is large enough to tell."""
    rates = [path.stat().st_size / 1e6 / max(1e-3, stats["seconds"][step])
             for path, step in ((source, "read"), (result, "write"))]
    if source.stat().st_size > 50e6:
        report.check(min(rates) >= 100, f"{what}: files at {min(rates):.0f} MB/s")
    return [number(rate, 0) for rate in rates]


def million_features(bench, report, options):
    poses = 3000 if options.quick else 100000
    report.say("Streets whose loops are closed by features alone. At the optimum chi2 is about the number "
               "of residuals less that of unknowns: it must be within four standard deviations of it.")
    command = ["simulate", "landmarks2d", "--poses", poses, "--sensor-range", "1.5",
               "--visible-features", "88", "--max-observations", "88"]
    report.commands("mapjoin " + " ".join(str(w) for w in command) + " --output world.g2o",
                    "mapjoin solve world.g2o --threads T --output OUT.g2o --json STATS.json")
    world = bench.scratch / "world.g2o"
    bench.call(*command, "--output", world)
    alone, one = bench.solve("solve", world, "--threads", 1, output="1.g2o")
    stats, out = bench.solve("solve", world, "--threads", 2, output="2.g2o")
    same = one.read_bytes() == out.read_bytes()
    seconds = [s["seconds"]["solve"] for s in (alone, stats)]
    rates = file_rates(report, "a million features", stats, world, out)
    features, measurements = stats["features"], stats["measurements"]
    freedom = 2 * (measurements - (poses - 1)) + 3 * (poses - 1) - 3 * (poses - 1) - 2 * features
    away = deviations(stats["chi2"], freedom)
    memory = stats["peak_memory_bytes"]
    report.table(["poses", "features", "measurements", "read, MB/s", "written, MB/s",
                  "seconds solve, one thread", "two threads", "one over two", "peak memory, MiB",
                  "bytes a feature", "chi2", "degrees of freedom", "standard deviations", "holds"],
                 [[f"{poses:,}", f"{features:,}", f"{measurements:,}", *rates,
                   *(number(s, 1) for s in seconds), number(seconds[0] / seconds[1], 2),
                   number(memory / 2**20, 0), f"{memory / features:,.0f}", number(stats["chi2"], 2),
                   f"{freedom:,}", number(away, 2),
                   report.check(same and abs(away) < 4, "a million features")]])


def million_in_space(bench, report, options):
    poses = 10000 if options.quick else 10**6
    limit = "100MB" if options.quick else "12GB"
    report.say("A million poses in space, the factor on disk where memory ends; at the optimum chi2 must "
               "be within four standard deviations of the degrees of freedom:")
    report.commands(f"mapjoin simulate sphere --poses {poses} --output world.g2o",
                    f"mapjoin solve world.g2o --threads 2 --memory-limit {limit} --output OUT.g2o "
                    "--json STATS.json")
    world = bench.scratch / "world.g2o"
    bench.call("simulate", "sphere", "--poses", poses, "--output", world)
    stats, out = bench.solve("solve", world, "--threads", 2, "--memory-limit", limit)
    rates = file_rates(report, "a million poses in space", stats, world, out)
    freedom = 6 * (stats["measurements"] - (poses - 1))
    away = deviations(stats["chi2"], freedom)
    seconds, memory = stats["seconds"], stats["peak_memory_bytes"]
    report.table(["poses", "measurements", "read, MB/s", "written, MB/s", "seconds solve",
                  "seconds of the processor", "peak memory, MiB", "chi2", "degrees of freedom",
                  "standard deviations", "holds"],
                 [[f"{poses:,}", f"{stats['measurements']:,}", *rates, number(seconds["solve"], 1), number(seconds["solve_processor"], 1),
                   number(memory / 2**20, 0), number(stats["chi2"], 2), f"{freedom:,}",
                   number(away, 2), report.check(abs(away) < 4, "a million poses in space")]])


def powers(seconds, decades):
    """Of poses, as which seconds grow from the first to the last of each pair."""
    return [math.log(seconds[last] / seconds[first]) / math.log(last / first) for first, last in decades]


def power_heads(decades):
    return [f"{first:,} to {last:,}" for first, last in decades]


# Of each world in the plane, threads in turn: what is compared are medians, and a run of tens of
# milliseconds is easily disturbed.
GROWTH_RUNS = {10**4: 21, 10**5: 7, 10**6: 3}


def scale(bench, report, options):
    report.section(11, "Scale and memory", "Simulated worlds from 10^4 to 10^6 poses in the plane, on a "
                   "sphere as well, and 10^6 features over 10^5 poses, each in a process of its own "
                   "(growth is judged in section 18): 10^6 poses in at most 40 s and 6 GiB on two "
                   "threads. In half the memory the same bits. g2o files of more than 50 MB are read and "
                   "written at no less than 100 MB/s, by one thread.")
    report.commands("mapjoin simulate WORLD --poses N --output world.g2o",
                    "mapjoin solve world.g2o --threads T --output OUT.g2o --json STATS.json",
                    "mapjoin solve world.g2o --memory-limit HALF --output HALF.g2o")
    worlds = [("manhattan", n) for n in (10**4, 10**5, 10**6)] + [("sphere", n) for n in (10**4, 10**5)]
    if options.quick:
        worlds = [("manhattan", 10**4), ("manhattan", 10**5), ("sphere", 10**4)]
    rows, seconds = [], {}
    for name, poses in worlds:
        world = bench.scratch / "world.g2o"
        bench.call("simulate", name, "--poses", poses, "--output", world)
        runs, outputs = {1: [], 2: []}, {}
        for _ in range(GROWTH_RUNS[poses] if name == "manhattan" else 1):
            for threads in runs:
                stats, outputs[threads] = bench.solve("solve", world, "--threads", threads,
                                                      output=f"{threads}.g2o")
                runs[threads].append(stats)
        for threads in runs:
            stats = sorted(runs[threads], key=lambda r: r["seconds"]["solve"])[len(runs[threads]) // 2]
            seconds[name, poses, threads] = statistics.median(
                r["seconds"]["solve_processor" if threads == 1 else "solve"] for r in runs[threads])
            memory = stats["peak_memory_bytes"]
            if threads == 1:
                whole, peak = outputs[1].read_bytes(), memory
            holds = ""
            if threads == 2:
                same = outputs[2].read_bytes() == whole
                fits = poses < 10**6 or (stats["seconds"]["solve"] <= 40 and memory <= 6 * 2**30)
                holds = report.check(same and fits, f"{name}, {poses:,} poses, two threads")
            rates = file_rates(report, f"{name}, {poses:,} poses", stats, world, outputs[threads])
            rows.append([name, f"{poses:,}", f"{stats['measurements']:,}", str(threads), "", *rates,
                         number(stats["seconds"]["solve"], 2),
                         number(memory / 2**20, 0), f"{memory / poses:,.0f}", holds])
    limit = peak // 2  # of the last world
    stats, out = bench.solve("solve", world, "--threads", 1, "--memory-limit", limit, output="half.g2o")
    memory = stats["peak_memory_bytes"]
    rows.append([name, f"{poses:,}", f"{stats['measurements']:,}", "1", number(limit / 2**20, 0),
                 *file_rates(report, "half the memory", stats, world, out),
                 number(stats["seconds"]["solve"], 2),
                 number(memory / 2**20, 0), f"{memory / poses:,.0f}",
                 report.check(out.read_bytes() == whole and memory <= limit, "half the memory")])
    report.table(["world", "poses", "measurements", "threads", "limit, MiB", "read, MB/s",
                  "written, MB/s", "seconds solve", "peak memory, MiB", "bytes a pose", "holds"], rows)
    plane = sorted(n for w, n, t in seconds if w == "manhattan" and t == 1)
    decades = list(zip(plane, plane[1:])) + [(plane[0], plane[-1])]
    rows = []
    for threads, of in ((1, "of the processor"), (2, "of the wall clock")):
        growth = powers({n: seconds["manhattan", n, threads] for n in plane}, decades)
        rows.append([f"{threads}, seconds {of}"] + [f"{g:.3f}" for g in growth])
    runs = ", ".join(f"{GROWTH_RUNS[poses]} of {poses:,}" for poses in plane)
    report.say("A process that has just begun also pays for every page of memory that it touches for the "
               "first time: on a virtual machine some seconds a GB, which small worlds, whose pages "
               f"others gave back a moment ago, are spared. Of such processes, medians of {runs} poses, "
               "seconds grow as poses to the power:")
    report.table(["threads"] + power_heads(decades), rows)
    million_features(bench, report, options)
    million_in_space(bench, report, options)
    report.say("Killed twenty times at random moments and taken up again (`--checkpoint`), a run ends "
               "with the same bits:")
    tests_of(bench, report, "mapjoin_program_tests", "Limits*")
    report.close()

"""Local maps from the raw logs of the simulated runs, whose truth is known."""

import csv
import math
import re

from .bench import figures, number

# Name: rms of the noise of the turn rate, degrees a second (README of the data), how many local maps,
# and why. Below five sigmas of the range observations are left out: some ranges are negative.
LOGS = {
    "simu_535": (4.1, (5, 50)),  # five maps as in D-SLAM map joining, and of ten poses each
    "simu_8240": (2.9, (50, 200)),
    "simu_35188": (1.9, (50, 200)),
}
LARGE = ("simu_8240", "simu_35188")  # whose NEES the paper prints; 56 dimensions say little
STATED = {"speed": 0.02, "sideways": 0.01, "range": 0.1, "bearing": math.radians(1.0)}


def noise_words(sigmas):
    return [word for name, sigma in sigmas.items() for word in (f"--sigma-{name}", f"{sigma:.6g}")]


def build(bench, log, maps, sigmas, output, *options):
    """Returns seconds to build, chi2 inside the maps, and the folder."""
    folder = bench.scratch / output
    printed = bench.call("build", log, "--segment", f"maps:{maps}", "--nearest", "0.5",
                         *noise_words(sigmas), *options, "--output", folder)
    seconds = float(re.search(r"([0-9.]+) build", printed)[1])
    return seconds, float(re.search(r"^chi2 +([0-9.]+)", printed, re.M)[1]), folder


def nees(bench, log, result):
    return figures(bench.call("evaluate", result, "--truth", log / "beacons_true.csv"))


def fig8_of_logs(bench, report, options):
    report.say("The simulated runs, from their controls and observations. Their optimum is that of all "
               "measurements in one local map; chi2 is what is left inside the local maps and between "
               "them. NEES of the features against the true beacons. 535 poses make five local maps, as "
               "in D-SLAM map joining, or fifty of ten poses; 200 would hold two or three poses each.")
    report.commands("mapjoin build $DATA/simulation/NAME --segment maps:N --nearest 0.5 --sigma-turn-rate "
                    "RMS --output MAPS",
                    "mapjoin join MAPS --mode MODE --tree order --output OUT.map",
                    "mapjoin evaluate OUT.map --truth $DATA/simulation/NAME/beacons_true.csv")
    rows = []
    for name, (degrees, counts) in LOGS.items():
        log = bench.data / "simulation" / name
        sigmas = dict(STATED, **{"turn-rate": math.radians(degrees)})
        seconds, chi2, folder = build(bench, log, 1, sigmas, f"{name}_1")
        optimum = folder / "localmap_1.map"
        c = nees(bench, log, optimum)
        rows.append([name, "1", "optimum", number(seconds, 2), "", number(chi2, 2), "", "", "", "",
                     number(c["nees"], 1), ""])
        for n in counts:
            rows += rows_of_log(bench, report, options, name, log, n, sigmas, optimum)
        rows.append([name, "", f"NEES of {c['dimension']:.0f} dimensions: at most (95%)", "", "", "", "", "",
                     "", "", number(c["bound"], 1), ""])
    report.table(["run", "n", "joined", "s build", "s join", "chi2", "poses", "features", "best fit",
                  "to the optimum over the maps", "NEES", "holds"], rows)
    modesty(bench, report)


def rows_of_log(bench, report, options, name, log, n, sigmas, optimum):
    built = [build(bench, log, n, sigmas, f"{name}_{n}_{k}") for k in range(options.repeat)]
    seconds, inside, folder = min(b[0] for b in built), built[0][1], built[0][2]
    rows, best = [], None
    for mode in ("optimal", "observe", "summary"):
        words = [] if mode == "optimal" else ["--tree", "order"]
        runs = [bench.solve("join", folder, "--mode", mode, *words, output=f"{mode}.map")
                for _ in range(1 if mode == "optimal" else options.repeat)]
        stats, out = runs[-1]
        joined = min(r[0]["seconds"]["solve"] for r in runs)
        f = figures(bench.call("evaluate", out, "--reference", optimum))
        apart, holds, c = None, "", nees(bench, log, out)
        if mode == "optimal":
            best = bench.scratch / f"{name}_{n}_best.map"
            out.rename(best)
            if name in LARGE:
                holds = report.check(c["nees"] <= c["bound"], f"{name}, {n} local maps: NEES")
        else:
            apart = figures(bench.call("evaluate", out, "--reference", best))
            apart = max(apart["pose_rmse"], apart["feature_rmse"])
        rows.append([name, str(n), "optimum over the maps" if mode == "optimal" else mode,
                     number(seconds, 2), number(joined, 2), number(inside + stats["chi2"], 2),
                     number(f["pose_rmse"], 6), number(f["feature_rmse"], 6),
                     number(f["aligned_feature_rmse"], 6), number(apart, 6), number(c["nees"], 1), holds])
    return rows


def read(path):
    with open(path, newline="") as file:
        rows = csv.reader(file)
        next(rows)
        return [[float(x) for x in row] for row in rows]


def wrapped(angle):
    return (angle + math.pi) % (2 * math.pi) - math.pi


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def residuals(log):
    """The noise in the files: controls and observations less what they were of."""
    controls, poses = read(log / "controls.csv"), read(log / "poses_true.csv")
    beacons = {int(b[0]): b[1:] for b in read(log / "beacons_true.csv")}
    out = {"speed": [], "turn-rate": [], "range": [], "bearing": []}
    for (speed, rate), (x0, y0, h0), (x1, y1, h1) in zip(controls, poses, poses[1:]):
        along = (x1 - x0) * math.cos(h1) + (y1 - y0) * math.sin(h1)
        out["speed"].append(along / 0.3 - speed)
        out["turn-rate"].append(wrapped(h1 - h0 - 0.3 * rate) / 0.3)
    for step, beacon, r, bearing in read(log / "observations.csv"):
        x, y, heading = poses[int(step) - 1]
        dx, dy = beacons[int(beacon)][0] - x, beacons[int(beacon)][1] - y
        if r >= 0.5:
            out["range"].append(r - math.hypot(dx, dy))
            out["bearing"].append(wrapped(bearing - math.atan2(dy, dx) + heading))
    return out


def modesty(bench, report):
    """Why NEES lies below where it should: the noise is smaller than stated."""
    report.say("NEES lies low, that of simu_35188 below its two-sided interval, as the noise is smaller than "
               "stated. The noise of ranges and bearings ends at two of its standard deviations (\"largest\"): "
               "a normal one whose tails are put there has sqrt(0.9205) = 0.959 of its rms. And the "
               "vehicle does not slip sideways, where 0.01 m/s are stated. With the residuals' own rms, and "
               "0.001 m/s sideways, NEES is where it should be; that the turn rate's noise is heavy-tailed "
               "does no harm:")
    rows, table = [], []
    for name in LARGE:
        degrees, counts = LOGS[name]
        log = bench.data / "simulation" / name
        found = residuals(log)
        own = {k: rms(v) for k, v in found.items()}
        rows.append([name, number(own["speed"], 4), number(math.degrees(own["turn-rate"]), 2),
                     number(own["range"], 4), number(max(map(abs, found["range"])), 3),
                     number(math.degrees(own["bearing"]), 4),
                     number(math.degrees(max(map(abs, found["bearing"]))), 3)])
        nominal = dict(STATED, **{"turn-rate": math.radians(degrees)})
        seen = {"range": own["range"], "bearing": own["bearing"]}
        for label, sigmas in (("nominal", nominal), ("own of ranges and bearings", dict(nominal, **seen)),
                              ("own of all", dict(own, sideways=0.001))):
            _, _, folder = build(bench, log, counts[0], sigmas, f"{name}_{label.replace(' ', '_')}",
                                 "--keep", "end-pose")
            _, out = bench.solve("join", folder, output="modest.map")
            c = nees(bench, log, out)
            inside = c["lower"] <= c["nees"] <= c["upper"]
            if label == "own of all":
                report.check(inside, f"{name}: NEES with the residuals' own noise")
            table.append([name, label, number(c["nees"], 1), f"{c['dimension']:.0f}",
                          f"{c['lower']:.1f} to {c['upper']:.1f}", "yes" if inside else "no"])
    report.table(["run", "speed, m/s", "turn rate, deg/s", "range, m", "largest", "bearing, deg",
                  "largest"], rows)
    report.table(["run", "stated noise", "NEES", "dimension", "two-sided 95%", "inside"], table)

"""The experiments of SLSJF (its section IV) and of D-SLAM map joining (VII), from raw data."""

import csv
import json
import math
import statistics

from . import pictures
from .bench import IMAGES, number, tests_of

# Non-zeros and size of the information matrix in SLSJF's simulation; seconds of its Table I.
NONZEROS, SCALARS = 441286, 6340
TABLE_1 = {"slsjf": (87, 12, 46), "ekf": (12, 7287, 7)}

# A quarter of the sensors' usual noise, drawn and stated: association is certain and linearising
# once is enough, as the paper found in its world.
QUIET = ("--sigma-speed", "0.005", "--sigma-sideways", "0.0025", "--sigma-turn-rate", "0.0087266463",
         "--sigma-range", "0.025", "--sigma-bearing", "0.0043633231")
COLOUR = {"slsjf": "#c0392b", "slsjf:amd": "#d68910", "ekf": "#2471a3", "ekf-slam": "#000000",
          "dslam": "#2ca02c"}
TWO_SIGMA = "0.8646647"  # probability that the ellipse of two sigma holds


def exponent(seconds):
    """p of seconds ~ k^p over the local maps (or poses) k, least squares on logarithms; the first
    tenth, where everything fits in a cache, left out, and means of runs taken."""
    run = max(1, len(seconds) // 20)
    points = [(math.log(k + run / 2), math.log(statistics.mean(seconds[k:k + run])))
              for k in range(len(seconds) // 10, len(seconds) - run + 1, run)]
    mean_x, mean_y = (statistics.mean(p[i] for p in points) for i in (0, 1))
    return (sum((x - mean_x) * (y - mean_y) for x, y in points)
            / sum((x - mean_x) ** 2 for x, y in points))


def compared(bench, source, *options):
    """Rows of `mapjoin compare`, by method."""
    table = bench.scratch / "table.json"
    bench.call("compare", source, "--json", table, *options)
    return {row["method"]: row for row in json.loads(table.read_text())}


def seconds_per_map(row, maps):
    """Of EKF SLAM, the poses of one local map together."""
    if "seconds_per_map" in row:
        return row["seconds_per_map"]
    poses = row["seconds_per_pose"]
    return [sum(poses[k * len(poses) // maps:(k + 1) * len(poses) // maps]) for k in range(maps)]


def uncertainty(bench, file):
    """Key: (x, y, variance of x, of y, semi-axes at two sigma, direction of the longer)."""
    table = bench.scratch / "uncertainty.csv"
    bench.call("covariance", file, "--all", "--confidence", TWO_SIGMA, "--output", table)
    with open(table, newline="") as lines:
        return {r["key"]: tuple(float(r[c]) for c in ("x_m", "y_m", "c_1_1", "c_2_2", "semi_axis_1_m",
                                                      "semi_axis_2_m", "axis_1_rad"))
                for r in csv.DictReader(lines)}


def apart(a, b):
    """The largest difference of a feature's coordinate, in standard deviations of b."""
    return max(abs(a[k][i] - b[k][i]) / math.sqrt(b[k][i + 2])
               for k in b if k.startswith("point:") and k in a for i in (0, 1))


def beacons(path):
    with open(path, newline="") as lines:
        return {"point:" + r["beacon"]: (float(r["x_m"]), float(r["y_m"])) for r in csv.DictReader(lines)}


def rows_of(table, maps):
    """The table of one experiment: seconds by step, and how they grow."""
    rows = []
    for method, r in table.items():
        seconds = seconds_per_map(r, maps)
        step = r["seconds_by_step"]
        sparse = method.startswith(("slsjf", "islsjf"))
        steps = [number(step[k], 3) if sparse or k in ("add", "factor") else "" for k in
                 ("add", "order", "factor", "recover")]
        rows.append([method, f"{r['information_nonzeros']} in {r['scalars']}^2",
                     str(r.get("factor_nonzeros", "")), str(r["reordered"]) if sparse else "", *steps,
                     number(r["seconds_by_step"]["refine"], 3) if "refine_solves" in r else "",
                     number(sum(seconds) + step["refine"], 2), f"{exponent(seconds):.2f}",
                     f"{r['memory_bytes'] / 2**20:.0f}"])
        if "nees" in r:
            rows[-1] += [number(r["nees"], 0), f"{r['lower']:.0f} to {r['upper']:.0f}",
                         number(r["within_2_sigma"], 3)]
    return rows


HEAD = ["method", "non-zeros of I (dense: of P)", "of L", "reordered", "adding", "ordering", "factorising",
        "recovering", "refining", "all, s", "p", "MiB"]


def times_panel(parts, box, table, maps, title):
    curves = {m: seconds_per_map(table[m], maps) for m in COLOUR if m in table}
    run = max(1, maps // 60)
    means = {m: [math.log10(1000 * statistics.mean(s[k:k + run])) for k in range(0, len(s) - run + 1, run)]
             for m, s in curves.items()}
    low, high = (f(g(c) for c in means.values()) for f, g in ((min, min), (max, max)))
    panel = pictures.Panel(parts, box, (0, maps), (math.floor(low), math.ceil(high)), title, "local map")
    for m, curve in means.items():
        panel.line([((k + 0.5) * run, y) for k, y in enumerate(curve)], COLOUR[m])
    pictures.legend(parts, box[0], box[1] + box[3] + 56, [(m, COLOUR[m], "") for m in means], 95)


def map_panel(parts, box, found, title):
    """Features with their ellipses at two sigma, and end poses."""
    xs, ys = zip(*((v[0], v[1]) for v in found.values()))
    side = max(max(xs) - min(xs), max(ys) - min(ys)) * 1.04
    x0, y0 = (max(xs) + min(xs) - side) / 2, (max(ys) + min(ys) - side) / 2
    panel = pictures.Panel(parts, box, (x0, x0 + side), (y0, y0 + side), title, "m")
    panel.line([v[:2] for k, v in sorted(((k, v) for k, v in found.items() if k.startswith("pose:")),
                                         key=lambda kv: int(kv[0].split(":")[1]))], "#9ad29a", 0.7)
    for key, (x, y, _, _, a, b, turn) in found.items():
        if key.startswith("point:"):
            panel.dot(x, y, COLOUR["slsjf"], 0.8)
            panel.ellipse(x, y, (a, b), turn, COLOUR["slsjf"])


def close_panel(parts, box, maps, truth, title):
    """Five features in a far corner, by every method (Fig. 3(b))."""
    common = [k for k in truth if all(k in m for m in maps.values())]
    corner = max(common, key=lambda k: truth[k][0] - truth[k][1])
    near = sorted(common, key=lambda k: math.dist(truth[k], truth[corner]))[:5]
    reach = max(max(abs(m[k][i] - truth[k][i]) + m[k][4] for i in (0, 1)) for m in maps.values() for k in near)
    xs, ys = zip(*(truth[k] for k in near))
    side = max(max(xs) - min(xs), max(ys) - min(ys)) + 2.2 * reach
    x0, y0 = (max(xs) + min(xs) - side) / 2, (max(ys) + min(ys) - side) / 2
    panel = pictures.Panel(parts, box, (x0, x0 + side), (y0, y0 + side), title, "m")
    for k in near:
        panel.dot(*truth[k], "#000000")
        for method, dash in (("slsjf", ""), ("ekf", "2 3"), ("ekf-slam", "6 3")):
            x, y, _, _, a, b, turn = maps[method][k]
            panel.ellipse(x, y, (a, b), turn, COLOUR[method], dash)
    pictures.legend(parts, box[0], box[1] + box[3] + 56,
                    [("slsjf", COLOUR["slsjf"], ""), ("ekf", COLOUR["ekf"], "2 3"),
                     ("ekf-slam", COLOUR["ekf-slam"], "6 3")], 95)


def simulated(bench, name, poses, seed=1):
    field = bench.scratch / name
    bench.call("simulate", "beacons", "--poses", poses, "--speed", 0.5, "--noise", 0.25, "--seed", seed,
               "--output", field)
    return field


def slsjf_simulation(bench, report, options):
    poses, maps, seeds = (3000, 60, 2) if options.quick else (27924, 600, 10)
    report.say(f"**The simulation of SLSJF** (section IV-A): 150 m x 150 m, 2500 features, a sensor of 6 m and "
               f"180 degrees, {poses} poses, {maps} local maps by EKF SLAM, here with a quarter of the noise that "
               "the simulated data sets have. `ekf` is EKF map joining, `ekf-slam` EKF SLAM over the whole run. "
               f"In the paper I has {NONZEROS} non-zeros in {SCALARS}^2, and fusing takes 145 s by SLSJF, 7306 s by "
               "EKF map joining, 15 h by EKF SLAM, on a machine and in a language of their time. p: seconds "
               "of a local map grow as its number to the p. 2 sigma: share of the features' coordinates within two "
               "standard deviations of the truth.")
    quiet = " ".join(QUIET)
    report.commands(f"mapjoin simulate beacons --poses {poses} --speed 0.5 --noise 0.25 --seed SEED --output FIELD",
                    f"mapjoin compare FIELD --segment maps:{maps} --builder ekf --methods METHODS "
                    "--truth FIELD/beacons_true.csv --json TABLE.json --output MAPS \\",
                    f"    {quiet}")
    field, folder = simulated(bench, "field", poses), bench.scratch / "field_maps"
    cut = ("--segment", f"maps:{maps}", "--builder", "ekf", "--truth", field / "beacons_true.csv", *QUIET)
    table = compared(bench, field, *cut, "--output", folder, "--methods",
                     "slsjf,slsjf:amd,slsjf:whole,slsjf:anew:50,islsjf,ekf,ekf-slam")
    report.table(HEAD + ["NEES", "95% between", "2 sigma"], rows_of(table, maps))
    nonzeros = table["slsjf"]["information_nonzeros"]
    if not options.quick:
        report.check(NONZEROS / 3 < nonzeros < 3 * NONZEROS, "non-zeros of SLSJF's simulation")
    found = {m: uncertainty(bench, folder / f"{m}.map") for m in ("slsjf", "ekf", "ekf-slam")}
    worst = apart(found["slsjf"], found["ekf"])
    report.say(f"Features of SLSJF and of EKF map joining differ by at most {worst:.1e} of a standard deviation: "
               f"{report.check(worst < 0.1, 'agreement in the simulation of SLSJF')}.")

    report.say("With the features' numbers hidden and found again as the local maps arrive, by nearest neighbour "
               "as in the paper (`--associate nn`); as its Table I, seconds of association, of the update and of the rest:")
    matched = compared(bench, field, *cut, "--methods", "slsjf", "--associate", "nn")["slsjf"]
    step = matched["seconds_by_step"]
    kalman = table["ekf"]["seconds_by_step"]
    rest = sum(step[k] for k in ("order", "factor", "recover"))
    report.table(["method", "right matches", "recall", "association", "update", "other",
                  "in the paper: association", "update", "other"],
                 [["slsjf", f"{matched['right_matches']} of {matched['matches']}",
                   number(matched["right_matches"] / matched["seen_before"], 5), number(step["associate"], 2),
                   number(step["add"], 2), number(rest, 2), *map(str, TABLE_1["slsjf"])],
                  ["ekf, numbers given", "", "", "", number(kalman["factor"], 2), number(kalman["add"], 2),
                   *map(str, TABLE_1["ekf"])]])

    shares = {m: [] for m in ("slsjf", "slsjf:anew:50", "islsjf")}
    ratios = {m: [] for m in shares}
    for seed in range(1, seeds + 1):
        again = simulated(bench, f"field_{seed}", poses, seed)
        for m, r in compared(bench, again, *cut[:4], *QUIET, "--truth", again / "beacons_true.csv", "--methods",
                             ",".join(shares)).items():
            shares[m].append(r["within_2_sigma"])
            ratios[m].append(r["nees"] / r["dimension"])
    report.say(f"Over {seeds} such worlds. Within one the errors hang together, so that most or few are inside; the "
               "mean over worlds tells more:")
    rows = []
    for m, s in shares.items():
        holds = "" if m == "slsjf" else report.check(statistics.mean(s) >= 0.93, f"errors inside 2 sigma, {m}")
        rows.append([m, number(statistics.mean(s), 3), number(min(s), 3), number(max(s), 3),
                     number(statistics.mean(ratios[m]), 3), holds])
    report.table(["method", "share inside 2 sigma, mean", "least", "largest", "NEES over its dimension, mean",
                  "at least 0.93"], rows)
    report.say("Linearised once the filter may believe to know too well which way the whole map lies: that alone puts "
               "the features far from its start outside. Seen from the nearest end pose 93 to 98% are inside, with four "
               "times the noise, by the tests below.")
    if not options.quick:
        parts = []
        map_panel(parts, (50, 40, 380, 380), found["slsjf"], "Map of SLSJF, ellipses at two sigma")
        close_panel(parts, (490, 40, 380, 380), found, beacons(field / "beacons_true.csv"),
                    "Five features of the far corner; dots: the truth")
        times_panel(parts, (50, 520, 820, 260), table, maps, "Time for each local map, log10 of ms")
        pictures.write(IMAGES / "slsjf_simulation.svg", 900, 850, parts)
    report.say("![The simulation of SLSJF](images/slsjf_simulation.svg)")


def slsjf_victoria_park(bench, report, options):
    report.say("**Victoria Park** (section IV-B): 200 local maps by EKF SLAM from the raw measurements. In the paper "
               "fusing takes 22 s.")
    report.commands("mapjoin compare $DATA/landmark_graphs/victoria_park.g2o --segment maps:200 --builder ekf "
                    "--methods METHODS --json TABLE.json --output MAPS")
    folder = bench.scratch / "park_maps"
    table = compared(bench, bench.source("landmarks", "victoria_park"), "--segment", "maps:200", "--builder", "ekf",
                     "--methods", "slsjf,slsjf:amd,slsjf:whole,islsjf,ekf,ekf-slam", "--output", folder)
    report.table(HEAD, rows_of(table, 200))
    found = {m: uncertainty(bench, folder / f"{m}.map") for m in ("slsjf", "ekf")}
    worst = apart(found["slsjf"], found["ekf"])
    report.say(f"Features of SLSJF and of EKF map joining differ by at most {worst:.1e} of a standard deviation: "
               f"{report.check(worst < 0.1, 'agreement on Victoria Park')}.")
    if not options.quick:
        parts = []
        map_panel(parts, (50, 40, 380, 380), found["slsjf"], "Map of SLSJF, ellipses at two sigma")
        times_panel(parts, (490, 40, 380, 380), table, 200, "Time for each local map, log10 of ms")
        pictures.write(IMAGES / "slsjf_victoria_park.svg", 900, 500, parts)
    report.say("![Victoria Park by SLSJF](images/slsjf_victoria_park.svg)")


def often_seen(folder, maps):
    """Three features that several of so many local maps see, the best seen and the least among them."""
    with open(folder / "observations.csv", newline="") as lines:
        seen = [(int(r["step"]), int(r["beacon"])) for r in csv.DictReader(lines)]
    last = max(step for step, _ in seen) + 1
    count = {b: len({step * maps // last for step, c in seen if c == b}) for _, b in seen}
    several = sorted((b for b in count if count[b] > 1), key=lambda b: (-count[b], b))
    return [f"point:{several[k]}" for k in (0, len(several) // 2, len(several) - 1)]


def sights(row, key):
    """Times, errors' bounds and estimates of a watched feature."""
    return [(t, x, y, sx, sy) for t, x, y, sx, sy in row["watched"].get(key, [])]


def dslam_simulation(bench, report, options):
    report.say("**The simulation of D-SLAM map joining** (section VII, Fig. 4): a square of 40 m with 196 features, a "
               "sensor of 5 m and 180 degrees, five local maps; and simu_535, the published world. EKF SLAM over the "
               "whole run, D-SLAM (a local map an instant; neighbours that share too few features are joined first) and "
               "D-SLAM map joining: standard deviations of three features, m, when the run ends.")
    report.commands("mapjoin simulate beacons --beacons-a-side 14 --world-size 40 --sensor-range 5 --poses 1500 "
                    "--output SQUARE",
                    "mapjoin compare SQUARE --segment maps:5 --builder ekf --methods dslam,ekf-slam --watch KEYS "
                    "--json TABLE.json",
                    "mapjoin compare SQUARE --segment poses:1 --builder ekf --methods dslam --watch KEYS --json TABLE.json",
                    "mapjoin compare $DATA/mat/simu_535_5 --methods dslam --watch KEYS --json TABLE.json")
    square = bench.scratch / "square"
    bench.call("simulate", "beacons", "--beacons-a-side", 14, "--world-size", 40, "--sensor-range", 5, "--poses", 1500,
               "--output", square)
    raw = bench.data / "simulation/simu_535"
    worlds = {"square": (square, ()),
              "simu_535": (raw, ("--sigma-turn-rate", "0.0716", "--nearest", "0.5"))}
    rows = []
    for name, (source, sigmas) in worlds.items():
        keys = often_seen(source, 5)
        common = ("--builder", "ekf", *sigmas, "--watch", ",".join(keys))
        joined = compared(bench, source, "--segment", "maps:5", *common, "--methods", "dslam,ekf-slam")
        instants = compared(bench, source, "--segment", "poses:1", *common, "--methods", "dslam")
        curves = {"ekf-slam": joined["ekf-slam"], "D-SLAM": instants["dslam"], "D-SLAM map joining": joined["dslam"]}
        if name == "simu_535":
            try:
                curves["the published local maps, joined"] = compared(
                    bench, bench.data / "mat/simu_535_5", "--methods", "dslam", "--watch", ",".join(keys))["dslam"]
            except Exception:  # a build without matio
                report.say("The published local maps are MATLAB files, which this build does not read.")
        truth = beacons(source / "beacons_true.csv")
        for key in keys:
            ends = {m: sights(r, key)[-1] for m, r in curves.items()}
            bound = {m: math.sqrt((e[3] ** 2 + e[4] ** 2) / 2) for m, e in ends.items()}
            error = {m: math.dist(e[1:3], truth[key]) / math.sqrt(2) for m, e in ends.items()}
            holds = bound["D-SLAM"] > bound["D-SLAM map joining"] and (
                name != "square" or bound["D-SLAM map joining"] < 1.1 * bound["ekf-slam"])
            for m in curves:
                rows.append([name, key, m, number(bound[m], 4), number(error[m], 4),
                             number(bound[m] / bound["ekf-slam"], 3),
                             report.check(holds, f"bounds of {key} of {name}") if m == "D-SLAM map joining" else ""])
        if name == "square" and not options.quick:
            figure_4(curves, keys, truth)
    report.table(["world", "feature", "method", "standard deviation", "error", "over that of EKF SLAM", "holds"], rows)
    report.say("Promised is that joining is less certain than EKF SLAM by a tenth at most in the square, and that D-SLAM is "
               "less certain than joining in both. Neighbours in simu_535 share two or three features, which is all that "
               "links them where poses are dropped: there joining is less certain by a third where the run ends.")
    report.say("![Three features over time](images/dslam_simulation.svg)")
    report.say("*Solid: two standard deviations of x; dashed: the error of x. D-SLAM map joining knows of a feature "
               "when a local map ends.*")
    tests_of(bench, report, "mapjoin_data_tests", "DslamSimulation.*")


def figure_4(curves, keys, truth):
    parts, colours = [], ("#000000", "#2ca02c", "#c0392b")
    for k, key in enumerate(keys):
        top = pictures.nice(1.1 * max(2 * s[3] for m, r in curves.items() for s in sights(r, key)))
        last = max(s[0] for r in curves.values() for s in sights(r, key))
        panel = pictures.Panel(parts, (60, 40 + 250 * k, 800, 180), (0, last), (-top, top),
                               f"{key}: error and bounds of x, m", "pose" if k == 2 else "")
        for (m, r), colour in zip(curves.items(), colours):
            seen = sights(r, key)
            # What was known holds until more is.
            steps = [p for a, b in zip(seen, seen[1:] + [(last, *seen[-1][1:])]) for p in (a, (b[0], *a[1:]))]
            for sign in (-1, 1):
                panel.line([(s[0], sign * 2 * s[3]) for s in steps], colour)
            panel.line([(s[0], s[1] - truth[key][0]) for s in steps], colour, 1.0, "4 3")
    pictures.legend(parts, 60, 800, [(m, c, "") for m, c in zip(curves, colours)])
    pictures.write(IMAGES / "dslam_simulation.svg", 900, 820, parts)

"""Local maps from raw measurements."""

import math
import re

from .bench import IMAGES, Failed, figures, near, number, tests_of
from .building_logs import fig8_of_logs
from .data_sets import LANDMARKS, ROWS, label, row

BEST = "optimum over the maps"


def by_local_maps(bench, source, n, *options, output="out.g2o"):
    """solve --local-maps: seconds to build, seconds to join, what else it reports, and the result."""
    stats, out = bench.solve("solve", source, "--local-maps", str(n), *options, output=output)
    built, joined = re.search(r"built in ([0-9.]+) s and joined in ([0-9.]+) s",
                              " ".join(stats["notes"])).groups()
    return float(built), float(joined), stats, out


def fig8_picture(curves):
    """RMSE over the number of local maps, both logarithmic, as SVG."""
    width, height, margin = 620, 360, 60
    xs = [math.log10(n) for n in next(iter(curves.values()))]
    values = [max(v, 1e-7) for curve in curves.values() for v in curve.values()]
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    x_of = lambda n: margin + (math.log10(n) - xs[0]) / (xs[-1] - xs[0]) * (width - 2 * margin)
    y_of = lambda v: height - margin - (math.log10(max(v, 1e-7)) - low) / (high - low) * (height - 2 * margin)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
           f'font-family="sans-serif" font-size="12">',
           f'<rect width="{width}" height="{height}" fill="white"/>',
           f'<text x="{margin}" y="24" font-size="15">Victoria Park: RMSE of poses to the optimum, m</text>',
           f'<text x="{width // 2}" y="{height - 12}" text-anchor="middle">local maps</text>']
    for d in range(low, high + 1):
        y = y_of(10.0 ** d)
        out.append(f'<line x1="{margin}" x2="{width - margin}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
                   f'<text x="{margin - 6}" y="{y + 4:.1f}" text-anchor="end">1e{d}</text>')
    for n in next(iter(curves.values())):
        out.append(f'<text x="{x_of(n):.1f}" y="{height - margin + 18}" text-anchor="middle">{n}</text>')
    for k, (name, curve) in enumerate(curves.items()):
        colour = ("#4363d8", "#e6550d", "#2ca02c")[k % 3]
        points = " ".join(f"{x_of(n):.1f},{y_of(v):.1f}" for n, v in curve.items())
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>'
                   f'<text x="{width - margin - 150}" y="{44 + 16 * k}" fill="{colour}">{name}</text>')
    return "\n".join(out + ["</svg>"]) + "\n"


def rows_of_fig8(bench, report, options, name, n, curves):
    """Observing joins, summaries, and the optimum over the same local maps: rows of the table.
    Returns them and the seconds of the observing one."""
    graph, rows, total = bench.source("landmarks", name), [], None
    folder = bench.scratch / f"built_{name}_{n}"
    bench.call("build", graph, "--segment", f"maps:{n}", "--output", folder)
    _, best = bench.solve("join", folder, "--mode", "optimal", output="best.g2o")
    for mode in ("observe", "summary", BEST):
        built = joined = apart = None
        out, holds = best, ""
        if mode != BEST:
            runs = [by_local_maps(bench, graph, n, "--mode", mode) for _ in range(options.repeat)]
            built, joined = min(r[0] for r in runs), min(r[1] for r in runs)
            out = runs[-1][3]
            apart = figures(bench.call("evaluate", out, "--reference", best))
            apart = max(apart["pose_rmse"], apart["feature_rmse"])
        if mode == "observe":
            total = built + joined
            if name == "victoria_park":
                holds = report.check(apart <= 0.005, f"observe, {n} local maps")
        f = bench.evaluate(out, "landmarks", name)
        curves.setdefault(mode, {})[n] = f["pose_rmse"]
        rows.append([str(n), mode, number(built, 2), number(joined, 2),
                     number(built and built + joined, 2), number(f["chi2"], 4),
                     number(f["pose_rmse"], 6), number(f["feature_rmse"], 6),
                     number(f["aligned_feature_rmse"], 6), number(apart, 6), holds])
    return rows, total


def full_solve(bench, options, name):
    """Seconds of one nonlinear solve from odometry, and the chi2 where it ends."""
    try:
        runs = [by_local_maps(bench, bench.source("landmarks", name), 1, "--whole", "--mode", "observe")
                for _ in range(options.repeat)]
    except Failed:
        return None, "no end in 100 iterations"
    return min(run[0] for run in runs), number(runs[0][2]["chi2"], 4)


def fig8(bench, report, options):
    report.commands("mapjoin solve $DATA/landmark_graphs/NAME.g2o --local-maps N --mode observe "
                    "--output OUT.g2o",
                    "mapjoin build ... --segment maps:N --output MAPS; mapjoin join MAPS --output BEST.g2o",
                    "mapjoin evaluate OUT.g2o --graph ... --reference ...           # or BEST.g2o",
                    "mapjoin solve ... --local-maps 1 --whole --output OUT.g2o      # one full solve")
    head = ["n", "joined", "s build", "s join", "s in all", "chi2", "poses", "features", "best fit",
            "to the optimum over the maps", "holds"]
    for name, counts in (("victoria_park", (5, 10, 20, 50, 100, 200, 6898)), ("dlr", (20, 50, 200))):
        seconds, chi2 = full_solve(bench, options, name)
        rows, curves, total = [["1", "one full solve", number(seconds, 2), "", number(seconds, 2), chi2,
                                "", "", "", "", ""]], {}, {}
        for n in counts:
            more, total[n] = rows_of_fig8(bench, report, options, name, n, curves)
            rows += more
        report.say(f"{name}.g2o:")
        report.table(head, rows)
        if seconds is not None:
            holds = report.check(total[20] < seconds, f"{name}, n = 20 quicker than one full solve")
            report.say(f"n = 20, built and joined in observe mode: {total[20]:.2f} s; one full solve by "
                       f"Ceres from odometry: {seconds:.2f} s. Quicker: {holds}.")
        if name == "dlr":
            report.say("DLR is one long loop, closed by the last join: RMSE is mostly a turn of the whole "
                       "against pose 0 (\"best fit\": features after the best rigid fit instead). Nothing "
                       "is promised of it.")
        if name == "victoria_park" and not options.quick and (options.update or not options.items):
            (IMAGES / "local_maps.svg").write_text(fig8_picture(curves))
            report.say("![RMSE over the number of local maps](images/local_maps.svg)")


def one_optimum(bench, report, options):
    counts = ("1", "5", "20", "50", "200")
    report.say("`solve --local-maps N` in optimal mode: the same optimum (1e-6) whatever N, builder and "
               "frame of the local maps, N = 1 too: what is large is built in parts that are joined "
               "([building](building.md)). Cells: chi2 over that of the optimum, as the data's README prints "
               "it, less 1.")
    report.commands("mapjoin solve NAME.g2o --local-maps N --builder BUILDER --local-anchor ANCHOR "
                    "--output OUT.g2o")
    rows = []
    for kind, name in [("landmarks", n) for n in LANDMARKS] + ROWS[:5]:
        known = row(kind, name)[0]
        for builder in ("nls", "ekf"):
            for anchor in ("start", "end") + (("features",) if kind == "landmarks" else ()):
                cells, slowest = [], 0.0
                for n in counts:
                    stats, _ = bench.solve_row(kind, name, "--local-maps", n, "--builder", builder,
                                               "--local-anchor", anchor)
                    slowest = max(slowest, stats["seconds"]["solve"])
                    away = stats["chi2"] / known - 1.0
                    report.check(near(stats["chi2"], known), f"{name}, {n} maps, {builder}, {anchor}")
                    cells.append(f"{away:.0e}" + ("" if near(stats["chi2"], known) else " **no**"))
                rows.append([label(kind, name), builder, anchor, *cells, number(slowest, 2)])
    report.table(["data", "builder", "frame", *(f"N = {n}" for n in counts), "s, the slowest"], rows)


def local_maps(bench, report, options):
    report.section(16, "Local maps from raw measurements", "Recordings cut into n local maps, each built "
                   "by nonlinear least squares from its own measurements (Fig. 8 of Linear SLAM). "
                   "Promised of Victoria Park: observing joins within 0.005 m of the optimum over the same "
                   "local maps at every n; at n = 20 quicker in all than one full nonlinear solve of the "
                   "same graph from odometry, wherever that ends: its chi2 says where. Tables: RMSE to the "
                   "least squares optimum over the measurements, metres, in the frame of pose 0.")
    fig8(bench, report, options)
    fig8_of_logs(bench, report, options)
    one_optimum(bench, report, options)
    report.say("Simulated worlds of ranges, of bearings, with outliers, and the simulated runs from their "
               "raw logs, by tests:")
    tests_of(bench, report, "mapjoin_tests", "BuiltMaps.*Consistent:BuiltMaps.ARobustLoss*")
    tests_of(bench, report, "mapjoin_data_tests", "*RawSimulation*")
    slsjf_simulation(bench, report)
    report.close()


def slsjf_simulation(bench, report):
    report.say("The simulation of SLSJF (its section IV-A) many times: the part of the coordinates of all "
               "features and poses, in the frame of the first pose, that is within two standard deviations "
               "of the truth. 0.9545 is promised, of the mean over runs: errors of one run hang together (a "
               "turn of the whole moves everything), so that in one run all are inside and in another "
               "hardly any (\"least\"). Were each run all or nothing, the mean would lie that far from it with "
               "95%. NEES over hundreds of runs shows what linearising costs: maps are one percent more "
               "certain than they should be, those of the filter most. It goes with the noise: of a tenth "
               "of it nothing is left.")
    printed = tests_of(bench, report, "mapjoin_data_tests", "SlsjfWorld*")
    found = re.findall(r"^(.*), (nls|ekf), (\d+) runs: mean share inside 2 sigma ([0-9.]+), plus or minus "
                       r"([0-9.]+), least ([0-9.]+); mean NEES a dimension ([0-9.]+), 95% between "
                       r"([0-9.]+) and ([0-9.]+)$", printed, re.M)
    rows = []
    for world, builder, n, mean, spread, least, nees, low, high in found:
        holds = abs(float(mean) - 0.9545) <= float(spread)
        if int(n) > 10:  # fewer say little
            holds = report.check(holds and 0.93 <= float(mean) <= 0.98, f"{world}, {builder}: share inside")
        else:
            holds = ""
        rows.append([world, builder, n, mean, spread, least, holds, nees, f"{low} and {high}",
                     "yes" if float(low) <= float(nees) <= float(high) else "no"])
    report.table(["world", "builder", "runs", "mean share inside", "0.9545 plus or minus", "least",
                  "within, and 0.93 to 0.98", "NEES a dimension", "95% between", "inside"], rows)

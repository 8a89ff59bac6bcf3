"""Local maps from raw measurements."""

import math
import re
from pathlib import Path

from .bench import *
from .data_sets import *


def build_seconds(text):
    """What mapjoin build says it took to build the local maps."""
    return float(re.search(r"([0-9.]+) build", text)[1])


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


def local_maps(bench, report, options):
    report.section(len(SECTIONS), "Local maps from raw measurements", "Victoria Park cut into n local "
                   "maps, each built by nonlinear least squares from its own measurements (Fig. 8 of "
                   "Linear SLAM). Observing joins within 0.005 m of the optimum over the same local "
                   "maps at every n; at n = 20 quicker in all than one full nonlinear solve of the same "
                   "graph from odometry (n = 1). Table: RMSE to the least squares optimum over the "
                   "measurements, metres.")
    report.commands("mapjoin build $DATA/landmark_graphs/victoria_park.g2o --segment maps:N --output MAPS",
                    "mapjoin join MAPS --mode observe --output OUT.g2o          # summary, optimal",
                    "mapjoin evaluate OUT.g2o --graph ... --reference ...")
    graph = bench.source("landmarks", "victoria_park")
    reference = bench.reference("landmarks", "victoria_park")
    rows, curves, total = [], {"observe": {}, "summary": {}, "optimum over the maps": {}}, {}
    for n in (1, 5, 10, 20, 50, 100, 200, 6898):
        folder = bench.scratch / f"built_{n}"
        built = min(build_seconds(bench.call("build", graph, "--segment", f"maps:{n}", "--output",
                                             folder.with_suffix(f".{k}")))
                    for k in range(options.repeat))
        folder = folder.with_suffix(".0")
        if n == 1:
            total[n] = built
            rows.append(["1", "full solve", number(built, 2), "", number(built, 2)] + [""] * 5)
            continue
        _, best = bench.solve("join", folder, "--mode", "optimal", output="best.g2o")
        for mode in ("observe", "summary", "optimal"):
            runs = [bench.solve("join", folder, "--mode", mode) for _ in range(options.repeat)]
            joined = min(stats["seconds"]["solve"] for stats, _ in runs)
            out = runs[-1][1]
            f = bench.evaluate(out, "landmarks", "victoria_park")
            apart = figures(bench.call("evaluate", out, "--reference", best))
            name = "optimum over the maps" if mode == "optimal" else mode
            if n < 6898 or mode != "optimal":
                curves[name][n] = f["pose_rmse"]
            if mode == "observe":
                total[n] = built + joined
            holds = "" if mode != "observe" else report.check(
                max(apart["pose_rmse"], apart["feature_rmse"]) <= 0.005, f"observe, {n} local maps")
            rows.append([str(n), name, number(built, 2), number(joined, 2), number(built + joined, 2),
                         number(f["chi2"], 4), number(f["pose_rmse"], 6), number(f["feature_rmse"], 6),
                         number(max(apart["pose_rmse"], apart["feature_rmse"]), 6), holds])
    report.table(["n", "joined", "s build", "s join", "s in all", "chi2", "poses", "features",
                  "to the optimum over the maps", "holds"], rows)
    report.check(total[20] < total[1], "n = 20 quicker than one full solve")
    report.say(f"n = 20, built and joined in observe mode: {total[20]:.2f} s; one full solve by Ceres from "
               f"odometry: {total[1]:.2f} s.")
    if not options.quick and not options.items:
        (HERE / "docs" / "images" / "local_maps.svg").write_text(fig8_picture(curves))
        report.say("![RMSE over the number of local maps](images/local_maps.svg)")

    report.say("`solve --local-maps N` in optimal mode: the same optimum (1e-6) whatever N, builder and "
               "frame of the local maps.")
    rows = []
    for kind, name in [("landmarks", n) for n in LANDMARKS] + ROWS[:5]:
        for words in (("--local-maps", "50"), ("--local-maps", "200", "--local-anchor", "end"),
                      ("--local-maps", "200", "--builder", "ekf")):
            if name in ("city_10000",) and words[1] == "50":
                continue
            stats, _ = bench.solve_row(kind, name, *words)
            known = row(kind, name)[0]
            rows.append([label(kind, name), " ".join(words), number(known, 6 if known < 100 else 4),
                         number(stats["chi2"], 6), number(stats["seconds"]["solve"], 2),
                         report.check(near(stats["chi2"], known), f"{name} {' '.join(words)}")])
    report.table(["data", "options", "optimum", "chi2", "seconds", "holds"], rows)

    report.say("Simulated worlds of ranges, of bearings, with outliers, and the simulation of SLSJF, by "
               "tests:")
    tests_of(bench, report, "mapjoin_tests", "BuiltMaps.*Consistent:BuiltMaps.ARobustLoss*")
    tests_of(bench, report, "mapjoin_data_tests", "*RawSimulation*:SlsjfSimulation*")
    report.close()

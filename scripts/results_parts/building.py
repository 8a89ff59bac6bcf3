"""Local maps from raw measurements."""

import math
import re

from .bench import IMAGES, figures, near, number, tests_of
from .data_sets import LANDMARKS, ROWS, label, row


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


def local_maps(bench, report, options):
    report.section(16, "Local maps from raw measurements", "Victoria Park cut into n local "
                   "maps, each built by nonlinear least squares from its own measurements (Fig. 8 of "
                   "Linear SLAM). Observing joins within 0.005 m of the optimum over the same local "
                   "maps at every n; at n = 20 quicker in all than one full nonlinear solve of the same "
                   "graph from odometry (n = 1), wherever that ends: its chi2 says where. Table: RMSE to the least squares optimum over the "
                   "measurements, metres.")
    report.commands("mapjoin solve $DATA/landmark_graphs/victoria_park.g2o --local-maps N --mode observe "
                    "--output OUT.g2o",
                    "mapjoin build ... --segment maps:N --output MAPS; mapjoin join MAPS --output BEST.g2o",
                    "mapjoin evaluate OUT.g2o --graph ... --reference ...           # or BEST.g2o")
    graph = bench.source("landmarks", "victoria_park")
    rows, curves, total = [], {"observe": {}, "summary": {}, "optimum over the maps": {}}, {}
    full = min((by_local_maps(bench, graph, 1, "--mode", "observe") for _ in range(options.repeat)),
               key=lambda run: run[0])
    total[1] = full[0]
    rows.append(["1", "one full solve", number(full[0], 2), "", number(full[0], 2),
                 number(full[2]["chi2"], 4), "", "", "", ""])
    for n in (5, 10, 20, 50, 100, 200, 6898):
        folder, best = bench.scratch / f"built_{n}", bench.scratch / "best.g2o"
        bench.call("build", graph, "--segment", f"maps:{n}", "--output", folder)
        _, best = bench.solve("join", folder, "--mode", "optimal", output="best.g2o")
        for mode in ("observe", "summary", "optimum over the maps"):
            built = joined = apart = None
            if mode == "optimum over the maps":
                out = best
            else:
                runs = [by_local_maps(bench, graph, n, "--mode", mode) for _ in range(options.repeat)]
                built, joined = min(r[0] for r in runs), min(r[1] for r in runs)
                out = runs[-1][3]
                apart = figures(bench.call("evaluate", out, "--reference", best))
                apart = max(apart["pose_rmse"], apart["feature_rmse"])
            f = bench.evaluate(out, "landmarks", "victoria_park")
            curves[mode][n] = f["pose_rmse"]
            holds = ""
            if mode == "observe":
                total[n] = built + joined
                holds = report.check(apart <= 0.005, f"observe, {n} local maps")
            rows.append([str(n), mode, number(built, 2), number(joined, 2),
                         number(built and built + joined, 2), number(f["chi2"], 4),
                         number(f["pose_rmse"], 6), number(f["feature_rmse"], 6), number(apart, 6),
                         holds])
    report.table(["n", "joined", "s build", "s join", "s in all", "chi2", "poses", "features",
                  "to the optimum over the maps", "holds"], rows)
    report.check(total[20] < total[1], "n = 20 quicker than one full solve")
    report.say(f"n = 20, built and joined in observe mode: {total[20]:.2f} s; one full solve by Ceres from "
               f"odometry: {total[1]:.2f} s.")
    if not options.quick and not options.items:
        (IMAGES / "local_maps.svg").write_text(fig8_picture(curves))
        report.say("![RMSE over the number of local maps](images/local_maps.svg)")

    report.say("`solve --local-maps N` in optimal mode: the same optimum (1e-6) whatever N, builder and "
               "frame of the local maps.")
    rows = []
    for kind, name in [("landmarks", n) for n in LANDMARKS] + ROWS[:5]:
        for words in (("--local-maps", "50"), ("--local-maps", "200", "--local-anchor", "end"),
                      ("--local-maps", "200", "--builder", "ekf")):
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

"""Whether names matter: shuffled ids, and recordings of several sessions."""

import random
import subprocess
import sys

from .bench import figures, near, number
from .data_sets import GRAPHS


def edges_of(path):
    for line in open(path):
        words = line.split()
        if words and words[0].startswith("EDGE"):
            yield words[0], int(words[1]), int(words[2]), " ".join(words[3:])


def shuffled_ids(bench, report, options):
    report.section(5, "Shuffled ids", "Vertices renamed at random, edges in random order, seeds 1 to "
                   "5: the same optimum.")
    report.commands("mapjoin solve SHUFFLED.g2o --output OUT.g2o",
                    "mapjoin evaluate OUT.g2o --graph SHUFFLED.g2o",
                    "python3 $DATA/../tools/chi2.py SHUFFLED.g2o OUT.g2o")
    rows = []
    for name in GRAPHS:
        known, cells = GRAPHS[name][0], []
        for seed in range(1, 2 if options.quick else 6):
            edges = list(edges_of(bench.source("graph", name)))
            ids = sorted({v for _, a, b, _ in edges for v in (a, b)})
            renamed = list(ids)
            chance = random.Random(seed)
            chance.shuffle(renamed)
            chance.shuffle(edges)
            name_of = dict(zip(ids, renamed))
            path = bench.scratch / "shuffled.g2o"
            write_edges(path, [(t, name_of[a], name_of[b], r) for t, a, b, r in edges])
            _, out = bench.solve("solve", path)
            ours = figures(bench.call("evaluate", out, "--graph", path))["chi2"]
            holds = near(ours, known)
            if seed == 1:
                tool = subprocess.run([sys.executable, bench.chi2_tool, path, out],
                                      capture_output=True, text=True, check=True).stdout
                holds = holds and near(figures(tool)["chi2"], known)
            cells.append(number(ours, 6) + ("" if holds else " (**no**)"))
            report.check(holds, f"{name}, seed {seed}")
        rows.append([name, number(known, 6 if known < 100 else 4)] + cells)
    report.table(["data", "optimum"] + [f"seed {k + 1}" for k in range(len(rows[0]) - 2)], rows)
    report.close()


def write_edges(path, edges):
    path.write_text("".join(f"{tag} {a} {b} {rest}\n" for tag, a, b, rest in edges))


def without_sessions(path, cut):
    """A result of two sessions with the ids of the whole: ids are written as session * 10^k + id."""
    lines = [line.split() for line in open(path) if line.startswith("VERTEX")]
    base = 10 ** (len(lines[0][1]) - 1)
    plain = path.with_name("plain.g2o")
    with open(plain, "w") as out:
        for tag, key, *values in lines:
            session, old = divmod(int(key), base)
            out.write(f"{tag} {old + (session - 1) * cut} {' '.join(values)}\n")
    return plain


def join_recordings(bench, report, name, links, cut):
    """Joins first.map and second.map in three modes and judges the results by the whole."""
    known, rows = GRAPHS["sphere_2500"][0], []
    maps = [bench.scratch / "first.map", bench.scratch / "second.map"]
    for mode in ("optimal", "observe", "summary"):
        options = ["--links", bench.scratch / "links.g2o"] if links else []
        _, out = bench.solve("join", maps, "--mode", mode, *options, output="both.g2o")
        if links:
            out = without_sessions(out, cut)
        ours = bench.evaluate(out, "graph", "sphere_2500")["chi2"]
        tool = bench.judge(out, "graph", "sphere_2500")
        word = "recorded"
        if mode == "optimal":
            word = report.check(near(ours, known) and near(tool, known), name)
        rows.append([name, mode, number(ours, 6), number(tool, 6), word])
    return rows


def recordings(bench, report, options):
    report.section(6, "Sessions", "sphere_2500 in two recordings of 1250 poses, each edge in exactly "
                   "one, solved alone into native maps and joined from the command line: the optimum "
                   "of the whole, 1153.8544.")
    cut = 1250
    edges = list(edges_of(bench.source("graph", "sphere_2500")))
    first, second = bench.scratch / "first.g2o", bench.scratch / "second.g2o"
    before = [e for e in edges if max(e[1], e[2]) < cut]
    rest = [e for e in edges if max(e[1], e[2]) >= cut]
    shared = {v for e in rest for v in e[1:3] if v < cut}
    report.say(f"Edges across the cut in the second recording ({len(before)} and {len(rest)} edges, "
               f"{len(shared)} poses in both):")
    report.commands("mapjoin solve first.g2o --output first.map",
                    "mapjoin solve second.g2o --output second.map",
                    "mapjoin join first.map second.map --output both.g2o       # --mode ...",
                    "mapjoin evaluate both.g2o --graph $DATA/pose_graphs/sphere_2500.g2o")
    write_edges(first, before)
    write_edges(second, rest)
    bench.solve("solve", first, output="first.map")
    bench.solve("solve", second, output="second.map")
    rows = join_recordings(bench, report, "one numbering", False, cut)

    after = [(t, a - cut, b - cut, r) for t, a, b, r in rest if min(a, b) >= cut]
    key = lambda v: f"{v // cut + 1}/{v % cut}"
    links = [(t, key(a), key(b), r) for t, a, b, r in rest if min(a, b) < cut]
    write_edges(second, after)
    write_edges(bench.scratch / "links.g2o", links)
    bench.solve("solve", first, "--session", "1", output="first.map")
    bench.solve("solve", second, "--session", "2", output="second.map")
    report.say(f"Both renumbered from 0 and read under sessions of their own, the {len(links)} edges "
               f"across the cut in a file of their own (`{' '.join(links[0][:3])} ...`):")
    report.commands("mapjoin solve first.g2o --session 1 --output first.map",
                    "mapjoin solve second.g2o --session 2 --output second.map",
                    "mapjoin join first.map second.map --links links.g2o --output both.g2o")
    rows += join_recordings(bench, report, "two sessions and links", True, cut)
    report.table(["recordings", "--mode of join", "chi2", "by chi2.py", "the optimum"], rows)
    report.close()

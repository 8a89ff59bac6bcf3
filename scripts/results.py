#!/usr/bin/env python3
"""Measures what the project promises and writes docs/results.md. Python's standard library only.

    scripts/results.py                    all of it, about ten minutes
    scripts/results.py --quick            one repetition, small worlds, short limits; prints to stdout
    scripts/results.py --items 3,7        only these; --update puts them into docs/results.md

Runs the built program on the data sets in ../shared/data (or where MAPJOIN_DATA points) and, where
they are built, the tests that show what a program cannot. Every figure is judged twice where the
data sets' own tool, tools/chi2.py beside the data, can judge it.
"""

import argparse
import os
import platform
import sys
import tempfile
import time
from pathlib import Path

from results_parts.association import association
from results_parts.back_end import back_end
from results_parts.bench import Bench, Report
from results_parts.building import local_maps
from results_parts.by_tests import bad_inputs, frames
from results_parts.feature_only import feature_only
from results_parts.filters import filters
from results_parts.joining import lemma, observe, optimum, published
from results_parts.numbering import recordings, shuffled_ids
from results_parts.speed import large_worlds, scale, speed
from results_parts.table_1 import table_1
from results_parts.uncertainty import uncertainty

HERE = Path(__file__).resolve().parent.parent

SECTIONS = [optimum, observe, published, lemma, shuffled_ids, recordings, speed, large_worlds,
            bad_inputs, frames, scale, feature_only, uncertainty, filters, association,
            local_maps, table_1, back_end]


def page(report, bench, options, seconds):
    version = bench.call("--version").strip()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    command = "scripts/results.py" + (" --quick" if options.quick else "")
    text = (f"# Results\n\nWritten by `{command}`; not edited by hand. `mapjoin` is the release build, "
            f"build/release/mapjoin ({version}); `$DATA` is ../shared/data; local-map sets are unpacked "
            "where the commands run. The authors are those of Linear SLAM; their chi2 and seconds are "
            "of their program, run again on a machine like this one, RMSE is as their paper prints "
            "it.\n\n| item | | holds |\n|---|---|---|\n")
    text += "".join(f"| {item} | {title} | {verdict} |\n" for item, title, verdict in report.verdicts)
    text += "".join(report.sections)
    text += (f"\n## The machine\n\n{os.cpu_count()} cores ({platform.machine()}), {memory:.0f} GiB of "
             f"memory, {platform.system()}; one thread of BLAS. All of this took "
             f"{seconds / 60:.0f} minutes.\n\n## What is not met\n\n")
    misses = [f"* Item {item}: {what}.\n" for item, what in report.misses]
    return text + ("".join(misses) or "Nothing that was asked for.\n")


def updated(page, report):
    """The page with these sections instead of its own; new ones at the end."""
    head, rest = page.split("\n## ", 1)
    body, machine = ("\n## " + rest).split("\n## The machine", 1)
    machine, misses = machine.split("\n## What is not met\n\n")
    sections = {int(text.split(".", 1)[0]): "\n## " + text for text in body.split("\n## ")[1:]}
    for text in "".join(report.sections).split("\n## ")[1:]:
        sections[int(text.split(".", 1)[0])] = "\n## " + text
    table, rows = head.split("|---|---|---|\n")
    rows = {int(row.split("|")[1]): row for row in rows.strip().split("\n")}
    rows.update({item: f"| {item} | {title} | {verdict} |"
                 for item, title, verdict in report.verdicts})
    new = {item for item, _, _ in report.verdicts}
    kept = [line for line in misses.strip().split("\n")
            if line.startswith("* Item ") and int(line.split()[2].rstrip(":")) not in new]
    kept += [f"* Item {item}: {what}." for item, what in report.misses]
    return (table + "|---|---|---|\n" + "\n".join(rows[k] for k in sorted(rows)) + "\n"
            + "".join(sections[k] for k in sorted(sections)) + "\n## The machine" + machine
            + "\n## What is not met\n\n"
            + ("\n".join(sorted(kept, key=lambda line: int(line.split()[2].rstrip(":"))))
               or "Nothing that was asked for.") + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--program", default=HERE / "build/release/mapjoin", help="the built program")
    parser.add_argument("--data", default=os.environ.get("MAPJOIN_DATA", HERE / "../shared/data"))
    parser.add_argument("--output", help="where the page goes [docs/results.md; --quick: stdout]")
    parser.add_argument("--items", default="", help="only these, as 1,3,7; prints to stdout")
    parser.add_argument("--update", action="store_true",
                        help="with --items: put them into docs/results.md (or --output)")
    parser.add_argument("--limit", type=float, help="seconds for a sequential run [1800; --quick: 5]")
    parser.add_argument("--repeat", type=int, help="repetitions for seconds [3; --quick: 1]")
    parser.add_argument("--quick", action="store_true", help="a look, not the record")
    options = parser.parse_args()
    options.limit = options.limit or (5 if options.quick else 1800)
    options.repeat = options.repeat or (1 if options.quick else 3)
    wanted = {int(i) for i in options.items.split(",") if i}
    if not Path(options.program).exists():
        sys.exit(f"results.py: there is no {options.program}: build it first, or say --program")
    if not Path(options.data).is_dir():
        sys.exit(f"results.py: there is no {options.data}: the data sets are not part of the project")

    start, report = time.monotonic(), Report()
    with tempfile.TemporaryDirectory(prefix="mapjoin_results_") as scratch:
        bench = Bench(options, scratch)
        bench.unpack()
        if not wanted or 3 in wanted:
            bench.start_sequential(options.limit)
        chosen = [k for k in range(1, len(SECTIONS) + 1) if not wanted or k in wanted]
        parts = {}
        for k in sorted(chosen, key=lambda k: k == 3):  # the last one waits for the slow runs
            parts[k] = Report()
            SECTIONS[k - 1](bench, parts[k], options)
        for k in chosen:
            report.append(parts[k])
        text = page(report, bench, options, time.monotonic() - start)
    output = options.output
    if options.update:
        output = output or HERE / "docs" / "results.md"
        text = updated(Path(output).read_text(), report)
    if output is None and not options.quick and not wanted:
        output = HERE / "docs" / "results.md"
    if output is None:
        print(text)
    else:
        Path(output).write_text(text)
    print(f"{len(report.misses)} not met, {time.monotonic() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()

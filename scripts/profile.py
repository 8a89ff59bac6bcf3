#!/usr/bin/env python3
"""Where the time of a run goes: perf on mapjoin_profile, summed up. Standard library only.

    cmake --preset release -DMAPJOIN_BUILD_BENCHMARKS=ON && cmake --build --preset release
    scripts/profile.py GRAPH.g2o manhattan:100000 ...     a table in Markdown, per cent of a join
    scripts/profile.py --before OTHER/build/release ...   two columns each: that build, this one

Needs perf (linux-perf). One thread. docs/profiles.md says what the figures mean.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent

# What a symbol belongs to: the first group that matches.
GROUPS = [
    ("clearing fronts, adding children", r"extend_add|factor_front|clear_|memset|factorize"),
    ("eliminating in fronts", r"(pivot|solve|update)_tile|eliminate_pivots|Elimination|^d(gemm|trsm|potr|syrk)"),
    ("substitution", r"solve_pivots|substitut|FrontalCholesky::(solve|eliminate)|(back|for)ward_block|close_subtree"),
    ("measurements: linearising, chi2",
     r"RelativeKernel|lineari[sz]e|chi2|ObservationSystem<.>::(assemble|batch)|sincos|atan2|rotation_|right_jacobian|quaternion"),
    ("ordering (AMD, METIS)",
     r"^c?amd_|^libmetis|METIS|block_graph|order_blocks|minimum_degree|remove_duplicates|^gk_|VertexCut|Separator"
     r"|[dD]issect|eliminate_chains|ChainElimination|::half|automatic_order|^__?random|^rand"),
    ("analysis",
     r"analy[sz]e|column_counts|elimination_tree|postorder|partition_into|clique_stars|plan_|Planner|Analysis|FrontCost"
     r"|sort_by_front|ObservationList|hold_gauge|weigh_held|inverse_permutation|front_flops|find_slots|cut_tree|TreeCutter"),
    ("laying out and placing", r"[lL]eaf|place_|::place|unite|mapjoin::align|fit|Sharing|make_piece|motion|EliminationWalk"),
    ("new values, coils", r"retract|coil|strained|transform|refine|linear_step"),
    ("memory: pages, allocation, copies",
     r"^\[k\]|alloc|free|_int_|operator (new|delete)|memmove|memcpy|unlink_chunk|consolidate"),
]
NOT_JOINING = r"read_g2o|Scanner|from_chars|KeyNumbering|simulate|sched_yield|__schedule|do_syscall|worker|wait_for_change"


def profile(program, source, seconds):
    """Seconds of a join, and per cent of it by group."""
    with tempfile.TemporaryDirectory() as scratch:
        data = Path(scratch) / "perf.data"
        run = subprocess.run(["perf", "record", "-F", "4000", "-o", data, program, source, str(seconds)],
                             capture_output=True, text=True, check=False)
        report = subprocess.run(["perf", "report", "-i", data, "--no-children", "--sort", "symbol"],
                                capture_output=True, text=True, check=False).stdout
    timed = re.search(r"joins, ([\d.]+) s each", run.stdout)
    if not timed:
        sys.exit(f"profile.py: {program} {source}: {run.stderr.strip()[-300:]}")
    share = {}
    for line in report.splitlines():
        found = re.match(r"\s*([\d.]+)%\s+\[(.)\] (.*?)(\s\s|$)", line)
        if not found:
            continue
        symbol = ("[k] " if found[2] == "k" else "") + found[3]
        if re.search(NOT_JOINING, symbol):
            continue
        group = next((name for name, pattern in GROUPS if re.search(pattern, symbol)), "other")
        share[group] = share.get(group, 0.0) + float(found[1])
    total = sum(share.values())
    return float(timed[1]), {name: 100.0 * value / total for name, value in share.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", help="GRAPH.g2o or WORLD:POSES")
    parser.add_argument("--build", type=Path, default=HERE / "build/release")
    parser.add_argument("--before", type=Path, help="another build, to compare with")
    parser.add_argument("--seconds", type=float, default=4.0)
    options = parser.parse_args()
    builds = ([options.before] if options.before else []) + [options.build]
    columns = []
    for source in options.sources:
        for build in builds:
            columns.append((Path(source).stem, *profile(build / "mapjoin_profile", source, options.seconds)))
    print("| per cent of |", " | ".join(name for name, _, _ in columns), "|")
    print("|---|" + "---:|" * len(columns))
    for group in [name for name, _ in GROUPS] + ["other"]:
        print(f"| {group} |", " | ".join(f"{share.get(group, 0.0):.1f}" for _, _, share in columns), "|")
    print("| **seconds of a join** |", " | ".join(f"{seconds:.3g}" for _, seconds, _ in columns), "|")


if __name__ == "__main__":
    main()

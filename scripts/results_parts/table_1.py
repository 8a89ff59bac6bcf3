"""Table 1 of Linear SLAM, measured."""

import re
import subprocess


def table_1(bench, report, options):
    report.section(17, "What joining costs: Table 1 of Linear SLAM", "Victoria Park: seconds of building "
                   "n local maps and of joining them, linearly and by iterated nonlinear least squares, in "
                   "units of one full nonlinear solve from odometry; beside what the paper predicts, "
                   "(25)-(28) with m = 10. Linear joining is in summary mode, in the order of the maps.")
    program = bench.program.parent / "mapjoin_table_1"
    report.commands("build/release/mapjoin_table_1 $DATA/landmark_graphs/victoria_park.g2o")
    if not program.exists():
        report.say("The benchmarks are not built here.")
        return report.close("not built")
    counts = ["5", "20"] if options.quick else []
    out = subprocess.run([program, bench.source("landmarks", "victoria_park"), *counts],
                         capture_output=True, text=True, check=True, env=bench.environment).stdout
    report.say(out.strip())
    cheaper(report, out)
    report.close()


def cheaper(report, out):
    """Which of the paper's statements hold."""
    cells = [[float(x) for x in line.strip("| \n").split("|")]
             for line in out.split("\n") if re.fullmatch(r"(\| [0-9.]+ )+\|", line)]
    cells = [row for row in cells if len(row) == 11]
    for n, _, _, sequential, _, divided, _, slow, _, halved, _ in cells:
        report.check(divided < halved and sequential < slow, f"n = {n:.0f}: linear cheaper than nonlinear")
        report.check(divided < 1.0, f"n = {n:.0f}: divide and conquer cheaper than a full solve")
    first, last = cells[0], cells[-1]
    growth = lambda column: last[column] / first[column]
    grows = report.check(growth(3) > 2 * growth(5), "sequential joining grows faster than divide and conquer")
    iterations = re.search(r"(\d+) iterations", out)[1]
    report.say(f"As predicted: linear joining is cheaper than nonlinear at every n, by as much as that "
               f"iterates; divide and conquer is cheaper than a full solve; from n = {first[0]:.0f} to "
               f"{last[0]:.0f} sequential joining grows by {growth(3):.1f} (predicted {growth(4):.1f}), much "
               f"faster than divide and conquer: {grows}. Not as predicted: divide and conquer grows by "
               f"{growth(5):.1f} (predicted {growth(6):.2f}), and building does not fall with 1 / n^2. The "
               "predictions count S^3 for S poses and features, a dense solve, of which the last join has "
               "nearly all. Maps are sparse, and a solve costs about as much as S: every level of the tree "
               "then costs the same, building the same for every n. And all figures of joining are smaller "
               f"than predicted, as the full solve takes {iterations} iterations from odometry where the "
               "paper supposes 10.")

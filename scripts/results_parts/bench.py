"""Runs the program and the judges, and keeps what came out as a page."""

import concurrent.futures
import json
import math
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

from .data_sets import MAPS, PAPER_ROWS, REFERENCES

# Where pictures of the page go.
IMAGES = Path(__file__).resolve().parent.parent.parent / "docs" / "images"


class Failed(Exception):
    pass


class TooLong(Exception):
    pass


class Bench:
    """The program, the data, and a place for what they make."""

    def __init__(self, arguments, scratch):
        self.program = Path(arguments.program).resolve()
        self.data = Path(arguments.data).resolve()
        self.tests = self.program.parent / "tests"
        self.chi2_tool = self.data.parent / "tools" / "chi2.py"
        self.scratch = Path(scratch)
        self.environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")

    def unpack(self):
        for name in MAPS:
            subprocess.run(["tar", "-xJf", self.data / "local_maps" / (name + ".tar.xz"), "-C",
                            self.scratch], check=True)

    def source(self, kind, name):
        if kind == "maps":
            return self.scratch / name
        return self.data / ("pose_graphs" if kind == "graph" else "landmark_graphs") / (name + ".g2o")

    def reference(self, kind, name):
        folder = "local_maps/" if kind == "maps" else "pose_graphs/"
        path = self.data / "reference" / (REFERENCES.get(name, folder + name) + ".g2o")
        return path if path.exists() else None

    def call(self, *words, limit=None, stack=None):
        """Runs the program and returns what it printed."""
        def limits():
            if stack:
                resource.setrlimit(resource.RLIMIT_STACK, (stack, stack))
        try:
            done = subprocess.run([str(w) for w in (self.program, *words)], timeout=limit,
                                  capture_output=True, text=True, env=self.environment,
                                  stdin=subprocess.DEVNULL, preexec_fn=limits if stack else None)
        except subprocess.TimeoutExpired as error:
            raise TooLong() from error
        if done.returncode != 0:
            raise Failed((done.stderr or "ended by a signal").strip().removeprefix("mapjoin: "))
        return done.stdout

    def solve(self, command, sources, *options, output="out.g2o", **limits):
        """Solves or joins. Returns the figures of --json and the output's path."""
        stats, out = self.scratch / (output + ".json"), self.scratch / output
        sources = sources if isinstance(sources, list) else [sources]
        self.call(command, *sources, *options, "--output", out, "--json", stats, **limits)
        return json.loads(stats.read_text()), out

    def solve_row(self, kind, name, *options, **limits):
        return self.solve("join" if kind == "maps" else "solve", self.source(kind, name), *options,
                          **limits)

    def start_sequential(self, limit):
        """Starts the slow runs of item 3, one after another beside everything else: they are timed
        only roughly."""
        self.beside = concurrent.futures.ThreadPoolExecutor(1)
        self.sequential = {row: self.beside.submit(
            self.solve_row, *row, "--mode", "paper", "--strategy", "sequential",
            output=f"sequential_{row[0]}_{row[1]}.g2o", limit=limit) for row in PAPER_ROWS}

    def evaluate(self, out, kind, name):
        """What our program says of a result: chi2, and RMSE where there is a reference."""
        words = ["evaluate", out, "--maps" if kind == "maps" else "--graph", self.source(kind, name)]
        reference = self.reference(kind, name)
        return figures(self.call(*words, *(["--reference", reference] if reference else [])))

    def judge(self, out, kind, name):
        """chi2 by the data sets' own tool."""
        text = subprocess.run([sys.executable, self.chi2_tool, self.source(kind, name), out],
                              capture_output=True, text=True, check=True).stdout
        return figures(text)["chi2"]

    def run_tests(self, program, pattern, report=None):
        """Runs tests that are built. Returns (passed, failed, skipped), None where they are not."""
        path = self.tests / program
        if not path.exists():
            return None
        done = subprocess.run([path, "--gtest_filter=" + pattern], capture_output=True, text=True,
                              env=dict(self.environment, MAPJOIN_ALL_RUNS="1"))
        if report is not None:
            report.append(done.stdout)
        def count(word):
            found = re.search(r"^\[ *" + word + r" *\] (\d+) test", done.stdout, re.M)
            return int(found[1]) if found else 0
        return count("PASSED"), count("FAILED"), count("SKIPPED")


def figures(text):
    words = text.split()
    return {words[k]: float(words[k + 1]) for k in range(0, len(words) - 1, 2)}


class Report:
    """The page, and the list of what it shows to hold or not."""

    def __init__(self):
        self.sections, self.verdicts, self.misses = [], [], []

    def section(self, item, title, promise):
        self.item, self.title = item, title
        self.held, self.asked = 0, 0
        self.sections.append(f"\n## {item}. {title}\n\n{promise}\n")
        print(f"{item}. {title}", file=sys.stderr, flush=True)

    def append(self, other):
        self.sections += other.sections
        self.verdicts += other.verdicts
        self.misses += other.misses

    def say(self, text):
        self.sections.append("\n" + text + "\n")

    def commands(self, *lines):
        self.sections.append("\n" + "".join(f"    {line}\n" for line in lines))

    def table(self, head, rows):
        lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
        lines += ["| " + " | ".join(r) + " |" for r in rows]
        self.sections.append("\n" + "\n".join(lines) + "\n")

    def check(self, holds, what):
        """A promise, kept or not. Returns the word for the table."""
        self.asked += 1
        self.held += bool(holds)
        if not holds:
            self.misses.append((self.item, what))
        return "yes" if holds else "**no**"

    def close(self, text=""):
        verdict = f"{self.held} of {self.asked}" if self.asked else text
        self.verdicts.append((self.item, self.title, verdict + (", " + text if text and self.asked else "")))


def number(x, digits=4):
    return "" if x is None else f"{x:.{digits}f}"


def printed(x):
    """A figure with the digits it was published with."""
    return "" if x is None else f"{x:g}"


def near(value, optimum, tolerance=1e-6):
    return abs(value - optimum) <= tolerance * optimum


def four_digits(value, published):
    return abs(value - published) <= 0.5 * 10 ** (math.floor(math.log10(published)) - 3)


def tests_of(bench, report, program, pattern):
    """Judges by tests. Returns what they printed."""
    report.commands(f"MAPJOIN_ALL_RUNS=1 build/release/tests/{program} --gtest_filter='{pattern}'")
    output = []
    counts = bench.run_tests(program, pattern, output)
    if counts is None:
        report.say("The tests are not built here.")
        return ""
    passed, failed, skipped = counts
    report.check(failed == 0 and passed > 0, f"{program} {pattern}")
    report.say(f"{passed} passed, {failed} failed, {skipped} skipped.")
    return "".join(output)

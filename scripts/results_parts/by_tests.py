"""What only tests can show."""

from .bench import tests_of


def bad_inputs(bench, report, options):
    report.section(9, "Bad input", "Every bad input ends in a message that names what is wrong, where, "
                   "and what to do; exit code 2; no output file. One by one, by running the program:")
    tests_of(bench, report, "mapjoin_program_tests", "*Bad*")
    report.close("by tests")


def frames(bench, report, options):
    report.section(10, "Frames", "change_frame against the papers' dense formula and dual numbers "
                   "(1e-9), differences (1e-6), round trips, 2D and 3D, poses and points, random maps:")
    tests_of(bench, report, "mapjoin_tests", "*ChangeFrame*:*CompleteGauge*:*ManyFrames*")
    report.close("by tests")

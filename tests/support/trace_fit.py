"""How much of the package one fit runs: functions, files and depth of calls, in a process that has just begun.

``python tests/support/trace_fit.py`` prints a line for `ul.fit` of the cartilage sample, its problem made before,
and one for the command `underlay fit`, everything from the start of its work on.
"""

import contextlib
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = str(ROOT / "src" / "underlay")
SAMPLE = ROOT / "data_samples" / "cartilage_on_bone"


class Trace:
    """Functions of the package that ran, and the deepest that they stood in one another."""

    def __init__(self):
        self.functions, self.deepest, self._depth = set(), 0, 0

    def __call__(self, frame, event, _argument):
        """As `sys.setprofile` calls it."""
        code = frame.f_code
        # Bodies of modules and classes, comprehensions and generators' expressions are no functions.
        if not code.co_filename.startswith(PACKAGE) or code.co_name.startswith("<") or not code.co_flags & 1:
            return
        if event == "call":
            self.functions.add((code.co_filename, code.co_firstlineno, code.co_name))
            self._depth += 1
            self.deepest = max(self.deepest, self._depth)
        elif event == "return":
            self._depth = max(self._depth - 1, 0)

    def told(self):
        """One line."""
        count = len({name for name, _, _ in self.functions})
        return f"{len(self.functions)} functions in {count} files, {self.deepest} deep"


def one_fit():
    """`ul.fit` alone."""
    import underlay as ul  # noqa: PLC0415  a process that has just begun has loaded nothing

    problem = ul.load_problem(f"{SAMPLE}.csv", f"{SAMPLE}.toml")
    trace = Trace()
    sys.setprofile(trace)
    ul.fit(problem)
    sys.setprofile(None)
    return trace.told()


def one_command():
    """`underlay fit`, with its files and pictures in a folder that goes again."""
    trace = Trace()
    with tempfile.TemporaryDirectory() as folder:
        sys.argv = ["underlay", "fit", f"{SAMPLE}.csv", "--scene", f"{SAMPLE}.toml", "--output", folder]
        sys.setprofile(trace)
        from underlay.cli.app import main  # noqa: PLC0415  its loading is traced too

        with contextlib.suppress(SystemExit):
            main()
        sys.setprofile(None)
    return trace.told()


RUNS = {"ul.fit": one_fit, "underlay fit": one_command}


def main():
    if len(sys.argv) > 1:
        print(RUNS[sys.argv[1]](), file=sys.stderr)
        return
    for name in RUNS:
        done = subprocess.run([sys.executable, __file__, name], capture_output=True, text=True, check=True)
        print(f"{name:<14}{done.stderr.splitlines()[-1]}")


if __name__ == "__main__":
    main()

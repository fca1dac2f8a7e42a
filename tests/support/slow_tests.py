"""Tests that the fast layer leaves out: those whose runs, with what they set up, take longest together.

    python -m pytest -n auto --durations=0 --durations-min=0.02 > durations.txt
    python tests/support/slow_tests.py durations.txt

writes `slow_tests.txt`, which `conftest.py` reads: `python -m pytest -m "not slow"` runs the others.
"""

import re
import sys
from collections import Counter
from pathlib import Path

LIST = Path(__file__).with_name("slow_tests.txt")
# Seconds of all runs of a test function. The others, with all that they set up, take about a minute on one core.
LONG = 0.1
ROW = re.compile(r"\s*([\d.]+)s (?:call|setup|teardown)\s+(\S+?::\w+)")


def main():
    seconds = Counter()
    for line in Path(sys.argv[1]).read_text(encoding="utf-8").splitlines():
        if row := ROW.match(line):
            seconds[row[2]] += float(row[1])
    names = sorted(name for name, total in seconds.items() if total > LONG)
    LIST.write_text("\n".join(names) + "\n", encoding="utf-8")
    others = sum(total for name, total in seconds.items() if total <= LONG)
    print(f"{len(names)} tests in {LIST.name}; the others of the table take {others:.0f} s")


if __name__ == "__main__":
    main()

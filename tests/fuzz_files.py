"""Throw damaged files at every reader: ``python tests/fuzz_files.py --count 100000 --output result.json``.

Each file is a valid one of some kind that the program opens (curves of every format, scenes, manifests, fit
records, posteriors, chains, tables and journals of maps; `support.file_kinds`), cut, spliced, or with bytes,
numbers, values, lines or archive members changed (`support.mutations`). Curves are read by their content and by
the reader they were made for. What must hold:

* only errors of underlay are raised, and each is one line, also where the first curve that is read is judged, its
  contact looked for and a modulus fitted ("read", "judged" and "fitted" say how far it came);
* no reading takes over 5 seconds of one core (a wait of 30 seconds ends the child and is a failure);
* memory never grows by more than 500 MB;
* no file is opened or left but the one that was named and what its own reader keeps beside it.

The work is done in child processes of a few thousand files each, so that a crash in a C library is found and
does not end the run.
"""

import argparse
import contextlib
import faulthandler
import json
import logging
import os
import platform
import random
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "src"), str(HERE)]

# After the path is set: the script runs from a bare checkout too.
import underlay as ul  # noqa: E402
from support import file_kinds  # noqa: E402
from support.mutations import mutate  # noqa: E402

SECONDS = 5.0
MEGABYTES = 500
CHUNK = 5000
NAME = "fuzzed"


class Watch:
    """Notes every file that Python opens while a reading is on, but for its own libraries."""

    LIBRARIES = tuple({sys.prefix, sys.base_prefix, *(entry for entry in sys.path if entry)})

    def __init__(self):
        self.allowed = ""
        self.seen = []
        sys.addaudithook(self.hook)

    def hook(self, event, arguments):
        if event != "open" or not self.allowed or isinstance(arguments[0], int):  # a number: already open
            return
        path = os.fsdecode(arguments[0])
        if not path.startswith((self.allowed, *self.LIBRARIES)):
            self.seen.append(path[:200])


def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def run_chunk(first, count, folder):
    """Read `count` damaged files; the number of each is its seed. Returns what happened, as plain values."""
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as made:
        originals = file_kinds.seeds(made)
    contents = [seed.content for seed in originals]
    for original in originals:  # warm-up: modules and tables load before anything is watched
        path = put(folder, original, original.content)
        with contextlib.suppress(ul.UnderlayError):
            original.read(path)
    watch = Watch()
    tally = Tally(watch)
    for number in range(first, first + count):
        rng = random.Random(number)  # noqa: S311  repeatable, not secret
        original = originals[number % len(originals)]
        path = put(folder, original, mutate(rng, original.content, contents))
        tally.add(number, original, path)
    faulthandler.cancel_dump_traceback_later()
    return tally.result()


def put(folder, original, content):
    for left in Path(folder).glob(f"{NAME}*"):
        left.unlink()
    path = Path(folder) / f"{NAME}{original.ending}"
    path.write_bytes(content)
    return path


class Tally:
    """What happened in one child process."""

    def __init__(self, watch):
        self.watch = watch
        self.outcomes, self.failures, self.slowest = Counter(), [], 0.0
        self.start = memory()
        self.limit = self.start + MEGABYTES

    def add(self, number, original, path):
        """Read one file and note what was wrong with how that went."""
        faulthandler.dump_traceback_later(30, exit=True)
        self.watch.allowed, self.watch.seen = str(path.with_suffix("")), []
        faults = []
        began = time.process_time()
        try:
            came = original.read(path)
            outcome = came if isinstance(came, str) else "read"
        except ul.UnderlayError as error:
            outcome = type(error).__name__
            if len(str(error)) > 2000:
                faults.append(f"a message of {len(str(error))} characters")
        except BaseException as error:  # noqa: BLE001  anything else is what is looked for
            outcome = f"ESCAPED {type(error).__name__}"
            faults.append(repr(error)[:300])
        seconds = time.process_time() - began
        self.watch.allowed = ""
        self.slowest = max(self.slowest, seconds)
        self.outcomes[f"{original.kind}: {outcome}"] += 1
        if seconds > SECONDS:
            faults.append(f"took {seconds:.1f} s")
        if self.watch.seen:
            faults.append(f"opened {self.watch.seen[:3]}")
        if memory() > self.limit:
            faults.append(f"memory {memory():.0f} MB")
            self.limit = memory() + MEGABYTES
        self.failures += [
            {"seed": number, "kind": original.kind, "file": original.name, "error": fault} for fault in faults
        ]

    def result(self):
        """All of it as plain values."""
        return {
            "outcomes": dict(self.outcomes),
            "failures": self.failures,
            "slowest_seconds": self.slowest,
            "memory_growth_mb": memory() - self.start,
        }


def run_child(start, size):
    """Outcome of one child process, with what it left behind or how it ended."""
    with tempfile.TemporaryDirectory() as folder:
        child = subprocess.run(
            [sys.executable, __file__, "--chunk", str(start), str(size), folder],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        left = [file.name for file in Path(folder).iterdir() if not file.name.startswith(NAME)]
    seeds_tried = f"{start}..{start + size - 1}"
    if child.returncode:
        error = f"exit {child.returncode}: {child.stderr[-800:]}"
        return {"outcomes": {}, "failures": [{"seed": seeds_tried, "error": error}]}
    # A library may have printed something before.
    result = json.loads(child.stdout.rpartition("\n")[2])
    if left:
        result["failures"].append({"seed": seeds_tried, "error": f"left files behind: {left}"})
    return result


def run(count, first=0, workers=1):
    """Read `count` damaged files in child processes and add up what happened."""
    outcomes, failures, slowest, growth, done = Counter(), [], 0.0, 0.0, 0
    chunks = [(start, min(CHUNK, first + count - start)) for start in range(first, first + count, CHUNK)]
    with ThreadPoolExecutor(workers) as pool:
        for part in pool.map(lambda chunk: run_child(*chunk), chunks):
            outcomes.update(part["outcomes"])
            failures += part["failures"]
            slowest = max(slowest, part.get("slowest_seconds", 0.0))
            growth = max(growth, part.get("memory_growth_mb", 0.0))
            done += 1
            sys.stderr.write(
                f"{done}/{len(chunks)} parts, {len(failures)} failures, slowest {slowest:.2f} s\n"
            )
    return {
        "command": f"python tests/fuzz_files.py --count {count}" + (f" --first {first}" if first else ""),
        "files": sum(outcomes.values()),
        "limits": {"seconds": SECONDS, "memory_growth_mb": MEGABYTES},
        "slowest_seconds": round(slowest, 3),
        "largest_memory_growth_mb": round(growth, 1),
        "outcomes": dict(sorted(outcomes.items())),
        "failures": failures,
        "python": platform.python_version(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="number of the first file, which is its seed")
    parser.add_argument("--workers", type=int, default=1, help="child processes at a time")
    parser.add_argument("--output", type=Path, help="write the result here as JSON")
    parser.add_argument("--chunk", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.chunk:
        first, count, folder = arguments.chunk
        sys.stdout.write("\n" + json.dumps(run_chunk(int(first), int(count), folder)))
        return 0
    result = run(arguments.count, arguments.first, arguments.workers)
    text = json.dumps(result, indent=2) + "\n"
    if arguments.output:
        arguments.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    return 1 if result["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())

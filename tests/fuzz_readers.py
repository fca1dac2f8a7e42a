"""Throw damaged files at every reader: ``python tests/fuzz_readers.py --count 100000 --output result.json``.

Each file is one of the small files in tests/support, cut, spliced, or with bytes, numbers, lines or archive
members changed, and is read by its content and, every fourth, by the reader it was made for. What must hold:

* only errors of underlay are raised;
* no reading takes over 2 seconds of one core (a wait of 30 seconds ends the child and is a failure);
* memory never grows by more than 500 MB;
* no file is opened but the one that was named.

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
import re
import resource
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "src"), str(HERE)]

# After the path is set: the script runs from a bare checkout too.
from support import afm_files, instrument_files  # noqa: E402
from underlay.data.readers import read_all  # noqa: E402
from underlay.errors import UnderlayError  # noqa: E402

SECONDS = 2.0
MEGABYTES = 500
CHUNK = 5000
FORCED = 4
#: What to put in place of a number.
HOSTILE = (
    b"", b"-", b"nan", b"inf", b"1e400", b"-1e308", b"1.7976931348623157e308", b"0", b"-1", b"2147483648",
    b"999999999999999999999", b"1_000", b"0x10", b"1,5", b"1.5.2", "µ".encode("latin-1"), b"\0", b"1e-400",
)  # fmt: skip
FORMAT_OF = {
    "optics11": "optics11", "mach1": "mach1", "bioindenter": "bioindenter", "hysitron": "hysitron",
    "fischer": "fischer", "nanosuite": "nanosuite", "testxpert": "testxpert", "excel": "excel",
    "afm": "afm", "csv": "csv", "json": "json", "hdf5": "hdf5", "archive": None,
}  # fmt: skip
CALIBRATION = {"spring_constant": "0.04 N/m", "sensitivity": "60 nm/nA"}
_TOKEN = re.compile(rb"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?")


def seeds():
    """Name and bytes of every file the fuzzing starts from, sorted."""
    made = {**instrument_files.ALL, **afm_files.ALL}
    files = {name: make() for name, make in made.items()}
    with tempfile.TemporaryDirectory() as folder:
        from underlay.data.export import write_curves  # noqa: PLC0415  only here

        source = Path(folder) / "seed.csv"
        source.write_bytes(files["csv"])
        curves = read_all(source)
        for ending, name in ((".json", "json"), (".h5", "hdf5"), (".csv", "csv exported")):
            files[name] = write_curves(curves, Path(folder) / f"out{ending}").read_bytes()
    return sorted(files.items())


def mutate(rng, data, others):
    """One damaged copy of `data`."""
    if data[:2] == b"PK" and rng.random() < 0.7:
        with contextlib.suppress(Exception):  # a copy damaged before may no longer be an archive
            return mutate_members(rng, data, others)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        data = rng.choice(MUTATIONS)(rng, data, others)
    return data


def mutate_members(rng, data, others):
    """Damage one member, or the list of members, of an archive that stays one."""
    stream = BytesIO()
    with zipfile.ZipFile(BytesIO(data)) as archive, zipfile.ZipFile(stream, "w") as out:
        names = archive.namelist()
        chosen = rng.choice(names)
        for name in names:
            content = archive.read(name)
            if name == chosen:
                what = rng.random()
                if what < 0.1:
                    continue
                if what < 0.2:
                    name = rng.choice(("../../escape.txt", "/tmp/escape.txt", name * 2, "a" * 300))  # noqa: PLW2901, S108
                else:
                    content = mutate(rng, content, others) if content[:2] != b"PK" else content
            out.writestr(name, content)
    return stream.getvalue()


def flip(rng, data, _):
    if not data:
        return data
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 4, 32))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def cut(rng, data, _):
    return data[: rng.randrange(len(data) + 1)]


def drop(rng, data, _):
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.randrange(1, 200) :]


def repeat(rng, data, _):
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start : start + rng.randrange(1, 400)] * rng.choice((2, 3, 50)) + data[start:]


def splice(rng, data, others):
    other = rng.choice(others)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def number(rng, data, _):
    tokens = [match.span() for match in _TOKEN.finditer(data[:20_000])]
    if not tokens:
        return data
    start, end = rng.choice(tokens)
    return data[:start] + rng.choice(HOSTILE) + data[end:]


def lines(rng, data, _):
    parts = re.split(rb"(?<=\n)", data)
    i, j = rng.randrange(len(parts)), rng.randrange(len(parts))
    parts[i], parts[j] = parts[j], parts[i]
    if rng.random() < 0.3:
        del parts[i]
    return b"".join(parts)


def word(rng, data, _):
    """A large or negative number where a binary header may keep a size."""
    if len(data) < 16:
        return data
    start = rng.randrange(min(len(data) - 8, 4096))
    size = rng.choice((2, 4, 8))
    value = rng.choice(
        (b"\xff" * size, b"\x7f" + b"\xff" * (size - 1), b"\xff" * (size - 1) + b"\x7f", b"\0" * size)
    )
    return data[:start] + value + data[start + size :]


def encode(rng, data, _):
    return rng.choice(
        (
            b"\xef\xbb\xbf" + data,
            b"\xff\xfe" + data,
            data.replace(b"\r\n", b"\r"),
            data.replace(b"\t", b";"),
            data[::-1],
        )
    )


MUTATIONS = (flip, flip, cut, drop, repeat, splice, number, number, number, lines, word, encode)


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
        if path != self.allowed and not path.startswith(self.LIBRARIES):
            self.seen.append(path[:200])


def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def run_chunk(first, count, folder):
    """Read `count` damaged files; the number of each is its seed. Returns what happened, as plain values."""
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    originals = seeds()
    contents = [content for _, content in originals]
    path = Path(folder) / "fuzzed.dat"
    for _, content in originals:  # warm-up: modules and tables load before anything is watched
        path.write_bytes(content)
        with contextlib.suppress(UnderlayError):
            read_all(path)
    watch = Watch()
    start_memory = memory()
    limit = int((start_memory + MEGABYTES) * 2**20)
    outcomes, failures, slowest = Counter(), [], 0.0
    for seed in range(first, first + count):
        rng = random.Random(seed)  # noqa: S311  repeatable, not secret
        name, content = originals[seed % len(originals)]
        data = mutate(rng, content, contents)
        path.write_bytes(data)
        wanted = FORMAT_OF[name.split()[0]]
        keywords = {"calibration": CALIBRATION} if name == "afm ntmdt" else {}
        # By its content; and, for every fourth, by the reader it was made for, past the recognition.
        for forced in {None, wanted if seed % FORCED == 0 else None}:
            faulthandler.dump_traceback_later(30, exit=True)
            watch.allowed, watch.seen = str(path), []
            began = time.process_time()
            try:
                curves = read_all(path, forced, **keywords)
                outcome = f"read: {curves[0].metadata['format']}"
            except UnderlayError as error:
                outcome = type(error).__name__
            except BaseException as error:  # noqa: BLE001  anything else is what is looked for
                outcome = f"ESCAPED {type(error).__name__}"
                failures.append({"seed": seed, "file": name, "format": forced, "error": repr(error)[:300]})
            seconds = time.process_time() - began
            watch.allowed = ""
            slowest = max(slowest, seconds)
            outcomes[outcome] += 1
            if seconds > SECONDS:
                failures.append(
                    {"seed": seed, "file": name, "format": forced, "error": f"took {seconds:.1f} s"}
                )
            if watch.seen:
                failures.append(
                    {"seed": seed, "file": name, "format": forced, "error": f"opened {watch.seen[:3]}"}
                )
            if memory() * 2**20 > limit:
                failures.append(
                    {"seed": seed, "file": name, "format": forced, "error": f"memory {memory():.0f} MB"}
                )
                limit = int((memory() + MEGABYTES) * 2**20)
    faulthandler.cancel_dump_traceback_later()
    return {
        "outcomes": dict(outcomes),
        "failures": failures,
        "slowest_seconds": slowest,
        "memory_growth_mb": memory() - start_memory,
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
        left = [file.name for file in Path(folder).iterdir() if file.name != "fuzzed.dat"]
    seeds_tried = f"{start}..{start + size - 1}"
    if child.returncode:
        error = f"exit {child.returncode}: {child.stderr[-800:]}"
        return {"outcomes": {}, "failures": [{"seed": seeds_tried, "error": error}]}
    result = json.loads(child.stdout)
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
        "command": f"python tests/fuzz_readers.py --count {count}" + (f" --first {first}" if first else ""),
        "files": count,
        "readings": sum(outcomes.values()),
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
        sys.stdout.write(json.dumps(run_chunk(int(first), int(count), folder)))
        return 0
    result = run(arguments.count, arguments.first, arguments.workers)
    text = json.dumps(result, indent=2) + "\n"
    if arguments.output:
        arguments.output.write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    return 1 if result["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())

"""Commands to begin with: `app`, `formats` and `keys`.

`formats` also writes a starter scene file: values that a curve's file states are filled in; all others are
marked as to be given.
"""

from __future__ import annotations

import importlib.util
import os
import textwrap
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from string import Template
from typing import Annotated, Any

import typer

import underlay as ul
from underlay._files import write_atomic
from underlay._text import one_line
from underlay.cli import console
from underlay.cli.console import say, say_table, say_warnings, write_out
from underlay.errors import FileAccessError, InputError, UnderlayError, missing_extra
from underlay.units import format_quantity, human_unit

_SHAPES = {
    "sphere": "sphere",
    "ball": "sphere",
    "cone": "cone",
    "flat": "flat_punch",
    "cylinder": "flat_punch",
}
# What is written of a file that was not read, and how much of a line.
_LINES, _LETTERS = 6, 90


def browser_page(
    folder: Annotated[
        Path, typer.Argument(help="Folder in which the analyses are kept; made if absent.")
    ] = Path("underlay-analyses"),
    port: Annotated[int, typer.Option(help="Port of this machine; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
) -> None:
    """Open the app in your browser: drop curves, enter the test, fit, export.

    Nothing leaves this machine. Every analysis is a folder of plain files that the other commands read.

    Example: `underlay app`
    """
    if importlib.util.find_spec("nicegui") is None:
        raise missing_extra("the page needs NiceGUI", "app")
    if not 0 <= port <= 65_535:
        raise InputError(f"--port must be from 0 to 65535; got {port}")
    from underlay.app.server import serve

    told = "The page is at this address, which opens once; end it with Ctrl-C."
    serve(folder, port, show=browser, tell=lambda address: say(f"{told}\n{address}"))


def formats(
    file: Annotated[
        Path | None, typer.Argument(help="File to read; without one, the formats are listed.")
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option("--scene", "-s", help="Scene file (TOML) whose [curve] section says how to read it."),
    ] = None,
    test: Annotated[int | None, typer.Option(help="Which test of a file that holds several.")] = None,
    output: console.OutputFolder = None,
    new_scene: Annotated[
        Path | None,
        typer.Option("--new-scene", help="Write a starter scene file for FILE; what it knows is filled in."),
    ] = None,
) -> None:
    """List the instrument formats that can be read, or say how FILE is read and where its segments are.

    Files are recognised by their content. With --output the segments are drawn. The list ends with the plug-ins of
    other packages: readers, indenters and solvers.

    Example: `underlay formats`

    Example: `underlay formats curve.csv --output results`

    Example: `underlay formats curve.csv --new-scene new_scene.toml`
    """
    from underlay.report.tables import curves_as_read, format_name, notes_of, reading_table
    from underlay.scene.scene_file import PLACE, read_scene_file

    if file is None:
        if not (scene is None and test is None and output is None and new_scene is None):
            raise InputError("name the file to read, e.g. underlay formats curve.csv")
        _list_formats()
        return
    stated = {} if scene is None else dict(read_scene_file(scene).curve)
    try:
        curves = curves_as_read(file, stated)
    except InputError as error:
        if new_scene is None or isinstance(error, FileAccessError):
            raise
        say(f"{file.name} could not be read as it is: {error}")
        _write_new(new_scene, file, [], str(error))
        say(f"Next: say in its [curve] section what the columns are, and replace every {PLACE}")
        return
    chosen = _chosen(curves, test if test is not None else stated.get("test"), file)
    say_table(reading_table(chosen), f"{file.name}, format {format_name(chosen[0][1])}")
    say_warnings(notes_of(*(curve for _, curve in chosen)))
    if new_scene is not None:
        _write_new(new_scene, file, chosen)
        say(f"Next: replace every {PLACE} in {new_scene}; underlay keys lists what may stand there")
    if output is not None:
        for number, curve in chosen:
            stem = f"{file.stem}-{number}" if len(curves) > 1 else file.stem
            say(f"wrote {ul.plots.save(ul.plots.segments(curve), output / f'{stem}.segments.png')}")


def _write_new(target: Path, file: Path, chosen: list[tuple[int, ul.Curve]], reason: str = "") -> None:
    """Write a starter scene file for a curve file; without a curve, `reason` says why it could not be read."""
    if target.exists():
        raise InputError(f"{target} exists and may hold your work; name another file")
    name = Path(os.path.relpath(file.resolve(), target.resolve().parent)).as_posix()
    if len(chosen) > 1:
        say(f"{file.name} holds {len(chosen)} tests: the scene is of the first; --test says another")
    text = starter_scene(chosen[0][1], name) if chosen else unread_scene(file, name, reason)
    say(f"wrote {write_atomic(target, text)}")


def _list_formats() -> None:
    import pandas as pd

    from underlay.data.readers import all_formats

    rows = [
        {"format": entry.name, "needs": f".[{entry.extra}]" if entry.extra else "", "what": entry.description}
        for entry in all_formats()
    ]
    say_table(pd.DataFrame(rows), "Formats")
    say("What needs .[afm] or the like: pip install '.[afm]' in the folder of underlay")
    added = _plug_ins()
    if added:
        say_table(pd.DataFrame(added), "Plug-ins of other packages")


def _plug_ins() -> list[dict[str, str]]:
    """Return a row for every reader, indenter and solver of another package: name, package, and why if unusable."""
    from underlay.data.readers import FORMATS, plugged_readers
    from underlay.mechanics.indenters import plugged_indenters
    from underlay.mechanics.solvers import plugged_solvers

    return [
        {
            "adds": entry.group.removeprefix("underlay.").removesuffix("s"),
            "name": entry.name,
            "package": entry.package,
            "state": f"not usable: {entry.fault}" if entry.fault else "usable",
        }
        for entry in (*plugged_readers(FORMATS), *plugged_indenters(), *plugged_solvers())
    ]


def _chosen(curves: list[ul.Curve], test: int | None, file: Path) -> list[tuple[int, ul.Curve]]:
    """Return the test with that number (from 1), or all tests of the file, each with its number."""
    if test is None:
        return list(enumerate(curves, start=1))
    if not 1 <= test <= len(curves):
        raise InputError(f"{file.name} has no test {test}; it holds {len(curves)}, counted from 1")
    return [(test, curves[test - 1])]


def keys(
    section: Annotated[
        str | None, typer.Argument(help="One section, e.g. layer; without it, all of them.")
    ] = None,
    output: console.OutputFolder = None,
) -> None:
    """List every key of a scene file: what it takes, its default, what it means.

    A starter for your own file: `underlay formats curve.csv --new-scene scene.toml`.

    Example: `underlay keys`

    Example: `underlay keys layer`

    Example: `underlay keys substrate.layers`
    """
    import pandas as pd

    from underlay.scene.scene_keys import TOP, scene_keys

    table = pd.DataFrame(scene_keys()).drop(columns=["kind", "words"])
    sections = list(dict.fromkeys(table["section"]))
    if section is not None and section not in sections[1:]:
        raise InputError(f"a scene file has no section {section!r}; it has {', '.join(sections[1:])}")
    for name in sections if section is None else [section]:
        # One table for every layer: its header is doubled in TOML.
        title = {"substrate.layers": f"[[{name}]]", TOP: "Before any section"}.get(name, f"[{name}]")
        say_table(table[table["section"] == name].drop(columns="section"), title)
    say(
        "PARAMETER is any number of the scene: layer.E, layer.thickness, instrument.contact_depth, noise.force"
    )
    write_out(output, {"scene_keys.csv": table})


def unread_scene(file: Path, name: str, reason: str) -> str:
    """Return the text of a starter scene file for a curve file that could not be read, with its first lines.

    Parameters
    ----------
    file : path
        The curve file.
    name : str
        Its path as the scene file names it.
    reason : str
        Why it could not be read.
    """
    from underlay.scene.scene_file import PLACE

    seen = list(_seen(file))
    told = ["The file could not be read as it is:"]
    told += [f"  {line}" for line in textwrap.wrap(one_line(reason), _LETTERS)]
    told += ["Its first lines:", *(f"  {line}" for line in seen)] if seen else ["It is no text."]
    columns = (
        "# By name or by number from 1, with the unit that the instrument's manual says; or a sum.\n"
        f'columns = {{ depth = "{PLACE} (um)", force = "{PLACE} (mN)" }}\n'
    )
    return _filled(
        {},
        ("mm", "kPa"),
        (f"{PLACE} um", f"{PLACE} um"),
        unread="".join(f"# {line}\n" for line in told),
        file=_quoted(name),
        reading=columns if seen else "",
    )


def _seen(file: Path) -> Iterator[str]:
    """Yield the first lines of a text file, each made printable; nothing for a binary file."""
    from underlay.data.readers._source import load, unpack
    from underlay.data.readers._text import lines_of

    try:
        parts, _ = unpack(load(file))
        lines = lines_of(parts[0])
    except (UnderlayError, IndexError):
        return
    yield from (one_line(line.rstrip(), _LETTERS) for line in lines[:_LINES])


def starter_scene(curve: ul.Curve, name: str) -> str:
    """Return the text of a starter scene file for a curve; `name` is the path of its file, as the scene names it.

    Every value that the curve's file states is filled in; all others are ``TODO``, which a scene file refuses until
    it is replaced.
    """
    import numpy as np

    known, test = curve.metadata, curve.metadata.get("test")
    extent = max(float(np.ptp(curve.depth)), np.finfo(float).tiny)
    units = (
        # The largest unit that goes at least once into the depth: `human_unit` takes a tenth of one too.
        human_unit(0.1 * extent, "length")[0],
        human_unit(float(np.ptp(curve.force)) / extent**2, "pressure")[0],
    )
    ends = [format_quantity(float(end) + 0.0, "length") for end in (curve.depth.min(), curve.depth.max())]
    reading = "" if test in (None, 1) else f"test = {int(test)}\n"
    return _filled(known, units, (ends[0], ends[1]), file=_quoted(name), reading=reading)


def _filled(known: Mapping[str, Any], units: tuple[str, str], ends: tuple[str, str], **more: str) -> str:
    """Return the template of a scene file, filled.

    Parameters
    ----------
    known : mapping
        The metadata of the curve.
    units : (str, str)
        Units of length and pressure that suit the size of the test.
    ends : (str, str)
        Bounds of the contact point, with their units.
    **more : str
        ``file``, ``reading`` (further lines of its section) and ``unread`` (comment lines).
    """
    from underlay.scene.scene_file import PLACE

    nu, spring = _number(known, "poisson_ratio"), _number(known, "spring_constant")
    told = (
        ""
        if spring is None
        else (
            f"# The file says a spring constant of {format_quantity(spring, 'stiffness')}; the depth that is\n"
            "# read is clear of its bending. If it were not: [instrument] compliance, its inverse.\n\n"
        )
    )
    text = resources.files("underlay.cli").joinpath("templates", "scene.toml").read_text(encoding="utf-8")
    values = {
        "place": PLACE,
        "length": units[0],
        "pressure": units[1],
        "low": ends[0],
        "high": ends[1],
        "indenter": "\n".join(_indenter(known, units[0])),
        "nu": f'"{PLACE}"             # 0.5 if incompressible'
        if nu is None
        else f"{nu:.6g}   # as the file says",
        "spring": told,
        "unread": "",
    }
    return Template(text).substitute(values | more)


def _indenter(known: Mapping[str, Any], length: str) -> Iterator[str]:
    from underlay.scene.scene_file import PLACE

    said = str(known.get("indenter", "")).casefold()
    shape = next((shape for word, shape in _SHAPES.items() if word in said), None)
    radius = _number(known, "indenter_radius")
    if shape is None and radius is None:
        yield f'shape = "{PLACE}"          # sphere, paraboloid, cone, flat_punch, ...'
        yield f'radius = "{PLACE} {length}"      # half_angle = "35 deg" for a cone'
        return
    yield f'shape = "{shape or "sphere"}"'
    if shape == "cone":
        yield f'half_angle = "{PLACE} deg"'
    elif radius is None:
        yield f'radius = "{PLACE} {length}"'
    else:
        yield f'radius = "{format_quantity(radius, "length")}"   # as the file says'


def _number(known: Mapping[str, Any], key: str) -> float | None:
    import numpy as np

    value = known.get(key)
    usable = isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    return float(value) if usable and value is not None and value > 0.0 else None


def _quoted(text: str) -> str:
    """Return `text` as a quoted and escaped TOML string."""
    escaped = "".join(
        f"\\u{ord(letter):04x}" if not letter.isprintable() or letter in '"\\' else letter for letter in text
    )
    return f'"{escaped}"'

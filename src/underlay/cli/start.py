"""Commands to begin with: `app`, `formats` and `keys`."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Annotated

import typer

import underlay as ul
from underlay._files import write_atomic
from underlay.cli.console import say, say_table, say_warnings, write_out
from underlay.cli.new_scene import new_scene as starter
from underlay.cli.new_scene import unread_scene
from underlay.cli.options import OutputFolder
from underlay.errors import FileAccessError, InputError, missing_extra

__all__ = ["browser_page", "formats", "keys"]

# What a scene file may say of how a file is read; which test of it is one more.
_READING = ("format", "columns", "calibration")


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

    serve(folder, port, show=browser, tell=_tell)


def _tell(address: str) -> None:
    say("The page is at this address, which opens once; end it with Ctrl-C.")
    say(address)


def formats(
    file: Annotated[
        Path | None, typer.Argument(help="File to read; without one, the formats are listed.")
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option("--scene", "-s", help="Scene file (TOML) whose [curve] section says how to read it."),
    ] = None,
    test: Annotated[int | None, typer.Option(help="Which test of a file that holds several.")] = None,
    output: OutputFolder = None,
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
    from underlay.data.signs import flipped
    from underlay.report.tables import format_name, reading_table
    from underlay.scene.scene_file import PLACE, read_scene_file

    if file is None:
        if not (scene is None and test is None and output is None and new_scene is None):
            raise InputError("name the file to read, e.g. underlay formats curve.csv")
        _list_formats()
        return
    stated = {} if scene is None else dict(read_scene_file(scene).curve)
    try:
        read = ul.read_all(file, **{key: stated[key] for key in _READING if key in stated})
    except InputError as error:
        if new_scene is None or isinstance(error, FileAccessError):
            raise
        say(f"{file.name} could not be read as it is: {error}")
        say(f"wrote {_write_unread(new_scene, file, str(error))}")
        say(f"Next: say in its [curve] section what the columns are, and replace every {PLACE}")
        return
    # The signs are shown as they are: only what the scene turns is turned.
    curves = [flipped(curve, stated.get("flip") or ()) for curve in read]
    chosen = _chosen(curves, test if test is not None else stated.get("test"), file)
    say_table(reading_table(chosen), f"{file.name}, format {format_name(chosen[0][1])}")
    say_warnings(
        list(dict.fromkeys(str(note) for _, curve in chosen for note in curve.metadata.get("notes", ())))
    )
    if new_scene is not None:
        say(f"wrote {_write_new(new_scene, file, chosen)}")
        say(f"Next: replace every {PLACE} in {new_scene}; underlay keys lists what may stand there")
    if output is not None:
        for number, curve in chosen:
            stem = f"{file.stem}-{number}" if len(curves) > 1 else file.stem
            say(f"wrote {ul.plots.save(ul.plots.segments(curve), output / f'{stem}.segments.png')}")


def _write_new(target: Path, file: Path, chosen: list[tuple[int, ul.Curve]]) -> Path:
    if len(chosen) > 1:
        say(f"{file.name} holds {len(chosen)} tests: the scene is of the first; --test says another")
    return write_atomic(_new(target), starter(chosen[0][1], _name_from(target, file)))


def _write_unread(target: Path, file: Path, reason: str) -> Path:
    return write_atomic(_new(target), unread_scene(file, _name_from(target, file), reason))


def _new(target: Path) -> Path:
    if target.exists():
        raise InputError(f"{target} exists and may hold your work; name another file")
    return target


def _name_from(target: Path, file: Path) -> str:
    return Path(os.path.relpath(file.resolve(), target.resolve().parent)).as_posix()


def _list_formats() -> None:
    import pandas as pd

    from underlay.data.readers import all_formats

    rows = [
        {
            "format": entry.name,
            "needs": f".[{entry.extra}]" if entry.extra else "",
            "what": entry.description,
        }
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
    output: OutputFolder = None,
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

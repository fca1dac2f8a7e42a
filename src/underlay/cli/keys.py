"""`underlay keys`: every key that a scene file may hold."""

from __future__ import annotations

from typing import Annotated

import typer

from underlay._files import require_writable_folder, write_atomic
from underlay.cli.console import say, say_table
from underlay.cli.options import OutputFolder
from underlay.errors import InputError

__all__ = ["keys"]


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
    if output is not None:
        folder = require_writable_folder(output)
        say(f"wrote {write_atomic(folder / 'scene_keys.csv', table.to_csv(index=False))}")

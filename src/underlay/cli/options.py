"""Arguments that several commands share, spelled once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "CurveFile",
    "CurveOption",
    "ExcelFile",
    "MaxDepth",
    "OutputFolder",
    "Rtol",
    "SceneOption",
    "ScenePath",
    "Seed",
    "SolverName",
]

CurveFile = Annotated[Path, typer.Argument(help="Measured curve, in any format of `underlay formats`.")]
CurveOption = Annotated[
    Path | None,
    typer.Option(
        "--curve", help="Measured curve that says depth and noise; else the one that [curve] file names."
    ),
]
SceneOption = Annotated[Path, typer.Option("--scene", "-s", help="Scene file (TOML): what was tested.")]
ScenePath = Annotated[Path, typer.Argument(help="Scene file (TOML).")]
OutputFolder = Annotated[
    Path | None,
    typer.Option("--output", "-o", help="Folder for tables, JSON and pictures; made if absent."),
]
ExcelFile = Annotated[
    Path | None,
    typer.Option("--excel", help="Excel file to write (.xlsx): results, settings, curves, each a sheet."),
]
Seed = Annotated[int, typer.Option(help="Seed of the random numbers; the same seed makes the same file.")]
MaxDepth = Annotated[
    str | None,
    typer.Option(
        "--max-depth",
        help='Deepest point since contact, e.g. "100 um"; else that of the curve or [simulate].',
    ),
]
SolverName = Annotated[
    str | None,
    typer.Option(
        "--solver",
        help="Contact law: auto, exact, asymptotic, halfspace or a published correction; else that of [solver].",
    ),
]
Rtol = Annotated[
    float | None,
    typer.Option("--rtol", help="Relative error allowed; else that of [solver], else 1e-6."),
]

"""Where a result came from: versions, and hashes of what went in."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import Any

from underlay._version import VERSION
from underlay.data.curve import Curve
from underlay.data.recorded import recorded

__all__ = ["curve_hash", "provenance", "version_record"]


def curve_hash(curve: Curve) -> str:
    """SHA-256 of the depths and forces as they were used."""
    digest = hashlib.sha256(curve.depth.tobytes())
    digest.update(curve.force.tobytes())
    return digest.hexdigest()


def provenance(curves: Sequence[Curve]) -> dict[str, Any]:
    """Versions of what computed, and of every curve its name, file and hashes."""
    return {
        "versions": {"underlay": VERSION} | version_record(("numpy", "scipy", "lmfit")),
        "curves": [
            {
                "name": curve.metadata.get("name"),
                "path": curve.metadata.get("path"),
                "scene_path": curve.metadata.get("scene_path"),
                "recorded": recorded(curve),
                "file_sha256": curve.metadata.get("sha256"),
                "data_sha256": curve_hash(curve),
                "points": len(curve),
            }
            for curve in curves
        ],
    }


def version_record(names: Iterable[str]) -> dict[str, str]:
    """Versions of installed packages, by name."""
    return {name: _version(name) for name in names}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "from source"

"""Sample data that an analysis may begin with."""

from __future__ import annotations

from collections.abc import Mapping

from underlay._door import FileKind, read_bytes, read_text
from underlay.app.folder import AnalysisFolder
from underlay.app.form import Draft
from underlay.app.labels import take_manifest
from underlay.data.samples import sample, samples

__all__ = ["SAMPLES", "with_sample"]

_KIND = FileKind("a sample", 5_000_000, "install underlay again")

#: Samples by their scenes: what they are called, what is special, and folder and ending of their curves.
SAMPLES: Mapping[str, tuple[str, str, tuple[str, str]]] = {
    "gel_on_glass.toml": ("Gel on glass", "AFM, thickness known", ("", "gel_on_glass.csv")),
    "cartilage_on_bone.toml": ("Cartilage on bone", "thickness fitted too", ("", "cartilage_on_bone.csv")),
    "chiaro_cell.toml": ("Cell", "measured, half-space", ("", "chiaro_cell_indentation.csv")),
    "joint/scene.toml": ("Joint, six sites", "a map, two animals", ("joint/curves", ".csv")),
}


def with_sample(folder: AnalysisFolder, scene: str) -> None:
    """Put the curves and the test of a sample into an analysis."""
    paths = samples(*SAMPLES[scene][2])
    brought = [folder.add_curve(path.name, read_bytes(path, _KIND)).name for path in paths]
    draft = Draft.of(read_text(sample(scene), _KIND))
    draft.table("curve")["file"] = f"curves/{brought[0]}"
    folder.write_scene(draft.text())
    # The sample of a map says whose each curve is.
    manifest = sample(scene).with_name("manifest.csv")
    if manifest.exists():
        take_manifest(folder, read_bytes(manifest, _KIND))

"""What tests of the page's tasks share: an analysis of one sample curve."""

from support.reports import SAMPLES
from underlay.app.folder import AnalysisFolder
from underlay.app.form import preset
from underlay.app.tasks import Analyst


def silent(_value):
    """Hear what a task tells, and do nothing."""


def looked_at(tmp_path, sample, name=None, **curve):
    """The tasks on an analysis of one sample curve, by default of the sample's name, and its folder."""
    folder = AnalysisFolder(tmp_path / "one")
    file = f"{name or sample}.csv"
    folder.add_curve(file, (SAMPLES / file).read_bytes())
    draft = preset(sample)
    draft.table("curve").update(file=f"curves/{file}", **curve)
    folder.write_scene(draft.text())
    return Analyst(str(folder.path)), folder

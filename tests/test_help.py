"""What `--help` promises: each command has examples, and each works as written; the shell completes words."""

import re
import shlex
import shutil

import pytest
import typer

from support.films import write_films
from support.populations import write_study
from support.python import python
from support.reports import SAMPLES, write_result
from support.timing import timed_once
from underlay.cli.app import app
from underlay.report import notebook

COMMANDS = typer.main.get_command(app).commands
EXAMPLE = re.compile(r"`(underlay [^`]+)`")


def examples():
    for name, command in COMMANDS.items():
        for text in EXAMPLE.findall(command.help or ""):
            if text.split()[1] == name:
                yield pytest.param(text, id=text)


@pytest.fixture
def folder(tmp_path):
    """Return a folder with files of the names the examples use."""
    curve, scene = tmp_path / "curve.csv", tmp_path / "scene.toml"
    shutil.copy(SAMPLES / "cartilage_on_bone.csv", curve)
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    # Sampling needs proper priors, planning and simulating a noise and depths.
    text = text.replace("instrument.baseline = {}", 'instrument.baseline = { min = "-10 mN", max = "10 mN" }')
    text += '\n[noise]\nforce = "0.6 mN"\n\n[simulate]\nmax_depth = "0.3 mm"\npoints = 60\n'
    scene.write_text(text, encoding="utf-8")
    (tmp_path / "curves").mkdir()
    for number in (1, 2):
        shutil.copy(curve, tmp_path / "curves" / f"site{number}.csv")
    (tmp_path / "manifest.csv").write_text(
        "file,x (mm),y (mm)\nsite1.csv,0,0\nsite2.csv,1,0\n", encoding="utf-8"
    )
    write_study(tmp_path / "map.csv", group="treatment")
    write_result(tmp_path / "curve.fit.json")
    write_films(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", list(COMMANDS))
def test_every_command_has_an_example(name):
    assert f"underlay {name}" in (COMMANDS[name].help or "")


@pytest.mark.parametrize("example", list(examples()))
def test_example_works_as_written(done, example, folder, monkeypatch):
    monkeypatch.chdir(folder)
    if example.split()[1] == "app":
        # It would serve until Ctrl-C; tests/test_app_browser.py lets it.
        monkeypatch.setattr("underlay.app.server.serve", lambda *_, **__: None)
    if example.split()[1] == "report":
        # Cells of the same notebooks are run by tests/test_cli_report.py.
        monkeypatch.setattr(notebook, "execute", lambda made, _: made)
    timed_once(monkeypatch)
    done(*shlex.split(example)[1:])
    for output in re.findall(r"--(?:output|notebook) (\S+)", example):
        assert (folder / output).exists(), output


def test_shell_completes_commands(folder):
    code = "import sys; sys.argv = ['underlay']; from underlay.cli import main; main()"
    asked = {"_UNDERLAY_COMPLETE": "complete_bash", "COMP_WORDS": "underlay re", "COMP_CWORD": "1"}
    done = python("-c", code, cwd=folder, env=asked)
    assert done.stdout.split() == ["report"], done

"""Every command line that the README and the reference print, run word for word beside the files they speak of."""

import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

import underlay as ul
from support.populations import write_study
from support.reports import write_result
from support.timing import timed_once
from test_help import examples
from underlay.cli.app import main
from underlay.data.export import curve_csv

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / ".reference" / "pages").glob("*.md"))]
README = PAGES[0].read_text(encoding="utf-8")
#: All that is printed for a user to type.
PRINTED = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
SAMPLES = ROOT / "data_samples"
#: What is not run here, and why: a cluster of machines, the user's own shell, and a command that needs words.
EXCEPTED = ("--scheduler", "--install-completion", "CURVE", "RESULT", "--program", "app")
#: The scene files of the doors, by the name in their first line.
DOORS = {
    block.split()[1]: block
    for block in re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    if block.startswith("# ")
}


def commands():
    """Every `underlay ...` of a shell block, and every one in the text that names a file."""
    blocks = re.findall(r"```sh\n(.*?)```", PRINTED, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    prose = re.sub(r"```.*?```", "", PRINTED, flags=re.DOTALL)
    lines += [" ".join(code.split()) for code in re.findall(r"`(underlay\s[^`]+)`", prose)]
    lines = [line.removeprefix(".venv/bin/") for line in lines]
    # `underlay --help` promises some of them too: those are run by its test.
    promised = {example.values[0] for example in examples()}
    for line in dict.fromkeys(lines):
        words = shlex.split(line, comments=True)
        if words[:1] == ["underlay"] and shlex.join(words) not in {
            shlex.join(shlex.split(p)) for p in promised
        }:
            yield pytest.param(words, id=" ".join(words[1:4]))


def readme_scene():
    return next(
        block for block in re.findall(r"```toml\n(.*?)```", PRINTED, re.DOTALL) if "[indenter]" in block
    )


def run(words, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", list(map(str, words)))
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = stop.code or 0
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with the scene that the README prints, a curve of it, and its map."""
    (tmp_path / "scene.toml").write_text(readme_scene(), encoding="utf-8")
    scene = ul.load_scene(tmp_path / "scene.toml")
    made = SAMPLES / "cartilage_on_bone.csv"
    depth = ul.read(made).depth[::8] * 0.3
    curve = ul.synthesize(scene.with_values({"layer.E": 1.3e6}), depth, ul.Noise(force=2e-5), 1)
    text = curve_csv(curve, [])
    (tmp_path / "curve.csv").write_text(text, encoding="utf-8")
    (tmp_path / "curves").mkdir()
    (tmp_path / "curves" / "site-0001.csv").write_text(text, encoding="utf-8")
    manifest = re.search(r"```text\n(file,.*?)```", PRINTED, re.DOTALL).group(1)
    (tmp_path / "manifest.csv").write_text(manifest, encoding="utf-8")
    (tmp_path / "results").mkdir()
    write_study(tmp_path / "results" / "map.csv", group="group")
    write_result(tmp_path / "results" / "curve.fit.json")
    for name, text in DOORS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "data_samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("words", list(commands()))
def test_readme_command_works_as_printed(words, folder, monkeypatch, capsys):
    if any(word.startswith(EXCEPTED) for word in words):
        pytest.skip("needs other machines, a browser, the user's shell or the reader's words")
    timed_once(monkeypatch)
    code, _, err = run(words, monkeypatch, capsys)
    assert code == 0, err
    for flag in ("--output", "--new-scene", "--new-notebook"):
        if flag in words:
            assert (folder / words[words.index(flag) + 1]).exists()


def test_the_readme_prints_the_commands_that_matter():
    printed = set(re.findall(r"underlay (\w+)", README))
    assert printed >= {"fit", "simulate", "identify", "plan", "sample", "map", "accuracy", "effects", "cite"}


def doors():
    """Scene file, commands and the number that is promised of every door."""
    for section in README.split("## Four doors")[1].split("\n## ")[0].split("\n### ")[1:]:
        scene, commands = (
            re.search(rf"```{kind}\n(.*?)```", section, re.DOTALL)[1] for kind in ("toml", "sh")
        )
        value, unit = re.search(r"Layer modulus \*\*([\d.]+) (\w+)\*\*", section).groups()
        yield pytest.param(scene, commands.splitlines(), float(value), unit, id=section.splitlines()[0])


@pytest.mark.parametrize(("scene", "lines", "value", "unit"), list(doors()))
def test_each_door_leads_from_its_file_to_its_number(
    scene, lines, value, unit, tmp_path, monkeypatch, capsys
):
    assert len(scene.splitlines()) + len(lines) <= 10
    (tmp_path / scene.split()[1]).write_text(scene, encoding="utf-8")
    (tmp_path / "data_samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    for line in lines:
        code, out, err = run(shlex.split(line), monkeypatch, capsys)
        assert code == 0, err
    told = re.search(r"Layer modulus ([\d.]+) (\w+)", out)
    assert told[2] == unit
    assert float(told[1]) == pytest.approx(value, rel=0.01)


def test_there_are_four_doors_in_few_lines():
    assert len(list(doors())) == len(DOORS) == 4
    assert README.count("\n") < 250


@pytest.mark.parametrize(
    "sample", ["cartilage_on_bone", "chiaro_cell", "gel_on_glass", "soft_film_on_softer_base"]
)
def test_commands_answer_for_every_sample_scene(sample, tmp_path, monkeypatch, capsys):
    scene = tmp_path / "scene.toml"
    shutil.copy(SAMPLES / f"{sample}.toml", scene)
    code, out, err = run(["underlay", "effects", scene], monkeypatch, capsys)
    assert code == 0, err
    assert "by default" in out
    code, out, err = run(
        ["underlay", "plan", scene, "--radii", "5 um:50 um:2", "--depths", "1 um:2 um:2"], monkeypatch, capsys
    )
    assert code == 0, err
    assert "1% of the force" in out
    code, out, err = run(["underlay", "identify", scene], monkeypatch, capsys)
    assert code == 0, err


def test_depth_and_noise_come_from_the_curve_that_the_scene_names(tmp_path, monkeypatch, capsys):
    scene = tmp_path / "scene.toml"
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    scene.write_text(text + '\n[curve]\nfile = "curve.csv"\n', encoding="utf-8")
    shutil.copy(SAMPLES / "cartilage_on_bone.csv", tmp_path / "curve.csv")
    grid = ["--radii", "0.5 mm:2 mm:2", "--depths", "0.1 mm:0.2 mm:2"]
    code, named, err = run(["underlay", "effects", scene], monkeypatch, capsys)
    assert code == 0, err
    # Readings go to 0.3 mm and contact was at 14 um.
    assert "at 0.28" in named
    assert "by default" not in named
    shutil.copy(SAMPLES / "cartilage_on_bone.toml", scene)
    code, given, err = run(
        ["underlay", "effects", scene, "--curve", tmp_path / "curve.csv"], monkeypatch, capsys
    )
    assert code == 0, err
    sizes = [
        line.split()[2] for line in (named, given) for line in line.splitlines() if "finite thickness" in line
    ]
    assert sizes[0] == sizes[1]
    code, out, err = run(
        ["underlay", "plan", scene, "--curve", tmp_path / "curve.csv", *grid], monkeypatch, capsys
    )
    assert code == 0, err
    # The sample was made with 0.6 mN of white noise.
    assert 0.5 < float(re.search(r"noise ([\d.]+) mN, as the curve scatters", out).group(1)) < 0.7


def test_a_named_curve_that_is_not_there_is_said(tmp_path, monkeypatch, capsys):
    scene = tmp_path / "scene.toml"
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    scene.write_text(text + '\n[curve]\nfile = "gone.csv"\n', encoding="utf-8")
    code, _, err = run(["underlay", "effects", scene], monkeypatch, capsys)
    assert code == 2
    assert "gone.csv" in err
    assert err.count("\n") == 1

"""Every command line that the README and the reference print, run word for word beside the files they speak of."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

import underlay as ul
from support.populations import write_study
from support.reports import write_result
from support.timing import timed_once
from test_help import examples
from underlay.data.export import curve_csv

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / ".reference" / "pages").glob("*.md"))]
README = PAGES[0].read_text(encoding="utf-8")
#: All that is printed for a user to type.
PRINTED = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
SAMPLES = ROOT / "data_samples"
#: What is not run here, and why: a cluster of machines, the user's own shell, and a command that needs words.
EXCEPTED = ("--scheduler", "--install-completion", "CURVE", "RESULT", "--program", "app")


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
    write_result(tmp_path / "results" / "gel_on_glass.fit.json")
    (tmp_path / "data_samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("words", list(commands()))
def test_readme_command_works_as_printed(done, words, folder, monkeypatch):
    if any(word.startswith(EXCEPTED) for word in words):
        pytest.skip("needs other machines, a browser, the user's shell or the reader's words")
    timed_once(monkeypatch)
    done(*words[1:])
    for flag in ("--output", "--new-scene", "--new-notebook"):
        if flag in words:
            assert (folder / words[words.index(flag) + 1]).exists()


def test_the_readme_prints_the_commands_that_matter():
    printed = set(re.findall(r"underlay (\w+)", README))
    assert printed >= {"fit", "simulate", "identify", "plan", "sample", "map", "accuracy", "effects", "cite"}


def fresh_lines():
    """Every line that the README prints for a shell, in order, but for the test suite's own."""
    section = README.split("## Which one is yours?")[1].split("\n## ")[0]
    of_table = re.findall(r"^\|.*\| `(underlay [^`]+)` \|$", section, re.MULTILINE)
    assert len(of_table) == 7
    blocks = re.findall(r"(?<!<!-- command: tests -->\n)```sh\n(.*?)```", README, re.DOTALL)
    first, *others = [block.strip() for block in blocks]
    return [*first.splitlines(), *of_table, *others]


@pytest.mark.study
def test_every_line_of_the_readme_runs_in_a_fresh_shell(tmp_path):
    clone = tmp_path / "underlay"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    kept = {"PATH", "HOME", "LANG", "OMP_NUM_THREADS", "TMPDIR", "https_proxy", "http_proxy"}
    clean = {
        name: value for name, value in os.environ.items() if name in kept or name.startswith(("PIP_", "SSL_"))
    }
    done = subprocess.run(
        ["bash", "-e"],
        input="\n".join(fresh_lines()),
        cwd=clone,
        env=clean | {"MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert printed("gel_on_glass") in done.stdout
    assert (clone / "results" / "map.population.csv").exists()
    assert (clone / "build" / "reference" / "index.html").exists()


def printed(name):
    return re.search(rf"<!-- printed: {name} -->\n```text\n(.*?)```", README, re.DOTALL)[1]


def test_the_readme_shows_what_its_command_prints(done, tmp_path, monkeypatch):
    (tmp_path / "data_samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    line = next(line for line in fresh_lines() if line.startswith("underlay fit data_samples/gel_on_glass"))
    out = done(*shlex.split(line)[1:])
    assert out.strip("\n") == printed("gel_on_glass").strip("\n")
    assert len(out.strip("\n").splitlines()) <= 12


def test_the_shares_that_hertz_is_off_by_are_those_that_are_printed(done, tmp_path, monkeypatch):
    (tmp_path / "data_samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    said = re.search(r"the gel on glass below by (\d+) %, the cartilage on bone by (\d+) %", README)
    for name, share in zip(("gel_on_glass", "cartilage_on_bone"), said.groups(), strict=True):
        scene = f"data_samples/{name}.toml"
        assert f"(+{share} %)" in done("fit", f"data_samples/{name}.csv", "--scene", scene)


@pytest.mark.parametrize(
    "sample", ["cartilage_on_bone", "chiaro_cell", "gel_on_glass", "soft_film_on_softer_base"]
)
def test_commands_answer_for_every_sample_scene(done, sample, tmp_path):
    scene = tmp_path / "scene.toml"
    shutil.copy(SAMPLES / f"{sample}.toml", scene)
    assert "by default" in done("effects", scene)
    assert "1% of the force" in done("plan", scene, "--radii", "5 um:50 um:2", "--depths", "1 um:2 um:2")
    done("identify", scene)


def test_depth_and_noise_come_from_the_curve_that_the_scene_names(done, tmp_path):
    scene = tmp_path / "scene.toml"
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    scene.write_text(text + '\n[curve]\nfile = "curve.csv"\n', encoding="utf-8")
    shutil.copy(SAMPLES / "cartilage_on_bone.csv", tmp_path / "curve.csv")
    grid = ["--radii", "0.5 mm:2 mm:2", "--depths", "0.1 mm:0.2 mm:2"]
    named = done("effects", scene)
    # Readings go to 0.3 mm and contact was at 14 um.
    assert "at 0.28" in named
    assert "by default" not in named
    shutil.copy(SAMPLES / "cartilage_on_bone.toml", scene)
    given = done("effects", scene, "--curve", tmp_path / "curve.csv")
    sizes = [
        line.split()[2] for line in (named, given) for line in line.splitlines() if "finite thickness" in line
    ]
    assert sizes[0] == sizes[1]
    out = done("plan", scene, "--curve", tmp_path / "curve.csv", *grid)
    # The sample was made with 0.6 mN of white noise.
    assert 0.5 < float(re.search(r"noise ([\d.]+) mN, as the curve scatters", out).group(1)) < 0.7


def test_a_named_curve_that_is_not_there_is_said(refused, tmp_path):
    scene = tmp_path / "scene.toml"
    text = (SAMPLES / "cartilage_on_bone.toml").read_text(encoding="utf-8")
    scene.write_text(text + '\n[curve]\nfile = "gone.csv"\n', encoding="utf-8")
    assert "gone.csv" in refused("effects", scene)

"""README and CI run the same commands: neither can drift from the other."""

import json
import re
import subprocess
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def readme_command(name):
    """Return the command in the fenced block that follows the marker `<!-- command: name -->`."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(rf"<!-- command: {name} -->\s*```(?:sh|bash)\n(.*?)\n```", text, re.DOTALL)
    assert found, f"README.md has no block marked {name}"
    return found.group(1).strip()


def test_ci_takes_its_commands_from_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for name in ("main-job", "tests"):
        assert f"readme_command {name}" in script
        assert readme_command(name) not in script


def test_the_workflow_runs_jobs_of_the_ci_script():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    listed = re.search(r"job: \[(.*?)\]", workflow)[1].split(", ")
    named = re.findall(r"run: \.ci/run (\w+)", workflow)
    assert {"suite", "reference", "built"} <= {*listed, *named}
    for name in (*listed, *named):
        assert f"\n{name}() {{" in script, name
    # It calls the script and nothing beside it.
    assert set(re.findall(r"- run: (\S+)", workflow)) == {".ci/run"}


def test_the_readme_leads_only_to_what_is_there():
    for page in [
        ROOT / "README.md",
        *(ROOT / ".reference" / "pages").glob("*.md"),
        *(ROOT / ".github").glob("*.md"),
    ]:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            # Pages that the reference makes from the code are checked where it is built.
            made = page.stem == "index" or target in {"underlay.md", "keys.md", "benchmark.md", "commands.md"}
            if "://" not in target and not made:
                assert (page.parent / target.partition("#")[0]).exists(), f"{page.name}: {target}"


def test_readme_commands_do_all_the_set_up():
    for name in ("main-job", "tests"):
        lines = readme_command(name).splitlines()
        assert lines[0].startswith("python3 -m venv .venv && ")
        # What follows needs no more than the line before it: an environment that is activated there.
        assert len(lines) == 1 or ". .venv/bin/activate" in lines[0]


def test_the_readme_is_short_and_its_first_screen_shorter():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert text.count("\n") < 180
    assert text.split("\n## How to read")[0].count("\n") < 60


def test_the_rows_of_cost_are_those_of_the_page():
    cost = (ROOT / ".reference" / "pages" / "cost.md").read_text(encoding="utf-8")
    section = (
        (ROOT / "README.md").read_text(encoding="utf-8").split("## What accuracy costs")[1].split("\n## ")[0]
    )
    rows = [line for line in section.splitlines() if re.match(r"\| (explicit|exact)", line)]
    assert len(rows) == 4
    assert set(rows) <= set(cost.splitlines())


def test_what_others_read_of_the_package_is_what_it_says_itself():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    source = (ROOT / "src" / "underlay" / "_version.py").read_text(encoding="utf-8")
    version = re.search(r'^VERSION = "(.*)"$', source, re.MULTILINE)[1]
    told = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert told["softwareRequirements"] == project["dependencies"]
    assert told["description"] == project["description"]
    assert told["version"] == version
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in cited
    recipe = (ROOT / ".conda" / "meta.yaml").read_text(encoding="utf-8")
    assert f'set version = "{version}"' in recipe
    run = recipe.split("  run:\n")[1].split("\ntest:")[0]
    listed = {
        line.strip("- ").replace(" ", "").replace("matplotlib-base", "matplotlib")
        for line in run.splitlines()
    }
    assert listed - {""} == {*project["dependencies"], f"python{project['requires-python']}"}


def test_top_level_is_what_the_house_says():
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        names = {path.name for path in ROOT.iterdir()}
    else:
        names = {line.split("/")[0] for line in listing.stdout.splitlines()}
    visible = {name for name in names if not name.startswith(".")} - {"build", "dist"}
    assert visible <= {
        "pyproject.toml",
        "src",
        "tests",
        "data_samples",
        "notebooks",
        "README.md",
        "LICENSE",
        "CITATION.cff",
        "codemeta.json",
    }

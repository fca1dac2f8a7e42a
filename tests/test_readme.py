"""README and CI run the same commands: neither can drift from the other."""

import re
import subprocess
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


def test_readme_commands_do_all_the_set_up():
    for name in ("main-job", "tests"):
        command = readme_command(name)
        assert "\n" not in command
        assert "python3 -m venv" in command


def test_top_level_is_what_the_house_says():
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        names = {path.name for path in ROOT.iterdir()}
    else:
        names = {line.split("/")[0] for line in listing.stdout.splitlines()}
    visible = {name for name in names if not name.startswith(".")} - {"build", "dist"}
    assert visible <= {"pyproject.toml", "src", "tests", "data_samples", "notebooks", "README.md", "LICENSE"}

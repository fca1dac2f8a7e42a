"""The paper, equation by equation: each numbered equation of sections 4 to 9 has a test that names it."""

import re
from pathlib import Path

HERE = Path(__file__).parent
FILES = ["test_integral_relations.py", *(path.name for path in HERE.glob("test_paper_section*.py"))]
LAST = {4: 15, 5: 13, 6: 11, 7: 7, 8: 5, 9: 6}
UNCOUNTED = {"4_8b", "5_9a", "2_13", "3_4"}


def test_every_numbered_equation_of_sections_4_to_9_has_a_test():
    text = "".join((HERE / name).read_text(encoding="utf-8") for name in FILES)
    named = {
        number
        for name in re.findall(r"^def (test_eq_\w+)", text, re.MULTILINE)
        for number in re.findall(r"(?:eq|and)_(\d_\d+[ab]?)", name)
    }
    wanted = {f"{section}_{n}" for section, count in LAST.items() for n in range(1, count + 1)} | UNCOUNTED
    missing = wanted - named
    assert not missing, f"no test names the equations {sorted(missing)}"

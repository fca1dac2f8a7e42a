"""The page, as a person goes through it."""

import json
from pathlib import Path

import underlay as ul
from support.page import begin, bring, page, press, run, text_of, until

SAMPLES = Path(__file__).parents[1] / "data_samples"


def test_from_a_dropped_file_to_a_number(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            folder = await begin(user)
            await bring(user, SAMPLES / "cartilage_on_bone.csv")
            await until(user, "tests")
            press(user, "step-2")
            press(user, "preset-cartilage_on_bone")
            await until(user, "to-fit")
            press(user, "step-3")
            await until(user, "modulus-half-space")
            press(user, "fit")
            await until(user, content="What acts in this test, and how much")
            assert "Layer modulus" in text_of(user, "headline")
            shown = json.loads((folder.results / "cartilage_on_bone.shown.json").read_text())
            fit = ul.fit(ul.load_problem(folder.curve_file("cartilage_on_bone.csv"), folder.scene))
            assert shown["values"] == {name: repr(float(value)) for name, value in fit.values.items()}

    run(person())

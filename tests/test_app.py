"""The page, as a person goes through it."""

import json
from pathlib import Path

import numpy as np

import underlay as ul
from support.page import begin, bring, marks, page, press, run, text_of, until, until_said, write
from underlay.inference.batch.decisions import read_decisions
from underlay.inference.batch.map_table import read_map

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


def made_curves(folder, count=4, points=120):
    """Curves of two animals, written as plain tables; the last one holds no contact."""
    rng = np.random.default_rng(1)
    files = []
    for number in range(count):
        scene = ul.Scene(
            ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6 * (1.0 + 0.2 * number), 0.46), 2e-3), ul.RIGID
        )
        curve = ul.synthesize(scene, np.linspace(-3e-5, 2e-4, points), ul.Noise(force=2e-4), rng=rng)
        force = curve.force if number < count - 1 else 0.0 * curve.force
        rows = "".join(f"{d!r},{f!r}\n" for d, f in zip(curve.depth.tolist(), force.tolist()))
        files.append(folder / f"animal{number // 2}-site{number}.csv")
        files[-1].write_text("depth (m),force (N)\n" + rows)
    return files


def test_many_curves_are_fitted_decided_and_taken_together(tmp_path):
    async def person():
        made = tmp_path / "made"
        made.mkdir()
        files = made_curves(made, 5)
        async with page(tmp_path / "home") as user:
            folder = await begin(user)
            await bring(user, *files)
            await until(user, "tests")
            press(user, "step-2")
            press(user, "preset-cartilage_on_bone")
            await until(user, "to-fit")
            press(user, "step-4")
            for animal in ("animal0", "animal1"):
                write(user, "label-files", animal)
                write(user, "label-name", animal)
                press(user, "label-set")
                await until_said(user, f"are of animal {animal}")
            press(user, "fit-all")
            await until(user, "card-animal0-site0.csv")
            press(user, "refuse-animal0-site0.csv")
            await until(user, "reason")
            press(user, "refuse-now")
            await until_said(user, "say why")
            press(user, "refuse-animal0-site0.csv")
            await until(user, "reason")
            write(user, "reason", "=air bubble")
            press(user, "refuse-now")
            await until(user, "decided-animal0-site0.csv")
            # What is shown as decided is on the disk, and the command line reads it.
            decided = read_decisions(folder.decisions).by_curve
            assert {name: (d.accepted, d.reason) for name, d in decided.items()} == {
                "animal0-site0.csv": (False, "=air bubble")
            }
            assert "accept-animal2-site4.csv" not in marks(user)  # it has no fit
            for select in ("by", "group"):
                await until(user, select)
            write(user, "by", "animal")
            press(user, "together")
            await until(user, content="Mean")
        judged = read_map(folder.results / "judged.csv")
        assert list(judged["status"]) == ["refused by hand", *["fitted"] * 3, "failed"]
        assert set(judged["animal"]) == {"animal0", "animal1", "animal2-site4.csv"}

    run(person())

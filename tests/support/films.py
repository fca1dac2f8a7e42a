"""Tests of films with continuous stiffness, made from the law of a flat punch on the body with the tip in series."""

import numpy as np

import underlay as ul
from underlay.data.export import write_curves
from underlay.inference.films import DIAMOND

WORN = ul.AreaFunction((24.5, 4e-7))
FILM = ul.Scene(ul.Cone.berkovich(), ul.Layer(ul.Isotropic(70e9, 0.18), 500e-9), ul.Isotropic(160e9, 0.22))
#: Hardness (Pa): what says the force of a contact of a given area.
HARDNESS = 9e9


def made_test(scene=FILM, area=WORN, scatter=0.0, count=12):
    """A test with continuous stiffness, each depth from the flat punch on the body and the tip in series."""
    contact = np.geomspace(40e-9, 350e-9, count)
    radius = area.radius(contact)
    moduli = []
    for a in radius.tolist():
        law = ul.contact_law(
            ul.FlatPunch(a), scene.layer, scene.substrate, max_depth=1e-3 * a, solver="exact"
        )
        moduli.append(float(law.stiffness(1e-3 * a)) / (2.0 * a))
    S = 2.0 * 1.05 * radius / (1.0 / np.array(moduli) + 1.0 / DIAMOND)
    P = HARDNESS * area.area(contact)
    columns = {"contact_stiffness": S, "contact_stiffness_scatter": scatter * S}
    return ul.Curve(contact + 0.75 * P / S, P, segment=np.full(count, "loading"), columns=columns)


def write_films(folder):
    """A test of a film and one of its bare base with the same tip, as files, and a scene file."""
    film, base, scene = folder / "oxide.xls", folder / "silicon.xls", folder / "film.toml"
    bare = ul.Scene(ul.Cone.berkovich(), ul.Layer(FILM.substrate))
    for test, path in ((made_test(scatter=0.01, count=20), film), (made_test(bare, count=20), base)):
        # What a file is its content says, not its name.
        write_curves(test, path.with_suffix(".json")).rename(path)
    FILM.with_values({"layer.E": 50e9}).save(scene)
    scene.write_text(scene.read_text() + "\n[fit]\nlayer.E = {}\n", encoding="utf-8")
    return film, base, scene

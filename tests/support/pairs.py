"""Pairs of materials and shapes that span what the asymptotic model meets; thickness and E1 are 1."""

import underlay as ul

FORMS = ("explicit", "parametric", "compliance")
PARABOLOID = ul.Paraboloid(0.5)


def on(nu, substrate):
    return ul.Layer(ul.Isotropic(1.0, nu), 1.0), substrate


PAIRS = {
    "rigid nu=.5": on(0.5, ul.RIGID),
    "rigid nu=.3": on(0.3, ul.RIGID),
    "10": on(0.5, ul.Isotropic(10.0, 0.3)),
    "1.5": on(0.4, ul.Isotropic(1.5, 0.4)),
    "nu only": on(0.5, ul.Isotropic(1.0, 0.2)),
    "0.9": on(0.4, ul.Isotropic(0.9, 0.4)),
    "0.5": on(0.3, ul.Isotropic(0.5, 0.3)),
    "0.1": on(0.3, ul.Isotropic(0.1, 0.3)),
    "0.01": on(0.5, ul.Isotropic(0.01, 0.5)),
    "0.001": on(0.3, ul.Isotropic(0.001, 0.3)),
}
SHAPES = {
    "cone": ul.Cone(1.0),
    "paraboloid": PARABOLOID,
    "quintic": ul.PowerLaw(5.0, 1.0),
    "sphere": ul.Sphere(6.0),
}

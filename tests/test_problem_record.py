"""A problem kept as text and arrays is the same problem again, to the last bit, or says why it cannot be."""

import json
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import underlay as ul
from underlay.inference.priors import Truncated
from underlay.inference.sampling.posterior_file import problem_from_record, problem_record
from underlay.mechanics.indenters import PowerLawShape


@dataclass(frozen=True)
class Dish(PowerLawShape):
    """A shape from outside: Phi = r^2 / (2 R)."""

    shape: ClassVar[str] = "dish"
    exponent: ClassVar[float] = 2.0

    radius: float

    @property
    def coefficient(self):
        return 0.5 / self.radius


class Nameless(Dish):
    """The same, which scene files do not know."""

    shape: ClassVar[str] = ""


@dataclass(frozen=True)
class Worded(Dish):
    """A shape with a field that is no number."""

    shape: ClassVar[str] = "worded"

    maker: str = "me"


@dataclass(frozen=True)
class Weighed(Dish):
    """A shape with a number that may be one that no scene file holds."""

    shape: ClassVar[str] = "weighed"

    weight: float = 1.0


@dataclass(frozen=True)
class Forgetful(Dish):
    """A shape that is never the same."""

    shape: ClassVar[str] = "forgetful"

    def __eq__(self, other):
        return self is other

    __hash__ = None


LAYER = ul.Layer(ul.Isotropic(1e6, 0.45), 1.3e-3)
SCENE = ul.Scene(ul.Paraboloid(1e-3), LAYER, ul.RIGID)


def curve_of(scene, seed=0):
    noise = ul.Noise(force=1e-4)
    return ul.synthesize(scene, np.linspace(-1e-5, 1e-4, 30), noise, seed, time=np.linspace(0.0, 1.0, 30))


def scenes():
    tip = ul.Profile([0.0, 2e-4, 6e-4, 1e-3], [0.0, 2e-5, 2e-4, 7e-4])
    anisotropic = ul.Layer(ul.TransverselyIsotropic(1e6, 5e5, 0.3, 0.2, 3e5), 1e-3)
    return {
        "paraboloid": SCENE,
        "half-space": ul.Scene(ul.Cone.berkovich(), ul.Layer(ul.Isotropic(1 / 3e-6, 0.3))),
        "measured tip": ul.Scene(tip, LAYER, ul.Isotropic(1e7, 0.1)),
        "anisotropic": ul.Scene(ul.Sphere(1e-3), anisotropic, ul.RIGID, ul.Instrument(1e-6, 2e-5, 0.1, 1e-7)),
        "shape from outside": ul.Scene(Dish(np.float64(1 / 3e3)), LAYER, ul.RIGID),
    }


def again(problem):
    """What comes back from the text that a file would hold."""
    document, arrays = problem_record(problem)
    return problem_from_record(json.loads(json.dumps(document)), arrays)


def same(first, second):
    assert second.names == first.names
    assert second.priors == first.priors
    assert second.noise == first.noise
    assert second.solver == first.solver
    assert second.base_scenes == first.base_scenes
    for a, b in zip(first.curves, second.curves, strict=True):
        np.testing.assert_array_equal(a.depth, b.depth)
        np.testing.assert_array_equal(a.force, b.force)
        np.testing.assert_array_equal(a.time, b.time)
        assert (a.segment is None) == (b.segment is None)
        assert a.metadata == b.metadata
        assert a.truth == b.truth
    at = first.start + 0.01
    assert second.log_posterior(at) == first.log_posterior(at)


@pytest.mark.parametrize("name", scenes())
def test_every_scene_comes_back(name):
    scene = scenes()[name]
    path = "layer.E" if "layer.E" in scene.parameters else "layer.nu"
    curve = curve_of(scene).with_metadata(name="site 1", notes=["a", "b"], indenter_radius=1e-3)
    problem = ul.Problem(scene, curve, {path: None})
    same(problem, again(problem))


def test_priors_noise_and_law_come_back():
    free = {
        "layer.E": ul.LogUniform(1e4, 1e8),
        "layer.nu": (0.3, 0.49),
        "layer.thickness": Truncated(ul.Normal(1.3e-3, 1e-4), low=1e-4),
        "indenter.radius": ul.LogNormal(1e-3, 0.01),
        "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5),
        "instrument.baseline": None,
        "noise.force": ul.HalfNormal(1e-3),
    }
    noise = ul.Noise(force=1e-4, relative=0.01, correlation_time=0.02, depth=1e-8)
    options = {"solver": ul.Asymptotic(3, "parametric")}
    curve = replace(curve_of(SCENE), segment=np.full(30, "loading"))
    first = ul.Problem(SCENE, curve, free, noise, **options)
    same(first, again(first))


def test_a_joint_problem_comes_back():
    other = replace(SCENE, indenter=ul.Paraboloid(4e-4))
    first = ul.Problem.joint(
        [(SCENE, curve_of(SCENE)), (other, curve_of(other, 1))],
        {
            "layer.E": (1e4, 1e8),
            "instrument.contact_depth": (-1e-5, 1e-5),
            "indenter.radius[1]": (1e-4, 1e-2),
        },
        ["layer.E"],
        [ul.Noise(force=1e-4), None],
    )
    second = again(first)
    assert second.shared == first.shared
    same(first, second)


@dataclass(frozen=True)
class Own(ul.Uniform):
    """A prior from outside."""


@pytest.mark.parametrize(
    ("scene", "free", "message"),
    [
        (SCENE, {"layer.E": Own(1e4, 1e8)}, "the prior of layer.E, Own, is not part of underlay"),
        (
            replace(SCENE, indenter=Nameless(1e-3)),
            {"layer.E": (1e2, 1e8)},
            "Nameless, has no name in scene files",
        ),
        (
            replace(SCENE, indenter=Weighed(1e-3, np.inf)),
            {"layer.E": (1e2, 1e8)},
            "its scene, of a Weighed, cannot be written",
        ),
        (
            replace(SCENE, indenter=Forgetful(1e-3)),
            {"layer.E": (1e2, 1e8)},
            "its scene, of a Forgetful, does not come back",
        ),
    ],
    ids=["prior", "indenter", "field", "equality"],
)
def test_what_has_no_name_is_refused(scene, free, message):
    with pytest.raises(ul.InputError, match=message):
        problem_record(ul.Problem(scene, curve_of(SCENE), free))


def test_a_word_of_a_shape_of_ones_own_comes_back():
    scene = replace(SCENE, indenter=Worded(1e-3, "you"))
    record = problem_record(ul.Problem(scene, curve_of(SCENE), {"layer.E": (1e2, 1e8)}))
    assert problem_from_record(*record).base_scenes[0] == scene


def test_damaged_records_are_refused():
    document, arrays = problem_record(ul.Problem(SCENE, curve_of(SCENE), ["layer.E"]))
    moved = {**arrays, "0/force": arrays["0/force"] + 1e-9}
    with pytest.raises(ul.FileFormatError, match="points of curve 1 are not those that were saved"):
        problem_from_record(document, moved)
    for part in ("tests", "free", "noise", "solver"):
        with pytest.raises(ul.FileFormatError, match=part):
            problem_from_record({key: value for key, value in document.items() if key != part}, arrays)
    unknown = document["tests"][0]["scene"].replace("paraboloid", "tetrahedron")
    with pytest.raises(ul.InputError, match="tetrahedron"):
        problem_from_record({**document, "tests": [{**document["tests"][0], "scene": unknown}]}, arrays)

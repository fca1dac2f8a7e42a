"""A wrong kind of thing at a public door: what was given, what is wanted, and how to get one."""

from __future__ import annotations

import numpy as np
import pytest

import underlay as ul
from support.populations import made_study, table_of

WRONG = [None, "nonsense", -1.0, [], object()]
CURVE = ul.Curve(np.linspace(0.0, 1e-6, 20), np.linspace(0.0, 1e-6, 20))
SCENE = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)

DEPTH = np.linspace(0.0, 5e-5, 40)
NOISE = ul.Noise(force=1e-3)


def planned(scene: object = SCENE, **change: object) -> ul.Plan:
    """A plan with something else for one of its arguments."""
    given = {"free": ["layer.E"], "noise": NOISE, "radii": [5e-4, 1e-3], "depths": [2e-5, 5e-5], "points": 20}
    return ul.plan(scene, **(given | change))


DOORS = {
    "a Problem": {
        "fit": ul.fit,
        "sample": ul.sample,
        "compare": ul.compare,
        "free_model_error": ul.free_model_error,
        "marginalised": ul.marginalised,
        "with_model_error": lambda given: ul.with_model_error(given, 0.01),
        "posterior_from_chain": lambda given: ul.posterior_from_chain(given, np.zeros((10, 4, 2))),
    },
    "a Problem or a Fit": {
        "profile": lambda given: ul.profile(given, "layer.E"),
        "compare_bonds": ul.compare_bonds,
    },
    "a Fit or a Problem": {"pointwise_modulus": ul.pointwise_modulus},
    "a Scene or a Problem or a Fit": {"identifiability": ul.identifiability},
    "a Fit": {
        "second_test": lambda given: ul.second_test(given, "layer.E"),
        "steps_to_ours": ul.steps_to_ours,
    },
    "a Scene": {
        "simulate": lambda given: ul.simulate(given, [0.0, 1e-6]),
        "accuracy_cost": lambda given: ul.accuracy_cost(given, [1e-6]),
        "answer_cost": lambda given: ul.answer_cost(given, 1e-6),
        "plan": lambda given: planned(scene=given),
        "posterior_cost": lambda given: ul.posterior_cost(given, 1e-6),
        "fit_stiffness": lambda given: ul.fit_stiffness(CURVE, given),
    },
    "a NoiseModel": {
        "plan": lambda given: planned(noise=given),
    },
    "a Curve": {
        "check_quality": ul.check_quality,
        "find_contact": ul.find_contact,
        "fit_stiffness": lambda given: ul.fit_stiffness(given, SCENE),
    },
}
CASES = [(wanted, name) for wanted, doors in DOORS.items() for name in doors]


@pytest.mark.parametrize(("wanted", "name"), CASES)
def test_a_wrong_kind_is_told_with_the_way_to_the_right_one(wanted: str, name: str) -> None:
    for given in WRONG:
        kind = "None" if given is None else type(given).__name__
        with pytest.raises(ul.InputError, match=rf"must be {wanted}; got {kind}.*: ul\.[A-Za-z_.]+\("):
            DOORS[wanted][name](given)


def test_the_file_of_a_curve_in_place_of_a_problem() -> None:
    with pytest.raises(ul.InputError) as told:
        ul.fit("curve.csv")
    assert str(told.value) == (
        "problem must be a Problem; got str 'curve.csv': ul.Problem(scene, curve, free) or "
        "ul.load_problem(curve_file, scene_file) makes one"
    )


@pytest.mark.parametrize("given", [None, -1.0, "layer.E"])
def test_what_is_free_is_told(given: object) -> None:
    with pytest.raises(
        ul.InputError, match=r'free must be paths with their priors, such as \{"layer.E": None\}'
    ):
        ul.Problem(SCENE, CURVE, given)


@pytest.mark.parametrize("given", [None, -1.0, [SCENE], [({}, None)], [({}, SCENE)]])
def test_results_of_a_population_are_told(given: object) -> None:
    with pytest.raises(
        ul.InputError, match=r"results must be the table of a map, its file, or pairs \(labels"
    ):
        ul.population(given, by=["animal"])


@pytest.mark.parametrize(
    "given", [None, [], {"one": None}, {"one": (1, 2), "two": (3, 4)}, {"a": "ab", "b": "cd"}]
)
def test_models_that_are_compared_are_told(given: object) -> None:
    with pytest.raises(ul.InputError, match=r"compare at least two models|must be \(problem, posterior\)"):
        ul.compare_models(given)


@pytest.mark.parametrize("given", [None, -1.0, object()])
def test_curves_of_a_map_are_told(given: object) -> None:
    with pytest.raises(ul.InputError, match="give a folder with curve files, files, or curves"):
        ul.fit_many(given, SCENE, {"layer.E": None})


@pytest.fixture(scope="module")
def fit() -> ul.Fit:
    curve = ul.synthesize(SCENE, DEPTH, NOISE, rng=1)
    return ul.fit(ul.Problem(SCENE, curve, {"layer.E": (1e4, 1e8)}, noise=NOISE))


@pytest.mark.parametrize("level", [0.0, -0.5, 1.0, 95.0, np.nan, "0.95", None, True])
def test_a_level_is_told(fit: ul.Fit, level: object) -> None:
    for ask in (
        lambda: fit.interval("layer.E", level),
        lambda: fit.band(lambda physical: physical[:, :1], level),
    ):
        with pytest.raises(ul.InputError, match=r"level must be above 0 and at most 0\.999; got"):
            ask()


@pytest.mark.parametrize(
    ("of", "told"),
    [
        (lambda physical: physical[:, 0], r"at 3 draws it gave an array of shape \(3,\)"),
        (lambda physical: physical[:1], r"at 3 draws it gave an array of shape \(1, 1\)"),
        (lambda physical: physical[None], r"at 3 draws it gave an array of shape \(1, 3, 1\)"),
        (lambda _: 1.0, "at 3 draws it gave 1.0"),
        (lambda _: "E", "at 3 draws it gave 'E'"),
        (lambda _: None, "at 3 draws it gave None"),
        ("layer.E", "got 'layer.E'"),
        (None, "got None"),
    ],
)
def test_what_a_band_is_of_is_told(fit: ul.Fit, of: object, told: str) -> None:
    with pytest.raises(ul.InputError, match=rf"of must be a function .*lambda p: p\[:, :1\]; {told}"):
        fit.band(of)
    low, _, high = fit.band(lambda physical: physical.tolist())
    assert low[0] < fit.values["layer.E"] < high[0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        *(
            ({"free": given}, "free must be paths with their priors")
            for given in (None, "layer.E", [3], [["layer.E"]])
        ),
        *(
            ({"points": given}, "points must be a whole number, 8 or more")
            for given in (-5, 0, 7, 20.5, "x", None)
        ),
        *(
            ({name: given}, f"{name} must be positive lengths .*increasing")
            for name in ("radii", "depths")
            for given in (None, [], 0.0, -1e-3, [1e-3, 5e-4], [1e-3, 1e-3])
        ),
        ({"radii": "1 mm"}, "radii must hold numbers"),
    ],
)
def test_what_a_plan_is_made_of_is_told(change: dict[str, object], told: str) -> None:
    with pytest.raises(ul.InputError, match=told):
        planned(**change)


def test_the_first_test_of_a_second_is_told() -> None:
    """Radius 0 was taken for the largest, a NaN and a negative one for the smallest of the grid."""
    plan = planned()
    for given in (0, -1e-3, np.nan, np.inf, "1 mm", None, [1e-3]):
        with pytest.raises(ul.InputError, match="the radius of the first test must be"):
            plan.second(given, 5e-5)
        with pytest.raises(ul.InputError, match="the depth of the first test must be"):
            plan.second(1e-3, given)
    for radius, depth in ((1.0, 5e-5), (1e-3, 50.0), (1e-4, 5e-5), (1e-3, 5e-6)):
        with pytest.raises(ul.InputError, match="lies far outside the grid of this plan, "):
            plan.second(radius, depth)
    near, there = plan.second(1.1e-3, 4e-5), plan.second(1e-3, 5e-5)
    np.testing.assert_array_equal(near.stderr, there.stderr)


def test_what_a_second_test_aims_at_is_told(fit: ul.Fit) -> None:
    for given in (0.0, -0.1, np.nan, 2.0, "10 %", None, [0.1]):
        with pytest.raises(
            ul.InputError, match="target is the relative standard error that counts as fixed, above 0"
        ):
            ul.second_test(fit, "layer.E", value=1e6, target=given)
    for given in ("1 MPa", [1e6], np.nan, np.inf):
        with pytest.raises(ul.InputError, match="value must be"):
            ul.second_test(fit, "layer.E", value=given)


def test_what_a_test_before_it_is_done_is_made_of_is_told() -> None:
    with pytest.raises(ul.InputError, match=r"depth must be a list of numbers, \(n,\); got shape \(\)"):
        ul.identifiability(SCENE, depth=5e-5, free=["layer.E"], noise=NOISE)
    with pytest.raises(ul.InputError, match=r"noise must be a NoiseModel; got float 0\.001: ul\.Noise\("):
        ul.identifiability(SCENE, depth=DEPTH, free=["layer.E"], noise=1e-3)


def test_whose_the_curves_of_a_population_are_is_told() -> None:
    """One name is one column, not a column per letter."""
    rng = np.random.default_rng(1)
    table = table_of(*made_study(rng, animals=3, sites=2, between=0.1, within=0.1))
    asked = ul.population(table, by="animal")
    assert asked.by == ("animal",)
    assert asked.groups[""].units == 3
    for given in (
        None,
        5,
        True,
        [None],
        [""],
        ["animal", 5],
        [["animal"]],
        ["animal", "animal"],
        {"animal": 1},
    ):
        with pytest.raises(
            ul.InputError, match=r'by must be different names of columns, such as \["animal"\]'
        ):
            ul.population(table, by=given)
    for given in ("x", -0.1, 1.0, np.nan, [0.1]):
        with pytest.raises(
            ul.InputError, match="shared_error is a relative error, 0 or more and below 1; got"
        ):
            ul.population(table, shared_error=given)

"""A relaxing layer on a rigid base: reference values, limits and laws of its force in time."""

import tomllib
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy import integrate, special

import underlay as ul
from underlay.inference.sampling.derived import derived_quantities
from underlay.mechanics.contact_law import ScaledLaw
from underlay.mechanics.response import Remembered
from underlay.mechanics.viscoelastic import history
from underlay.mechanics.viscoelastic.bed import Bed
from underlay.mechanics.viscoelastic.equal_radius import equal_radius
from underlay.mechanics.viscoelastic.history import Loading, Viscoelastic, WayIn
from underlay.mechanics.viscoelastic.memory import Memory
from underlay.report import plots

#: Depth at which a paraboloid of radius h reaches a = h, by Poisson's ratio (lengths in h, theta = 1).
REACH = {0.5: 0.559415485563, 0.3: 0.647622319928}
SOLID = ul.Prony((0.7,), (0.5,))


def elastic_law(nu, indenter=None, thickness=1.0, scale=1.0):
    base = ul.RIGID
    layer = ul.Layer(ul.Isotropic(2.0 * (1.0 - nu**2), nu), thickness)
    return ul.contact_law(
        indenter or ul.Paraboloid(1.0), layer, base, max_depth=scale * REACH[nu], solver=ul.Exact(rtol=1e-10)
    )


@pytest.fixture(scope="module")
def laws():
    return {nu: elastic_law(nu, scale=1.0001) for nu in REACH}


def triangle(time, peak):
    """Up to `peak` in 1, and down at two thirds of the speed."""
    return np.where(time <= 1.0, peak * time, peak - (time - 1.0) * peak / 1.5)


# --- reference values, by quadrature over the elastic law, a bed of springs and rings of pressure ---------

WITH_RELAXATION = tomllib.loads((Path(__file__).parent / "data" / "relaxing_forces.toml").read_text("utf-8"))


def reference(name, nu):
    """Times, and the force there, of one motion."""
    time, *force = np.transpose(WITH_RELAXATION[name]["rows"])
    return time, force[(0.5, 0.3).index(nu)]


@pytest.mark.parametrize("nu", [0.5, 0.3])
def test_triangle(laws, nu):
    time = np.linspace(0.0, 1.9, 381)
    force = Viscoelastic(SOLID).force(laws[nu].force, triangle(time, REACH[nu]), time)
    when, known = reference("triangle", nu)
    # 200 points on the ramp: 2e-9 of the largest force.
    assert np.abs(force[np.round(200.0 * when).astype(int)] - known).max() < 1e-8 * known.max()
    # Contact ends at 1.836396466676, whatever the layer.
    assert force[367] > 0.0
    assert not force[368:].any()


def test_contact_is_lost_at_the_stated_time(laws):
    def still(end):
        time = np.append(np.linspace(0.0, 1.0, 101), (1.4, end))
        return Viscoelastic(SOLID).force(laws[0.5].force, triangle(time, REACH[0.5]), time)[-1] > 0.0

    low, high = 1.8, 1.9
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if still(middle) else (low, middle)
    assert low == pytest.approx(1.836396466676, abs=1e-9)


@pytest.mark.parametrize("nu", [0.5, 0.3])
@pytest.mark.parametrize(
    ("relaxation", "name"),
    [(ul.Prony((0.5, 0.3), (0.1, 2.0)), "ramp"), (ul.PowerLawRelaxation(0.2), "power_law_ramp")],
)
def test_ramp_and_hold(laws, nu, relaxation, name):
    # Uneven steps: 1000 on the ramp, then of 0.05.
    time = np.concatenate((np.linspace(0.0, 0.25, 1001), np.linspace(0.25, 10.0, 196)[1:]))
    force = Viscoelastic(relaxation).force(laws[nu].force, REACH[nu] * np.minimum(time / 0.25, 1.0), time)
    when, known = reference(name, nu)
    at = [int(np.abs(time - t).argmin()) for t in when]
    assert force[at] == pytest.approx(known, rel=1e-8)


def test_two_cycles(laws):
    corners = (0.0, 1.0, 1.3, 1.8, 2.2, 2.6, 3.4)
    time = np.linspace(0.0, 3.4, 341)
    depth = REACH[0.5] * np.interp(time, corners, (0.0, 0.7, 0.45, 0.9, 0.9, 0.55, 1.0))
    force = Viscoelastic(SOLID).force(laws[0.5].force, depth, time)
    assert force[130] == pytest.approx(0.14235, abs=1e-5)
    assert force[340] == pytest.approx(1.96749, abs=1e-5)


# --- the constructions agree with each other ---------------------------------------------------------------


def test_bed_agrees_with_the_closed_constructions(laws):
    time = np.linspace(0.0, 1.9, 191)
    depth = triangle(time, REACH[0.5])
    bed = Bed.of(depth, SOLID.modes(0.01, 1.9), time)(laws[0.5].force)
    closed = Viscoelastic(SOLID).force(laws[0.5].force, depth, time)
    assert np.abs(bed - closed).max() < 1e-5 * closed.max()


def test_ripples_of_a_depth_reading_hold_next_to_nothing(laws, monkeypatch):
    time = np.linspace(0.0, 3.0, 301)
    ripple = 1.4e-3 * np.random.default_rng(0).uniform(-1.0, 1.0, time.size)
    depth = REACH[0.5] * np.minimum(0.99 * np.minimum(time, 1.0) + ripple, 1.0)
    depth[0] = 0.0
    smooth = Viscoelastic(SOLID).force(laws[0.5].force, depth, time)
    monkeypatch.setattr(history, "RIPPLES", (0.0,))
    rippled = Viscoelastic(SOLID).force(laws[0.5].force, depth, time)
    assert np.abs(rippled - smooth).max() < 5e-5 * smooth.max()


def test_integral_by_quadrature(laws):
    """One value of the superposition integral, by another route: adaptive quadrature of e(t - s) S(w) w'."""
    law, peak, end = laws[0.3], REACH[0.3], 0.8
    value, _ = integrate.quad(
        lambda s: float(SOLID.modulus(end - s) * law.stiffness(peak * s)) * peak, 0.0, end, epsrel=1e-10
    )
    time = np.linspace(0.0, end, 161)
    assert Viscoelastic(SOLID).force(law.force, peak * time, time)[-1] == pytest.approx(value, rel=1e-8)


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("span", [4.0, 3e4])
def test_integrals_over_the_past_obey_their_recursion(uneven, span):
    """z_{n+1} = e^-x z_n + d g1 + c g2, step by step, in records of 4 and of 30,000 of the shortest times."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, span, 401)
    if uneven:
        time = np.sort(np.append(time[[0, -1]], rng.uniform(0.0, span, 399)))
    memory = Memory.of(ul.Prony((0.2, 0.3, 0.1), (1.0, 0.02 * span, 30.0 * span)).modes(0.0, span), time)
    values, bend = rng.standard_normal(401), rng.standard_normal(400)
    found = memory.integrals(values, bend)
    for row, tau in zip(found, memory.modes.times, strict=True):
        z = values[0]
        for n, x in enumerate(np.diff(time) / tau):
            g1 = -np.expm1(-x) / x
            if n == 30:
                break
            g2 = 2.0 * integrate.quad(lambda s, x=x: s * np.exp(-s * x), 0.0, 1.0)[0] - g1
            z = np.exp(-x) * z + g1 * (values[n + 1] - values[n]) + g2 * bend[n]
            assert row[n + 1] == pytest.approx(z, rel=1e-9, abs=1e-9)


def test_forces_and_their_bends_are_read_off_the_answers():
    """The bend of w^(3/2) against the force in the middle of each step."""
    depth = np.append(np.linspace(0.0, 1.0, 401), (1.0, 1.0))
    way_in = WayIn(depth)
    force, bend = way_in.read(way_in.asked**1.5)
    assert force == pytest.approx(depth**1.5, abs=1e-15)
    exact = 4.0 * (0.5 * (depth[1:] + depth[:-1])) ** 1.5 - 2.0 * (depth[1:] ** 1.5 + depth[:-1] ** 1.5)
    assert bend == pytest.approx(exact, abs=1e-15)
    assert [part.shape for part in way_in.moving(way_in.asked**1.5)] == [(401,), (400,)]
    # Rests, steps back and uneven steps do not matter, and of many sets each is as alone.
    rough = np.maximum.accumulate(np.random.default_rng(0).uniform(0.0, 1.0, 900))
    paths = np.maximum(np.linspace(-0.1, 1.0, 900) - np.array([[0.0], [0.05], [-0.2]]), 0.0)
    for path in (rough, *paths):
        alone = WayIn(path)
        assert alone.read(alone.asked**1.5)[0] == pytest.approx(path**1.5, abs=1e-15)
    all_of_them = WayIn(paths)
    values, bends = all_of_them.read(all_of_them.asked**1.5)
    for number in range(3):
        one = WayIn(paths[number : number + 1])
        value, turned = one.read(one.asked**1.5)
        assert np.array_equal(values[number], value[0])
        assert np.array_equal(bends[number], turned[0])


@pytest.mark.parametrize("uneven", [False, True])
def test_a_hold_fades_as_the_recursion_has_it(uneven):
    """The closed form after the last step, and the recursion through all points: rounding alone is between them."""
    time = np.linspace(0.0, 10.0, 400)
    if uneven:
        time = np.sort(np.random.default_rng(0).uniform(0.0, 10.0, 400))
    memory = Memory.of(ul.Prony((0.3, 0.2, 0.1), (0.1, 1.0, 10.0)).modes(0.0, 10.0), time)
    depth = np.interp(time, (0.0, 3.0, 10.0), (-0.1, 1.0, 1.0))
    way_in = WayIn(np.maximum(depth, 0.0))
    through = memory.hereditary(*way_in.read(way_in.asked**1.5))
    assert Loading(depth, memory)(lambda w: w**1.5) == pytest.approx(through, abs=1e-14)


@pytest.mark.parametrize("points", [12, 120, 6000])
def test_equal_radius_solves_its_condition(points):
    """Ways out with rests, of few and many points: int_{t1}^t e(t - s) dw(s) = 0 by the record itself."""
    time = np.sort(
        np.append(np.random.default_rng(1).uniform(0.0, 9.0, points), (0.0, 3.0, 4.0, 5.0, 5.5, 9.0))
    )
    depth = np.interp(time, (0.0, 3.0, 4.0, 5.0, 5.5, 9.0), (0.0, 1.0, 1.0, 0.8, 0.8, -0.2))
    turn = int(np.flatnonzero(time == 4.0)[-1])
    modes = ul.Prony((0.3, 0.2, 0.1), (0.01, 0.5, 20.0)).modes(0.0, 9.0)
    found = equal_radius(depth, Memory.of(modes, time), turn)
    assert found.held[0]
    for number in np.flatnonzero(found.held)[:: max(points // 30, 1)]:
        now = time[turn + 1 + number]
        corners = np.append(found.time[number], time[(time > found.time[number]) & (time <= now)])
        w = np.interp(corners, time, depth)
        lags, steps = now - corners, np.diff(w) / np.diff(corners)
        # The integral of an exponential over a step along which w is linear.
        parts = modes.times * (np.exp(-lags[1:, None] / modes.times) - np.exp(-lags[:-1, None] / modes.times))
        total = modes.constant * (w[-1] - w[0]) + float(modes.weights @ (steps @ parts))
        assert abs(total) < 1e-9


# --- limits and laws ---------------------------------------------------------------------------------------


def test_without_relaxation_the_elastic_law_comes_back(laws):
    time = np.linspace(0.0, 1.9, 191)
    depth = triangle(time, REACH[0.5])
    elastic = laws[0.5].force(depth)
    still = Viscoelastic(ul.Prony((0.0,), (0.5,))).force(laws[0.5].force, depth, time)
    assert still == pytest.approx(elastic, rel=1e-9, abs=1e-9)
    fast = Viscoelastic(ul.Prony((0.7,), (1e-9,))).force(laws[0.5].force, depth, time)
    assert fast == pytest.approx(0.3 * elastic, rel=1e-6, abs=1e-7)
    slow = Viscoelastic(ul.Prony((0.7,), (1e9,))).force(laws[0.5].force, depth, time)
    assert slow == pytest.approx(elastic, rel=1e-6, abs=1e-7)


def test_loading_lies_between_equilibrium_and_the_elastic_law(laws):
    time = np.linspace(0.0, 4.0, 201)[1:]
    depth = REACH[0.5] * np.minimum(time, 1.0)
    force, elastic = Viscoelastic(SOLID).force(laws[0.5].force, depth, time), laws[0.5].force(depth)
    assert (force <= elastic * (1.0 + 1e-12)).all()
    assert (force >= 0.3 * elastic).all()


def test_a_ramp_on_a_half_space_is_the_beta_function():
    """P_el ~ w^(3/2), e = t^-a: P(t) = P_el(t) (3/2) B(3/2, 1 - a) t^-a."""
    law = ul.contact_law(ul.Paraboloid(1.0), ul.Layer(ul.Isotropic(1.0, 0.5)), None, max_depth=1.0)
    time = np.linspace(0.0, 1.0, 401)
    force = Viscoelastic(ul.PowerLawRelaxation(0.3)).force(law.force, 0.1 * time, time)
    exact = law.force(0.1 * time[1:]) * 1.5 * special.beta(1.5, 0.7) * time[1:] ** -0.3
    assert np.abs(force[1:] - exact)[20:].max() < 1e-6 * exact.max()


def test_a_ramp_and_hold_on_a_half_space_is_the_dawson_function():
    """P_el ~ w^(3/2), one exponential: int_0^t exp(-(t - s) / tau) d(s^(3/2)) = 3/2 tau (sqrt t - sqrt tau D(x)).

    With D the function of Dawson and x = sqrt(t / tau), by parts (Abramowitz and Stegun 1964, chapter 7); the hold
    takes what the ramp has left down by exp(-t / tau).
    """
    law = ul.contact_law(ul.Paraboloid(1.0), ul.Layer(ul.Isotropic(1.0, 0.5)), None, max_depth=1.0)
    time = np.linspace(0.0, 3.0, 1201)
    ramp = np.minimum(time, 1.0)
    force = Viscoelastic(ul.Prony((0.7,), (0.5,))).force(law.force, 0.1 * ramp, time)
    past = 1.5 * 0.5 * (np.sqrt(ramp) - np.sqrt(0.5) * special.dawsn(np.sqrt(ramp / 0.5)))
    exact = float(law.force(0.1)) * (0.3 * ramp**1.5 + 0.7 * past * np.exp(-(time - ramp) / 0.5))
    # Quadratic steps: the bend of s^(3/2) next to first contact leaves some (step / time)^(5/2) of the force.
    assert np.abs(force - exact).max() < 400.0**-2.5 * exact.max()


@pytest.mark.parametrize(
    ("indenter", "thickness"),
    [(ul.Cone(np.radians(60.0)), 1.0), (ul.Paraboloid(1.0), 0.3), (ul.Sphere(2.0), 3.0)],
)
def test_contact_ends_when_it_does_for_every_tip_and_thickness(indenter, thickness):
    """The equal radius follows from the motion alone, so all lose contact between the same two points."""
    layer = ul.Layer(ul.Isotropic(1.0, 0.4), thickness)
    law = ul.contact_law(indenter, layer, ul.RIGID, max_depth=0.2)
    time = np.linspace(0.0, 1.9, 1901)
    force = Viscoelastic(SOLID).force(law.force, triangle(time, 0.2), time)
    assert force[1836] > 0.0
    assert not force[1837:].any()


def test_two_joined_ramps_are_one(laws):
    time = np.linspace(0.0, 1.0, 201)
    joined = np.sort(np.append(time, 0.4321))
    whole = Viscoelastic(SOLID).force(laws[0.5].force, REACH[0.5] * time, time)
    parts = Viscoelastic(SOLID).force(laws[0.5].force, REACH[0.5] * joined, joined)
    assert parts[joined != 0.4321] == pytest.approx(whole, rel=1e-7, abs=1e-12)


def test_a_cycle_takes_energy(laws):
    time = np.linspace(0.0, 2.5, 501)
    depth = triangle(time, REACH[0.5])
    for relaxation in (SOLID, ul.Prony((0.2, 0.2), (0.05, 5.0)), ul.PowerLawRelaxation(0.2)):
        force = Viscoelastic(relaxation).force(laws[0.5].force, depth, time)
        assert integrate.trapezoid(force, depth) > 0.0


def test_force_is_linear_in_the_elastic_force(laws):
    """What derivatives of a fit rely on, for all three constructions."""
    time = np.linspace(0.0, 3.4, 171)
    motions = (
        REACH[0.5] * np.minimum(time, 1.0),
        triangle(time, REACH[0.5]),
        REACH[0.5] * np.interp(time, (0.0, 1.0, 1.3, 2.2, 3.4), (0.0, 0.7, 0.3, 0.9, 0.1)),
    )
    law = laws[0.5]
    for depth in motions:
        through = Viscoelastic(SOLID).prepared(depth, time)
        both = through(lambda x: 2.0 * law.force(x) - 0.3 * law.stiffness(x))
        apart = 2.0 * through(law.force) - 0.3 * through(law.stiffness)
        assert both == pytest.approx(apart, rel=1e-10, abs=1e-10)


def test_a_punch_relaxes_as_its_material():
    """A flat punch: P = k int e(t - s) dw, and a sudden step relaxes as e(t)."""
    punch = elastic_law(0.5, ul.FlatPunch(1.0))
    time = np.linspace(0.0, 2.0, 101)
    force = Viscoelastic(SOLID).force(punch.force, np.full(101, 0.2), time)
    assert force == pytest.approx(punch.force(0.2) * SOLID.modulus(time), rel=1e-10)


def test_contact_shrinks_back_through_a_sudden_step(laws):
    """A record that begins in contact and is withdrawn: as the same motion after a very fast ramp."""
    law, time = laws[0.5], np.linspace(0.0, 1.0, 201)
    depth = 0.5 * np.minimum(1.0, 1.8 - 2.0 * time)
    for relaxation in (SOLID, ul.Prony((0.5, 0.3), (0.1, 2.0))):
        memory = Viscoelastic(relaxation)
        sudden = memory.force(law.force, depth, time)
        fast = memory.force(law.force, np.append(0.0, depth), np.append(-1e-5, time))[1:]
        assert sudden == pytest.approx(fast, rel=1e-4, abs=1e-4 * sudden.max())
        # While the tip rests the force is that of the relaxed modulus, and then it falls to nothing in time.
        assert sudden[:81] == pytest.approx(law.force(0.5) * relaxation.modulus(time[:81]), rel=1e-6)
        assert (np.diff(sudden) <= 1e-12).all()
        assert sudden[100] > 0.1 * sudden[0]
        assert sudden[-1] == 0.0


# --- scenes ------------------------------------------------------------------------------------------------

SCENE = ul.Scene(
    ul.Sphere(1e-3),
    ul.Layer(ul.Isotropic(1e6, 0.5), 1e-3, relaxation=ul.Prony((0.4, 0.3), (0.2, 3.0))),
    ul.RIGID,
)
TIME = np.linspace(0.0, 12.0, 401)
DEPTH = np.interp(TIME, (0.0, 0.5, 8.5, 9.5, 12.0), (-1e-5, 1e-4, 1e-4, -1e-5, -1e-5))


def test_scene_file_holds_the_relaxation(tmp_path):
    for relaxation in (SCENE.layer.relaxation, ul.PowerLawRelaxation(0.2, 3.0), None):
        scene = replace(SCENE, layer=replace(SCENE.layer, relaxation=relaxation))
        assert ul.load_scene(scene.save(tmp_path / "scene.toml")) == scene
    assert SCENE.parameters["layer.relaxation.times[1]"] == 3.0
    assert SCENE.with_values({"layer.relaxation.fractions[0]": 0.1}).layer.relaxation.fractions == (0.1, 0.3)
    with pytest.raises(ul.ParameterError, match=r"layer.relaxation.times\[0\]"):
        SCENE.with_values({"layer.relaxation.time[0]": 1.0})


@pytest.mark.parametrize(
    ("section", "said"),
    [
        (
            'model = "maxwell"',
            r"\[layer.relaxation\] model: 'maxwell' is not known; allowed: power_law, prony",
        ),
        (
            'model = "prony"\nfractions = [0.7, 1]\ntimes = ["1 s", "2 s"]',
            r"\[layer.relaxation\] .* add up to 1.7",
        ),
        ('model = "prony"\nfractions = [0.7]', r"\[layer.relaxation\] needs 'times'"),
        ('model = "prony"\nfractions = [0.7]\ntimes = ["1 mm"]', r"\[layer.relaxation\] times"),
        (
            'model = "prony"\nfractions = [0.7]\ntimes = ["1 s"]\nE = "1 Pa"',
            r"\[layer.relaxation\] has no 'E'",
        ),
    ],
)
def test_bad_sections_are_named(tmp_path, section, said):
    path = tmp_path / "scene.toml"
    text = (
        '[indenter]\nshape = "sphere"\nradius = "1 mm"\n[layer]\nE = "1 MPa"\nnu = 0.5\nthickness = "1 mm"\n'
    )
    path.write_text(f"{text}[layer.relaxation]\n{section}\n[substrate]\nrigid = true\n", encoding="utf-8")
    with pytest.raises(ul.InputError, match=said) as told:
        ul.load_scene(path)
    assert "\n" not in str(told.value)


def test_a_base_a_thousand_times_stiffer_is_as_good_as_rigid():
    stiff = replace(SCENE, substrate=ul.Isotropic(1.3e9, 0.3))
    assert stiff.force(DEPTH, TIME) == pytest.approx(SCENE.force(DEPTH, TIME), rel=0.01, abs=1e-6)
    # The ledger says by how much it is not.
    size = stiff.effects(1e-4).set_index("effect").loc["substrate compliance", "size_percent"]
    assert -1.0 < size < 0.0
    # A half-space has no base that could age.
    assert not replace(SCENE, layer=replace(SCENE.layer, thickness=np.inf), substrate=None).ages


def test_ledger_tells_what_relaxes():
    ledger = SCENE.effects(1e-4).set_index("effect")
    assert ledger.loc["relaxation", "simulated"]
    assert -70.0 < ledger.loc["relaxation", "size_percent"] < -30.0
    assert "relaxation of shear alone" not in ledger.index
    soft = replace(SCENE, layer=replace(SCENE.layer, material=ul.Isotropic(1e6, 0.45)))
    assumed = soft.effects(1e-4).set_index("effect").loc["relaxation of shear alone"]
    # G falls to 0.3 of itself: nu rises to 0.485.
    assert not assumed.simulated
    assert pytest.approx(float(assumed.note.split("rose to ")[1][:5]), abs=1e-9) == 0.485
    assert assumed.size_percent > 5.0


def test_mistakes_about_time_are_named():
    with pytest.raises(ul.InputError, match=r"pass time \(s\)"):
        SCENE.force(DEPTH)
    with pytest.raises(ul.InputError, match="must increase"):
        SCENE.force(DEPTH, TIME[::-1])
    with pytest.raises(ul.InputError, match="not both"):
        replace(SCENE, history=Viscoelastic(SOLID))
    with pytest.raises(ul.InputError, match="depth first"):
        replace(SCENE, instrument=ul.Instrument(compliance=1e-6))
    free = {"layer.E": (1e4, 1e8), "layer.relaxation.times[1]": (1e-2, 1e3)}
    curve = ul.simulate(SCENE, DEPTH, TIME)
    with pytest.raises(ul.CurveError, match="times of its points"):
        ul.Problem(SCENE, ul.Curve(curve.depth, curve.force), free)
    with pytest.raises(ul.ParameterError, match=r"this record tells times from its sampling, 0\.03 s"):
        ul.Problem(SCENE.with_values({"layer.relaxation.times[1]": 30.0}), curve, free)


class Sticky(ScaledLaw):
    """A law that holds on below its first contact."""

    @property
    def domain(self):
        return -1e-6, self.max_depth


def test_adhesion_is_refused(laws):
    with pytest.raises(ul.InputError, match="without adhesion"):
        Remembered(Sticky.of(laws[0.5], 1.0, 1.0, 1.0), Viscoelastic(SOLID))


# --- fits --------------------------------------------------------------------------------------------------

FREE = {
    "layer.E": (1e4, 1e8),
    "layer.thickness": (2e-4, 5e-3),
    "instrument.contact_depth": (-2e-5, 2e-5),
    "layer.relaxation.fractions[0]": (0.0, 1.0),
    "layer.relaxation.fractions[1]": (0.0, 1.0),
    "layer.relaxation.times[0]": (1e-2, 10.0),
    "layer.relaxation.times[1]": (1e-2, 12.0),
}


def test_loading_hold_and_unloading_are_fitted_together():
    curve = ul.synthesize(SCENE, DEPTH, ul.Noise(force=2e-4), rng=1, time=TIME)
    start = SCENE.with_values(
        {"layer.E": 4e5, "layer.thickness": 8e-4}
        | {"layer.relaxation.times[0]": 0.5, "layer.relaxation.times[1]": 5.0}
        | {"layer.relaxation.fractions[0]": 0.3, "layer.relaxation.fractions[1]": 0.2}
    )
    problem = ul.Problem(start, curve, FREE, noise=ul.Noise(force=2e-4))
    # Derivatives against differences of the force itself.
    member, vector = problem.members[0], problem.start
    _, columns = member.jacobian(problem.physical(vector))
    for entry, slope in enumerate(problem.slopes(vector)):
        step = 1e-5 * np.eye(len(vector))[entry]
        up, down = (member.model(problem.physical(vector + sign * step)) for sign in (1, -1))
        difference = (up - down) / 2e-5
        # The way in is bent at the contact, where the reading of a point jumps by one step of it.
        tolerance = 1e-3 if problem.names[entry] == "instrument.contact_depth" else 1e-6
        assert np.abs(columns[:, entry] * slope - difference).max() < tolerance * np.abs(difference).max()
    fit = ul.fit(problem)
    for name in FREE:
        assert abs(fit.values[name] - SCENE.parameters[name]) < 4.0 * fit.stderr[name], name
    assert fit.stderr["layer.relaxation.times[1]"] < 0.2
    assert "layer.relaxation.times[0]" in fit.report()
    drawn = plots.fit_in_time(fit).lines[1].get_ydata()
    assert drawn.max() == pytest.approx(1e3 * SCENE.force(DEPTH, TIME).max(), rel=0.01)
    panel = plots.relaxation(fit)
    assert panel.lines[0].get_ydata()[-1] == pytest.approx(0.3, rel=0.2)
    assert panel.collections, "the band"
    plt.close("all")


def test_power_law_is_fitted():
    relaxing = replace(SCENE.layer, relaxation=ul.PowerLawRelaxation(0.25))
    scene = replace(SCENE, layer=relaxing)
    time = TIME[::2]
    depth = np.interp(time, (0.0, 2.0, 12.0), (-1e-5, 1e-4, 1e-4))
    curve = ul.synthesize(scene, depth, ul.Noise(force=2e-4), rng=1, time=time)
    names = ("layer.E", "layer.relaxation.exponent", "instrument.contact_depth")
    bounds = ((1e4, 1e8), (0.01, 0.7), (-2e-5, 2e-5))
    start = scene.with_values({"layer.E": 4e5, "layer.relaxation.exponent": 0.1})
    fit = ul.fit(ul.Problem(start, curve, dict(zip(names, bounds, strict=True)), ul.Noise(force=2e-4)))
    for name in names:
        assert abs(fit.values[name] - scene.parameters[name]) < 4.0 * fit.stderr[name], name


def test_equilibrium_modulus_follows_draw_by_draw():
    curve = ul.simulate(SCENE, DEPTH, TIME)
    free = ("layer.E", "layer.relaxation.fractions[1]")
    problem = ul.Problem(SCENE, curve, free, ul.Noise(force=1e-4))
    draws = np.array([[1e6, 0.3], [2e6, 0.1]])
    assert derived_quantities(problem, draws)["layer.equilibrium_modulus"] == pytest.approx(
        [3e5, 1e6], rel=1e-12
    )

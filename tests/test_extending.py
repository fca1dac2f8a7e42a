"""The house takes additions from outside: an indenter, a material, a law of one's own, a noise, a sampler, ...

Each class or record below is all that its file would hold; the README says where the file goes.
"""

from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy import stats

import underlay as ul
from underlay.data.export import curve_csv
from underlay.data.readers._format import make_curve
from underlay.data.readers._text import lines_of
from underlay.mechanics.body import transversely_isotropic_constants
from underlay.mechanics.published.correction import LAYER_NU, MeasuredError, PolynomialFactor
from underlay.report import tables as fit_tables
from underlay.report.labels import label
from underlay.scene.effects import effects_table

# --- an indenter -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hyperboloid(ul.Indenter):
    """A worn cone, Phi = cot(half_angle) (sqrt(r^2 + b^2) - b), b = tip_radius cot(half_angle)."""

    shape: ClassVar[str] = "hyperboloid"

    half_angle: float
    tip_radius: float

    @property
    def slope(self):
        return 1.0 / np.tan(self.half_angle)

    @property
    def length(self):
        return self.tip_radius * self.slope

    @property
    def max_radius(self):
        return 50.0 * self.tip_radius  # where the shank begins

    def surface(self, radius):
        return self.slope * radius**2 / (np.sqrt(radius**2 + self.length**2) + self.length)

    def abel(self, radius):
        # r int_0^r s ds / (sqrt(s^2 + b^2) sqrt(r^2 - s^2)) = r arctan(r/b)
        return self.slope * radius * np.arctan(radius / self.length)

    def abel_slope(self, radius):
        x = radius / self.length
        return self.slope * (np.arctan(x) + x / (1.0 + x * x))

    def abel_moments(self, radius):
        b, x = self.length, radius / self.length
        first = 0.5 * ((1.0 + x * x) * np.arctan(x) - x)
        second = 0.25 * ((x**4 - 1.0) * np.arctan(x) + x - x**3 / 3.0)
        return self.slope * b**2 * first, self.slope * b**4 * second

    def halfspace_radius(self, depth):
        # arctan(x) >= x/(1+x): depth >= slope r^2/(r + b), which bounds r from above.
        high = 0.5 * (depth + np.sqrt(depth**2 + 4.0 * self.slope * depth * self.length)) / self.slope
        low = np.zeros_like(depth)
        for _ in range(200):
            middle = 0.5 * (low + high)
            short = self.abel(middle) < depth
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return 0.5 * (low + high)


WORN = Hyperboloid(half_angle=np.deg2rad(70.0), tip_radius=5e-6)


# Gauss-Legendre: the integrands are analytic within a distance of the order of the interval.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(80)


def test_indenter_meets_the_laws_every_indenter_must():
    for a in (1e-7, 2e-6, 5e-5):
        # H(a) = a int_0^(pi/2) Phi'(a sin t) dt
        s = a * np.sin(0.25 * np.pi * (1.0 + NODES))
        expected = 0.25 * np.pi * a * float(WEIGHTS @ (WORN.slope * s / np.hypot(s, WORN.length)))
        assert float(WORN.abel(a)) == pytest.approx(expected, rel=1e-9)
        step = 1e-4 * a
        central = (WORN.abel(a + step) - WORN.abel(a - step)) / (2 * step)
        assert float(WORN.abel_slope(a)) == pytest.approx(float(central), rel=1e-7)
        first, second = WORN.abel_moments(np.array([a]))
        r = 0.5 * a * (1.0 + NODES)
        assert first[0] == pytest.approx(0.5 * a * float(WEIGHTS @ WORN.abel(r)), rel=1e-9)
        assert second[0] == pytest.approx(0.5 * a * float(WEIGHTS @ (WORN.abel(r) * r**2)), rel=1e-9)
        assert WORN.halfspace_radius(WORN.abel(np.array([a])))[0] == pytest.approx(a, rel=1e-12)


def test_indenter_works_everywhere(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        '[indenter]\nshape = "hyperboloid"\nhalf_angle = "70 deg"\ntip_radius = "5 um"\n'
        '[layer]\nE = "10 kPa"\nnu = 0.5\nthickness = "10 um"\n[substrate]\nrigid = true\n'
    )
    scene = ul.load_scene(path)
    assert isinstance(scene.indenter, Hyperboloid)
    scene.save(path)
    assert ul.load_scene(path) == scene
    depth = np.linspace(-1e-6, 3e-6, 200)
    curve = ul.synthesize(scene, depth, noise=ul.Noise(force=1e-11), rng=0)
    fit = ul.fit(ul.Problem(scene, curve, free={"layer.E": (1e2, 1e6), "indenter.tip_radius": (2e-7, 5e-5)}))
    for name, true in (("layer.E", 1e4), ("indenter.tip_radius", 5e-6)):
        assert abs(fit.values[name] - true) < 4.0 * fit.stderr[name]
    # dP/dw = 4 theta a kappa_inf(a/h) for every shape, kappa_inf the flat punch's: it tests the new shape.
    law = scene.contact_law(3e-6, solver="exact")
    radius = float(law.contact_radius(2e-6))
    punch = ul.contact_law(ul.FlatPunch(radius), scene.layer, ul.RIGID, max_depth=1e-6, solver="exact")
    assert float(law.stiffness(2e-6)) == pytest.approx(float(punch.stiffness(1e-6)), rel=1e-4)
    ul.plots.save(ul.plots.scene(scene, depth=3e-6), tmp_path / "scene.png")


class Round(Hyperboloid):
    """The same, and it says that it is round and smooth."""

    shape: ClassVar[str] = ""
    smooth: ClassVar[bool] = True

    @property
    def curvature_radius(self):
        return self.tip_radius


def test_round_indenter_is_treated_as_spheres_are(tmp_path):
    tip, layer = Round(WORN.half_angle, WORN.tip_radius), ul.Layer(ul.Isotropic(1e4, 0.5), 1e-5)
    scene = ul.Scene(tip, layer, ul.RIGID)
    exact = scene.contact_law(1e-6, solver="exact")
    # A tip that says less is solved in another measure of depth, with more nodes: to the same law.
    plain = ul.Scene(WORN, layer, ul.RIGID).contact_law(1e-6, solver="exact")
    w = np.linspace(1e-8, 1e-6, 50)
    assert exact.force(w) == pytest.approx(plain.force(w), rel=2e-6)
    # Near the apex it presses as the paraboloid of its curvature, stuck or not; friction adds force.
    ball = ul.Scene(ul.Paraboloid(tip.curvature_radius), layer, ul.RIGID)
    for friction in ("none", "stuck"):
        laws = [replace(one, friction=friction).contact_law(1e-6) for one in (scene, ball)]
        shallow, deep = ([float(law.force(at)) for law in laws] for at in (1e-10, 1e-6))
        assert shallow[0] == pytest.approx(shallow[1], rel=1e-3)
        assert deep[0] > 1.03 * deep[1]  # blunter than its paraboloid further out
    assert laws[0].force(1e-6) > exact.force(1e-6)
    assert laws[0].error_estimate < 1e-5
    # What the literature says of spheres holds for it; DMT too.
    published, of_ball = (one.contact_law(1e-6, solver="garcia2018") for one in (scene, ball))
    assert published.force(w) == pytest.approx(of_ball.force(w), rel=1e-12)
    assert published.error_estimate > of_ball.error_estimate + 0.05
    dmt = replace(scene, adhesion=ul.DMT(work=1e-3)).contact_law(1e-6)
    assert dmt.pull_off_force == pytest.approx(2.0 * np.pi * tip.tip_radius * 1e-3, rel=1e-6)
    # A fit reads its laws off tables, its curve is judged, its test is drawn.
    curve = ul.synthesize(scene, np.linspace(-3e-7, 1e-6, 200), noise=ul.Noise(force=1e-12), rng=0)
    free = {"layer.E": (1e2, 1e6), "layer.thickness": (1e-6, 1e-4)}
    fit = ul.fit(ul.Problem(scene, curve, free=free, solver="exact"))
    for name, true in (("layer.E", 1e4), ("layer.thickness", 1e-5)):
        assert abs(fit.values[name] - true) < 4.0 * fit.stderr[name]
    assert "in tables of flat punches" in fit.law_reason
    assert ul.check_quality(curve, scene).verdict == "good"
    ul.plots.save(ul.plots.scene(scene, depth=1e-6), tmp_path / "scene.png")
    effects = scene.effects(1e-6, solver="exact").set_index("effect")
    against = float(exact.force(1e-6) / ball.contact_law(1e-6, solver="exact").force(1e-6)) - 1.0
    assert effects.loc["true sphere", "size_percent"] == pytest.approx(100.0 * against, abs=1e-3)


class Endless(Hyperboloid):
    """The same without an end, and without a name: scene files do not know it."""

    shape: ClassVar[str] = ""

    @property
    def max_radius(self):
        return np.inf


def test_indenter_without_an_end_is_refused_where_the_exact_law_needs_one():
    endless = Endless(WORN.half_angle, WORN.tip_radius)
    layer = ul.Layer(ul.Isotropic(1e4, 0.5), 1e-5)
    with pytest.raises(ul.InputError, match=r"Endless\.max_radius is inf.*finite max_radius \(m\)"):
        ul.contact_law(endless, layer, ul.RIGID, max_depth=3e-6, solver="exact")
    scene = ul.Scene(WORN, layer, ul.RIGID)
    curve = ul.synthesize(scene, np.linspace(-1e-6, 3e-6, 50), noise=ul.Noise(force=1e-11), rng=0)
    with pytest.raises(ul.FitError, match="no contact law at the start of the fit: Endless"):
        ul.fit(ul.Problem(replace(scene, indenter=endless), curve, free={"layer.E": (1e2, 1e6)}))
    # Where nothing has to be solved it needs no end.
    bare = ul.contact_law(endless, ul.Layer(ul.Isotropic(1e4, 0.5)), max_depth=3e-6)
    assert bare.method == "halfspace"


# --- a material ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fibrous(ul.Material):
    """Stiffer along the axis by one ratio, in tension and in shear."""

    E: float = field(metadata=ul.quantity("pressure", "{part} modulus", bounds=(0.0, np.inf), scales="force"))
    nu: float = field(metadata=ul.quantity("dimensionless", "Poisson's ratio", bounds=(-1.0, 0.5)))
    ratio: float = field(metadata=ul.quantity("dimensionless", "stiffening by fibres", bounds=(0.0, np.inf)))

    @staticmethod
    def constants_of(*, E, nu, ratio):
        return transversely_isotropic_constants(E, ratio * E, nu, nu, 0.5 * ratio * E / (1.0 + nu))

    @property
    def plane_constants(self):
        return self.constants_of(E=self.E, nu=self.nu, ratio=self.ratio)

    @property
    def in_plane(self):
        return ul.Isotropic(self.E, self.nu)


def test_material_is_computed_fitted_and_drawn(tmp_path):
    known = ul.TransverselyIsotropic(E=1e5, E_axial=2e5, nu=0.3, nu_axial=0.3, G_axial=1e5 / 1.3)
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(Fibrous(1e5, 0.3, 2.0), 1e-4), ul.RIGID)
    same = replace(scene, layer=ul.Layer(known, 1e-4))
    depth = np.linspace(-1e-6, 5e-6, 60)
    assert scene.force(depth) == pytest.approx(same.force(depth), rel=1e-9)
    curve = ul.synthesize(same, depth, ul.Noise(force=1e-6), rng=3)
    free = {"layer.E": (1e3, 1e7), "layer.ratio": ul.Normal(2.0, 0.1)}
    fit = ul.fit(ul.Problem(scene, curve, free, ul.Noise(force=1e-6)))
    for name, true in (("layer.E", 1e5), ("layer.ratio", 2.0)):
        assert abs(fit.values[name] - true) < 4.0 * fit.stderr[name]
    ledger = scene.effects(5e-6).set_index("effect").loc["anisotropy"]
    assert ledger["simulated"]
    assert ledger["size_percent"] > 1.0
    ul.plots.save(ul.plots.scene(scene, depth=5e-6), tmp_path / "scene.png")
    with pytest.raises(ul.InputError, match="material"):
        ul.Layer("gel", 1e-4)


# --- a published correction ------------------------------------------------------------------------------

FIRST_ORDER = ul.PublishedCorrection(
    name="first-order",
    indenter="sphere",
    substrate="rigid, layer bonded",
    equation="P/P_Hertz = 1 + (2 a_0/pi) x, x = sqrt(R d)/h",
    valid_range=(0.0, 0.1),
    range_basis="measured against the exact contact law",
    nu_range=(0.5, 0.5),
    assumptions=("linear elasticity, no friction under the tip",),
    source="the first order of Argatov & Sabina's expansion, as an example",
    doi=None,
    # The force of order one: 1 + (2 a_0/pi) X, a_0 of a rigid base at nu = 0.5.
    factor=lambda contact: PolynomialFactor((1.0, 2.0 * 1.77021677337 / np.pi)),  # noqa: ARG005
    measured_error=MeasuredError.from_table((LAYER_NU,), "\n 0.05 0.1\n0.5 0.4 1.6"),
)


def test_correction_works_everywhere():
    layer = ul.Layer(ul.Isotropic(1e4, 0.5), 1e-5)
    given = {"max_depth": 1e-8, "solver": FIRST_ORDER}
    law = ul.contact_law(ul.Paraboloid(5e-6), layer, ul.RIGID, **given)
    exact = ul.contact_law(ul.Paraboloid(5e-6), layer, ul.RIGID, max_depth=1e-8, solver="exact")
    assert law.method == "first-order"
    measured = abs(float(law.force(1e-8) / exact.force(1e-8)) - 1.0)
    assert measured <= law.error_estimate
    scene = ul.Scene(ul.Paraboloid(5e-6), layer, ul.RIGID)
    assert scene.force(1e-8, solver=FIRST_ORDER) == law.force(1e-8)
    with pytest.raises(ul.InputError, match="first-order needs a sphere"):
        ul.contact_law(ul.Cone.berkovich(), layer, ul.RIGID, **given)


def test_correction_is_fitted():
    scene = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(1e4, 0.5), 1e-5), ul.RIGID)
    curve = ul.synthesize(scene, np.linspace(-1e-8, 5e-8, 60), ul.Noise(force=1e-13), rng=0)
    fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e2, 1e6)}, solver=FIRST_ORDER))
    assert abs(fit.values["layer.E"] / 1e4 - 1.0) < 0.02
    assert fit.statistics.law_method == "first-order"


# --- a contact law of one's own ----------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class WinklerLaw(ul.ContactLaw):
    """A paraboloid on a bed of springs of the layer's confined stiffness: P = pi R k w^2."""

    bed: float
    radius: float

    @property
    def _beyond(self):
        return "ask for less depth, or build it for more"

    def _force(self, depth):
        return np.pi * self.radius * self.bed * depth**2

    def _contact_radius(self, depth):
        return np.sqrt(2.0 * self.radius * depth)

    def _stiffness(self, depth):
        return 2.0 * np.pi * self.radius * self.bed * depth


@dataclass(frozen=True)
class Winkler(ul.Solver):
    """Layers so thin that each column stands alone."""

    def build(self, contact, max_depth):
        E, nu = contact.isotropic.layer.E, contact.isotropic.layer.nu
        confined = E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
        return WinklerLaw(
            method="winkler",
            reason="asked for",
            max_depth=max_depth,
            error_estimate=0.1,
            bed=confined / contact.thickness,
            radius=contact.indenter.radius,
        )


THIN = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e5, 0.3), 1e-5), ul.RIGID)
THIN_CURVE = ul.synthesize(THIN, np.linspace(-2e-7, 1e-6, 80), ul.Noise(force=1e-7), rng=1, solver=Winkler())
FREE = {"layer.E": (1e3, 1e7), "instrument.contact_depth": (-1e-7, 1e-7)}


class Builder:
    """The same from an object that is no `Solver`."""

    def build(self, contact, max_depth):
        return Winkler().build(contact, max_depth)


@pytest.mark.parametrize("solver", [Winkler(), Builder()], ids=["Solver", "any object"])
def test_law_is_fitted(solver):
    fit = ul.fit(ul.Problem(THIN, THIN_CURVE, FREE, ul.Noise(force=1e-7), solver=solver))
    assert fit.statistics.law_method == "winkler"
    for name, true in (("layer.E", 1e5), ("instrument.contact_depth", 0.0)):
        assert abs(fit.values[name] - true) < 4.0 * fit.stderr[name]
    # P = pi R M w^2 / h is linear in E: the standard error is that of a straight line through the origin.
    columns = np.column_stack(
        [
            THIN.force(THIN_CURVE.depth, solver=solver) / 1e5,
            -THIN.contact_law(1e-6, solver=solver).stiffness(THIN_CURVE.depth),
        ]
    )
    covariance = np.linalg.inv(columns.T @ columns) * 1e-14
    assert fit.stderr["layer.E"] == pytest.approx(np.sqrt(covariance[0, 0]), rel=0.02)


def test_law_is_sampled_mapped_and_compared():
    problem = ul.Problem(THIN, THIN_CURVE, FREE, ul.Noise(force=1e-7), solver=Winkler())
    fit = ul.fit(problem)
    posterior = ul.sample(problem, walkers=16, max_steps=2000, rng=0)
    mean = posterior.summary().loc["layer.E"]
    assert abs(float(mean["median"]) - fit.values["layer.E"]) < fit.stderr["layer.E"]
    options = ul.MapOptions(noise=ul.Noise(force=1e-7), solver=Winkler())
    table = ul.fit_many([THIN_CURVE], THIN, FREE, workers=0, options=options)
    assert table.loc[0, "layer.E"] == pytest.approx(fit.values["layer.E"], rel=1e-6)
    assert table.loc[0, "law"] == "winkler"
    found = ul.compare(problem, [Winkler(), "exact"])
    # Both explain the curve equally well: then the exact one is named first.
    assert found.order == ("exact", "Winkler")
    assert all(fit.statistics.reduced_chi_square < 1.3 for fit in found.fits.values())


# --- solvers and laws that misbehave -----------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class BrokenLaw(WinklerLaw):
    """Fails in one of three ways beyond a depth."""

    how: str
    from_depth: float

    def _force(self, depth):
        force = super()._force(depth)
        if self.how == "nan":
            return np.where(depth > self.from_depth, np.nan, force)
        if self.how == "shape" and (depth > self.from_depth).any():
            return force[:-1]
        if self.how == "raise" and (depth > self.from_depth).any():
            raise ZeroDivisionError("no such column")
        return force


@dataclass(frozen=True)
class Broken(ul.Solver):
    """Builds such a law, or none."""

    how: str

    def build(self, contact, max_depth):
        if self.how == "unbuilt":
            return contact.theta[0]
        if self.how == "no law":
            return contact.theta
        bare = Winkler().build(contact, max_depth)
        own = {field.name: getattr(bare, field.name) for field in fields(bare)}
        return BrokenLaw(**own, how=self.how, from_depth=6e-7)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("nan", r"winkler \(BrokenLaw.force\) at depth 7.5e-07 m: answered with NaN"),
        ("shape", r"winkler \(BrokenLaw.force\) at depth 7.5e-07 m: answered with shape \(3,\)"),
        ("raise", r"winkler \(BrokenLaw.force\) at depth 7.5e-07 m: ZeroDivisionError: no such column"),
        ("unbuilt", r"the solver Broken failed for depths up to 1e-06 m: TypeError"),
        ("no law", r"the solver Broken must build a ContactLaw; for depths up to 1e-06 m it gave"),
    ],
)
def test_what_misbehaves_is_named_with_the_depth(how, message):
    depth = np.array([2.5e-7, 5e-7, 7.5e-7, 1e-6])
    with pytest.raises(ul.LawError, match=message):
        THIN.force(depth, solver=Broken(how))
    # In a fit too: it is an error of the law, not a place without one.
    with pytest.raises(ul.LawError, match="Broken"):
        ul.fit(ul.Problem(THIN, THIN_CURVE, FREE, ul.Noise(force=1e-7), solver=Broken(how)))


def test_a_solver_that_cannot_be_kept_by_is_refused():
    @dataclass
    class Loose(ul.Solver):
        number: float = 1.0

        def build(self, contact, max_depth):
            return Winkler().build(contact, max_depth)

    with pytest.raises(ul.InputError, match="Loose must be hashable"):
        ul.Problem(THIN, THIN_CURVE, FREE, solver=Loose())


# --- a reader --------------------------------------------------------------------------------------------


def _read_pipes(source, options):
    del options
    rows = [line.split("|") for line in lines_of(source)[1:]]
    depth, force = (np.array([float(row[column]) for row in rows]) for column in (0, 1))
    return [make_curve(source, depth * 1e-6, force * 1e-3, name=source.path.stem)]


PIPES = ul.Format(
    name="pipes",
    description="depth in um and force in mN between pipes, as an example",
    sniff=lambda source: source.head(16).startswith("PIPES"),
    read_all=_read_pipes,
)


def test_reader_works(tmp_path):
    path = tmp_path / "curve.pip"
    path.write_text("PIPES 1\n" + "\n".join(f"{d}|{0.1 * d}" for d in range(20)))
    curve = ul.read(path, format=PIPES)
    assert curve.depth[-1] == pytest.approx(19e-6)
    assert curve.force[-1] == pytest.approx(1.9e-3)
    assert curve.metadata["format"] == "pipes"
    assert len(curve.metadata["sha256"]) == 64


# --- a response with memory ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Maxwell(ul.History):
    """A spring and a dashpot in series: P(t) = int exp(-(t - s)/time) dP_el(w(s))."""

    model: ClassVar[str] = "maxwell"

    time: float = field(
        metadata=ul.quantity("time", "relaxation time of the sample", symbol=r"\tau", bounds=(0.0, np.inf))
    )

    def force(self, elastic, depth, time):
        load, x = elastic(depth), np.diff(time) / self.time
        force = np.array(load)
        for n, step in enumerate(np.diff(load) * -np.expm1(-x) / x):
            force[n + 1] = force[n] * np.exp(-x[n]) + step
        return force


RELAXING = ul.Scene(
    ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e5, 0.45), 1e-3), ul.RIGID, history=Maxwell(time=0.5)
)
CLOCK = np.linspace(0.0, 3.0, 241)
RAMP_AND_HOLD = np.minimum(6e-5 * CLOCK, 5e-5) - 1e-5


def test_memory_keeps_to_its_laws():
    elastic = replace(RELAXING, history=None).force(RAMP_AND_HOLD)
    slow = replace(RELAXING, history=Maxwell(time=1e9)).force(RAMP_AND_HOLD, CLOCK)
    assert slow == pytest.approx(elastic, rel=1e-8, abs=1e-12)
    # Over the hold the force decays by itself.
    held = RAMP_AND_HOLD.max() == RAMP_AND_HOLD
    force = RELAXING.force(RAMP_AND_HOLD, CLOCK)[held]
    assert force == pytest.approx(force[0] * np.exp(-(CLOCK[held] - CLOCK[held][0]) / 0.5), rel=1e-12)
    with pytest.raises(ul.InputError, match=r"pass time \(s\)"):
        RELAXING.force(RAMP_AND_HOLD)


def test_memory_is_fitted_to_a_curve_with_time():
    curve = ul.synthesize(RELAXING, RAMP_AND_HOLD, ul.Noise(force=2e-6), rng=4, time=CLOCK)
    assert curve.truth["history.time"] == 0.5
    start = RELAXING.with_values({"history.time": 2.0, "layer.E": 3e4})
    free = {"layer.E": (1e3, 1e7), "history.time": (1e-2, 1e2), "instrument.contact_depth": (-2e-5, 2e-5)}
    problem = ul.Problem(start, curve, free)
    # Derivatives go through the history; the test takes them from the force itself.
    vector = problem.vector({"history.time": 0.4, "layer.E": 9e4, "instrument.contact_depth": 1e-6})
    _, columns = problem.members[0].jacobian(problem.physical(vector))
    for entry, slope in enumerate(problem.slopes(vector)):
        step = 1e-5 * np.eye(3)[entry]
        up, down = (problem.members[0].model(problem.physical(vector + s * step)) for s in (1, -1))
        assert columns[:, entry] * slope == pytest.approx((up - down) / 2e-5, rel=1e-4, abs=1e-8)
    fit = ul.fit(problem)
    for name, true in (("layer.E", 1e5), ("history.time", 0.5), ("instrument.contact_depth", 0.0)):
        assert abs(fit.values[name] - true) < 4.0 * fit.stderr[name] < 0.2 * max(true, 1e-4)
    assert "history.time" in fit.report()
    assert label("history.time") == "relaxation time of the sample"
    # Many vectors at once, as a sampler asks, one by one here.
    both = problem.log_likelihood(np.stack([fit.vector, vector]))
    assert both[0] > both[1]
    with pytest.raises(ul.CurveError, match="times of its points"):
        ul.Problem(start, ul.Curve(curve.depth, curve.force), free)


def test_memory_stands_in_a_scene_file_and_in_the_ledger(tmp_path):
    RELAXING.save(tmp_path / "scene.toml")
    assert ul.load_scene(tmp_path / "scene.toml") == RELAXING
    assert RELAXING.effects(5e-5).set_index("effect").loc["history", "simulated"]


# --- a noise model ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pump(ul.NoiseModel):
    """Noise that is louder from the moment a pump starts."""

    model: ClassVar[str] = "pump"
    start: ClassVar[float] = 1.0  # s

    quiet: float = field(metadata=ul.quantity("force", "noise before the pump starts", bounds=(0.0, np.inf)))
    loud: float = field(metadata=ul.quantity("force", "noise of the pump", bounds=(0.0, np.inf)))

    def sigma(self, force, stiffness=None, time=None):
        del stiffness
        return np.where(time < self.start, self.quiet, self.loud) * np.ones_like(force)


def test_noise_model_is_drawn_and_fitted():
    scene = replace(RELAXING, history=None)
    curve = ul.synthesize(scene, RAMP_AND_HOLD, Pump(2e-5, 4e-4), rng=2, time=CLOCK)
    assert curve.truth["noise.loud"] == 4e-4
    free = {"layer.E": (1e3, 1e7), "noise.loud": None}
    problem = ul.Problem(scene, curve, free, noise=Pump(2e-5, 1e-4))
    fit = ul.fit(problem)
    # The standard deviation of a standard deviation from 160 points is 6 %.
    assert fit.values["noise.loud"] == pytest.approx(4e-4, rel=0.25)
    assert 0.03 < fit.stderr["noise.loud"] / fit.values["noise.loud"] < 0.12
    assert abs(fit.values["layer.E"] - 1e5) < 4.0 * fit.stderr["layer.E"]
    assert label("noise.loud") in fit_tables.diagnostics_table(fit).to_string()
    # The same density for many vectors at once as for each alone, and as the normal distribution has it.
    vectors = np.stack([fit.vector, fit.vector + 0.1, fit.vector - 0.2])
    many = problem.log_likelihood(vectors)
    for vector, density in zip(vectors, many, strict=True):
        values = problem.values(vector)
        model = scene.with_values({"layer.E": values["layer.E"]}).force(RAMP_AND_HOLD)
        sigma = np.where(CLOCK < 1.0, 2e-5, values["noise.loud"])
        assert density == pytest.approx(stats.norm.logpdf(curve.force, model, sigma).sum(), rel=1e-5)
    with pytest.raises(ul.ParameterError, match=r"did you mean 'noise\.loud'"):
        ul.Problem(scene, curve, {"layer.E": None, "noise.laud": None}, noise=Pump(2e-5, 1e-4))


def test_noise_model_stands_in_a_scene_file(tmp_path):
    scene = replace(RELAXING, history=None)
    path, rows = scene.save(tmp_path / "scene.toml"), tmp_path / "curve.csv"
    stated = path.read_text() + (
        '\n[noise]\nmodel = "pump"\nquiet = "20 uN"\nloud = "100 uN"\n'
        '[fit]\nnoise.loud = { min = "1 uN", max = "1 N" }\n'
    )
    path.write_text(stated)
    curve = ul.synthesize(scene, RAMP_AND_HOLD, Pump(2e-5, 4e-4), rng=2, time=CLOCK)
    rows.write_text(curve_csv(curve))
    problem = ul.load_problem(rows, path)
    assert problem.noise == Pump(2e-5, 1e-4)
    assert problem.names == ("noise.loud",)
    path.write_text(stated.replace("pump", "punp"))
    with pytest.raises(ul.InputError, match=r"\[noise\] model: 'punp' is not known; allowed: gaussian, pump"):
        ul.load_scene(path)
    path.write_text(stated.replace("noise.loud", "noise.laud"))
    with pytest.raises(ul.ParameterError, match=r"did you mean 'noise\.loud'"):
        ul.load_scene(path)


# --- a sampler -------------------------------------------------------------------------------------------


def metropolis(density, begin, proposal, steps, rng):
    """Random-walk Metropolis, many chains side by side: (steps, chains, parameters)."""
    place, here = begin, density(begin)
    chain = np.empty((steps, *begin.shape))
    for step in range(steps):
        trial = place + rng.standard_normal(begin.shape) @ proposal.T
        there = density(trial)
        accepted = np.log(rng.random(len(begin))) < there - here
        place, here = np.where(accepted[:, None], trial, place), np.where(accepted, there, here)
        chain[step] = place
    return chain


def test_sampler_hands_over_its_chain():
    scene, noise = replace(THIN, layer=ul.Layer(THIN.layer.material), substrate=None), ul.Noise(force=5e-8)
    problem = ul.Problem(scene, ul.synthesize(scene, np.linspace(-2e-7, 1e-6, 30), noise, rng=1), FREE, noise)
    fit, rng = ul.fit(problem), np.random.default_rng(5)
    spread = np.linalg.cholesky(fit.scaled_covariance)
    begin = fit.vector + rng.standard_normal((24, 2)) @ spread.T
    # 2.4 / sqrt(parameters): the best step of a normal (Gelman, Roberts and Gilks 1996).
    chain = metropolis(problem.log_posterior, begin, 1.7 * spread, 1600, rng)
    posterior = ul.posterior_from_chain(problem, chain)
    assert posterior.converged
    table = posterior.summary()
    for name in FREE:
        # The noise is small enough for a normal posterior; 24 chains of some 100 tau each leave 2 % of a
        # standard deviation in the median and 1.5 % in the standard deviation.
        assert abs(table.loc[name, "median"] - fit.values[name]) < 0.1 * fit.stderr[name]
        assert posterior.of(name).std() == pytest.approx(fit.stderr[name], rel=0.08)
    # The control: chains that do not move are judged as such.
    stuck = np.broadcast_to(begin, (200, *begin.shape)) + 1e-6 * rng.standard_normal((200, *begin.shape))
    assert not ul.posterior_from_chain(problem, stuck).converged
    with pytest.raises(ul.InputError, match=r"got shape \(1600, 24\)"):
        ul.posterior_from_chain(problem, chain[..., 0])
    with pytest.raises(ul.InputError, match="no probability at step 0 of walker 0"):
        ul.posterior_from_chain(problem, chain + 50.0)


# --- an effect -------------------------------------------------------------------------------------------


def blunting(scene, law):
    """What the wear of the tip does: against the sharp cone it was."""
    del law
    if not isinstance(scene.indenter, Hyperboloid):
        return ul.Effect("blunting", None, None, simulated=False, note="the tip is not a worn cone")
    sharp = replace(scene, indenter=ul.Cone(scene.indenter.half_angle))
    return ul.Effect("blunting", scene, sharp, simulated=True, note="against a sharp cone")


def test_effect_stands_in_the_ledger():
    layer = ul.Layer(ul.Isotropic(1e4, 0.5))
    table = effects_table(ul.Scene(WORN, layer), 3e-6, further=[blunting]).set_index("effect")
    worn = float(ul.Scene(WORN, layer).force(3e-6) / ul.Scene(ul.Cone(WORN.half_angle), layer).force(3e-6))
    assert table.loc["blunting", "size_percent"] == pytest.approx(100.0 * (worn - 1.0), rel=1e-9)
    assert table.loc["blunting", "simulated"]
    other = effects_table(ul.Scene(ul.Sphere(1e-5), layer), 1e-6, further=[blunting]).set_index("effect")
    assert not other.loc["blunting", "simulated"]

"""The sampler: the distribution it yields, when it stops, and what it says when it should not be trusted."""

import os
import re
import signal
import subprocess
import sys
import textwrap
import warnings
from dataclasses import replace
from pathlib import Path

import emcee
import numpy as np
import pytest
from scipy import stats

import underlay as ul
from support.posterior_cases import (
    WHITE,
    barely_touched_problem,
    baseline_answer,
    baseline_problem,
    halfspace_curve,
    halfspace_problem,
    halfspace_scene,
)
from underlay.inference.journal import open_chain
from underlay.inference.priors import Flat
from underlay.inference.sampling import draws as drawing
from underlay.inference.sampling import run as sampling
from underlay.inference.sampling.diagnostics import (
    DETERMINED,
    UNDETERMINED,
    autocorrelation_times,
    effective_size,
)
from underlay.inference.sampling.run import moves

TESTS = Path(__file__).parent


def distance_p_value(draws, distribution):
    """Kolmogorov-Smirnov p-value of correlated draws (steps, walkers), at their effective size."""
    size = draws.size if draws.shape[1] == 1 else effective_size(draws)
    statistic = stats.kstest(draws.ravel(), distribution.cdf).statistic
    return float(stats.kstwobign.sf(statistic * np.sqrt(size)))


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """File of the chain that `plain` is."""
    return tmp_path_factory.mktemp("chain") / "a.chain"


@pytest.fixture(scope="module")
def plain(kept):
    """The posterior of the half-space: a chain that converges, kept in a file."""
    return ul.sample(halfspace_problem(), walkers=8, backend=kept, method="emcee")


# --- the distribution -------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [None, "importance", "emcee"])
def test_the_posterior_is_the_known_one_and_another_is_told_apart(method):
    posterior = ul.sample(baseline_problem(), walkers=16, method=method)
    assert posterior.converged
    draws = posterior.of("instrument.baseline")
    if method != "emcee":
        # Several of each weighted draw: as many as these are worth.
        draws = np.unique(draws)[:, None]
    assert distance_p_value(draws, stats.norm(*baseline_answer())) > 0.01
    # The control: noise under-stated by two has a mean as good and half the width, and does not pass.
    assert distance_p_value(draws, stats.norm(*baseline_answer(noise=0.5 * WHITE))) < 1e-6


def normal_proposal(covariance):
    """Proposals from a wider normal, whatever the place, as `moves` takes them."""
    factor = 1.3 * np.linalg.cholesky(covariance)

    def density(places):
        return -0.5 * np.square(np.linalg.solve(factor, places.T)).sum(axis=0)

    def propose(places, random):
        proposed = random.standard_normal(places.shape) @ factor.T
        return proposed, density(places) - density(proposed)

    return propose


CORRELATED = np.full((4, 4), 0.99) + 0.01 * np.eye(4)


@pytest.mark.parametrize("move", [move for move, _ in moves(normal_proposal(CORRELATED))])
def test_every_move_yields_the_distribution(move):
    assert np.abs(variance_errors(move, 0.99)).max() < 4.0


@pytest.mark.skipif(
    emcee.__version__ != "3.1.6", reason="the move is wrong in this version only, as far as known"
)
def test_the_snooker_left_out_does_not():
    assert variance_errors(emcee.moves.DESnookerMove(), 0.0).mean() < -8.0


def variance_errors(move, correlation, dimensions=4, steps=3000):
    """How far the variances of a correlated normal are off, in their standard errors, (p,)."""
    covariance = np.full((dimensions, dimensions), correlation) + (1.0 - correlation) * np.eye(dimensions)
    precision = np.linalg.inv(covariance)
    sampler = emcee.EnsembleSampler(
        32,
        dimensions,
        lambda q: -0.5 * np.einsum("mi,ij,mj->m", q, precision, q),
        moves=[(move, 0.9), (emcee.moves.StretchMove(), 0.1)],
        vectorize=True,
    )
    start = np.random.default_rng(1).multivariate_normal(np.zeros(dimensions), covariance, 32)
    state = emcee.State(start, random_state=np.random.RandomState(2).get_state())
    chain = np.stack([now.coords.copy() for now in sampler.sample(state, iterations=steps, store=False)])
    # In the axes of the covariance the variances are independent and one.
    values, vectors = np.linalg.eigh(covariance)
    squares = ((chain @ vectors) ** 2 / values)[500:]
    sizes = [squares[..., i].size / time for i, time in enumerate(autocorrelation_times(squares))]
    return (squares.mean(axis=(0, 1)) - 1.0) * np.sqrt(np.array(sizes) / 2.0)


def test_unknown_noise_is_integrated_out():
    """A mean with unknown noise has Student's distribution."""
    curve = halfspace_curve(points=9)
    problem = ul.Problem(
        halfspace_scene(), curve, {"instrument.baseline": ul.Uniform(-1e-2, 1e-2)}, ul.Noise()
    )
    # Student's tails at 8 degrees of freedom and a normal's are told apart by some tens of thousands of draws.
    posterior = ul.sample(problem, walkers=256, method="emcee")
    residual = curve.force - halfspace_scene().with_values({"instrument.baseline": 0.0}).force(curve.depth)
    exact = stats.t(df=8, loc=residual.mean(), scale=residual.std(ddof=1) / 3.0)
    draws = posterior.of("instrument.baseline")
    assert distance_p_value(draws, exact) > 0.01
    assert distance_p_value(draws, stats.norm(residual.mean(), residual.std(ddof=1) / 3.0)) < 0.01


def test_noise_as_a_parameter_is_found():
    curve = halfspace_curve(points=200)
    free = {"layer.E": ul.LogUniform(1e4, 1e8), "noise.force": ul.LogUniform(1e-7, 1e-3)}
    posterior = ul.sample(ul.Problem(halfspace_scene(), curve, free, ul.Noise()), walkers=16)
    draws = posterior.samples["noise.force"]
    # Its relative standard deviation is 1 / sqrt(2 n) = 5 %.
    assert draws.std() / WHITE == pytest.approx(0.05, rel=0.2)
    assert abs(draws.mean() / WHITE - 1.0) < 0.2
    assert posterior.truth == {"layer.E": 1e6, "noise.force": WHITE}


@pytest.mark.parametrize("method", [None, "importance", "emcee"])
def test_the_same_seed_gives_the_same_posterior(method):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ul.UnderlayWarning)
        runs = [
            ul.sample(baseline_problem(), walkers=8, max_steps=60, rng=seed, method=method)
            for seed in (5, 5, 6, np.random.default_rng(5))
        ]
    np.testing.assert_array_equal(runs[0].chain, runs[1].chain)
    assert runs[0].chain.shape != runs[2].chain.shape or (runs[0].chain != runs[2].chain).any()
    assert (runs[0].diagnostics.seed, runs[3].diagnostics.seed) == (5, None)


# --- weighted draws and the chain that judges them --------------------------------------------------------


def test_by_default_weighted_draws_are_judged_by_a_short_chain():
    posterior = ul.sample(halfspace_problem())
    details = posterior.diagnostics
    assert (details.method, details.weighted, details.steps, details.walkers) == ("emcee", True, 100, 64)
    assert "a chain of 100 steps from them agrees" in details.reason
    assert details.importance.k_hat < 0.7
    assert details.importance.disagreement == ""
    assert max(map(max, details.quantile_errors.values())) < 0.15


def shifted(monkeypatch, by):
    """Weighted draws that are off by so many standard deviations, and do not know it."""
    weigh = sampling.weigh

    def off(density, rng):
        drawn = weigh(density, rng)
        return replace(drawn, vectors=drawn.vectors + by * drawn.vectors.std(axis=0))

    monkeypatch.setattr(sampling, "weigh", off)


def test_draws_that_a_chain_contradicts_are_not_the_answer(monkeypatch):
    known = ul.sample(halfspace_problem(), method="emcee").samples
    shifted(monkeypatch, 1.0)
    posterior = ul.sample(halfspace_problem())
    details = posterior.diagnostics
    assert not details.weighted
    assert details.converged
    assert "weighted draws differ: the 2.5 % quantile of layer.E by -1." in details.reason
    assert details.importance.disagreement
    assert posterior.log_evidence is None
    off = (posterior.samples.median() - known.median()) / known.std()
    assert off.abs().max() < 0.15


def test_refused_weights_make_a_chain_or_an_error(monkeypatch):
    monkeypatch.setattr(drawing, "_FEWEST", 1e9)
    posterior = ul.sample(halfspace_problem())
    assert not posterior.diagnostics.weighted
    assert posterior.converged
    assert "too few" in posterior.diagnostics.importance.refused
    with pytest.raises(ul.FitError, match=r"weighted draws are refused: .*too few; take the sampler emcee"):
        ul.sample(halfspace_problem(), method="importance")


def test_the_evidence_is_that_of_quadrature():
    problem = halfspace_problem()
    posterior = ul.sample(problem)
    middle = ul.fit(problem).vector
    scatter = np.array([np.std(np.log(posterior.of("layer.E"))), 0.0])
    scatter[1] = np.std(posterior.of("instrument.contact_depth")) / problem.coordinates[1].scale
    axes = [m + s * np.linspace(-9.0, 9.0, 301) for m, s in zip(middle, scatter, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    density = problem.log_posterior(grid)
    cell = np.prod([axis[1] - axis[0] for axis in axes])
    exact = density.max() + np.log(np.exp(density - density.max()).sum() * cell)
    assert posterior.log_evidence.value == pytest.approx(exact, abs=4.0 * posterior.log_evidence.error + 1e-3)


# --- what the data told -----------------------------------------------------------------------------------


def test_a_thick_layer_barely_touched_tells_nothing_of_its_thickness():
    posterior = ul.sample(barely_touched_problem(), method="emcee")
    assert posterior.converged
    summary = posterior.summary()
    assert summary.loc["layer.thickness", "informed"] == UNDETERMINED == "not informed by these data"
    assert summary.loc["layer.E", "informed"] == DETERMINED
    # The posterior is its prior: width and mean within four standard errors of the draws, plus the trace of
    # information that is there. The data alone would fix the thickness to about 20 %, four times the prior:
    # the width shrinks by 3 %, and the mean moves by a quarter of a standard deviation at most (one sigma).
    draws = posterior.of("layer.thickness")
    size = effective_size(draws)
    assert draws.std() == pytest.approx(5e-5, rel=4.0 / np.sqrt(2.0 * size) + 0.03)
    assert draws.mean() == pytest.approx(1e-3, abs=5e-5 * (4.0 / np.sqrt(size) + 0.25))


# --- stopping ---------------------------------------------------------------------------------------------


def test_too_few_steps_are_said_to_be_too_few():
    with pytest.warns(ul.UnderlayWarning, match="not converged after 60 steps.*take more steps"):
        posterior = ul.sample(halfspace_problem(), walkers=8, max_steps=60, method="emcee")
    assert not posterior.converged
    assert "not converged" in posterior.diagnostics.reason
    assert posterior.diagnostics.steps == 60


def test_a_converged_chain_met_the_rule(plain):
    details = plain.diagnostics
    kept = details.steps - details.burn_in
    assert details.converged
    assert kept > 50.0 * max(details.autocorrelation_time)
    assert max(details.rhat) < 1.01
    assert (plain.summary()["rhat"] < 1.02).all()
    assert details.evaluations >= details.steps * 8
    assert 0.1 < details.acceptance < 0.9


def test_a_chain_ends_by_itself_where_a_step_takes_long(monkeypatch):
    monkeypatch.setattr(sampling, "_MOST_SECONDS", 0.0)
    with pytest.warns(
        ul.UnderlayWarning, match="stopped, 0 s of processor time being used up, after 100 steps"
    ):
        cut = ul.sample(halfspace_problem(), walkers=8, method="emcee")
    assert not cut.converged
    assert len(cut.samples) > 100
    # A number of steps that is asked for is made.
    with pytest.warns(ul.UnderlayWarning, match="not converged after 110 steps"):
        ul.sample(halfspace_problem(), walkers=8, max_steps=110, method="emcee")


def test_an_interrupt_keeps_what_there_is(monkeypatch):
    calls = {"left": 120}
    keep = sampling._Run._keep

    def interrupted(run, state):
        keep(run, state)
        calls["left"] -= 1
        if not calls["left"]:
            raise KeyboardInterrupt

    monkeypatch.setattr(sampling._Run, "_keep", interrupted)
    with pytest.warns(ul.UnderlayWarning, match="interrupted after 120 steps"):
        posterior = ul.sample(halfspace_problem(), walkers=8, method="emcee")
    assert not posterior.converged
    assert posterior.diagnostics.steps == 120
    assert len(posterior.samples) > 100


# --- failures ---------------------------------------------------------------------------------------------


def failing(problem, edge, *, how):
    """The same problem with a model that fails where E is above `edge` (Pa)."""
    works = problem.log_posterior

    def log_posterior(vectors):
        values = works(vectors)
        bad = problem.physical(vectors)[..., 0] > edge
        if how == "raises" and bad.any():
            raise ul.InputError("no law there")
        return np.where(bad, np.nan if how == "nan" else -np.inf, values)

    problem.log_posterior = log_posterior
    return problem


@pytest.mark.parametrize("how", ["nan", "impossible", "raises"])
@pytest.mark.parametrize("method", [None, "emcee"])
def test_failed_evaluations_are_counted_reported_and_impossible(how, method, plain):
    # A fit knows nothing of the edge: it is put a quarter of a standard deviation above the middle, so that the
    # best fit, which is not quite there, lies below it.
    edge = float(plain.samples["layer.E"].quantile(0.6))
    problem = failing(halfspace_problem(), edge, how=how)
    with pytest.warns(ul.UnderlayWarning) as caught:
        posterior = ul.sample(problem, walkers=8, max_steps=200, method=method)
    details = posterior.diagnostics
    assert posterior.samples["layer.E"].max() <= edge
    assert 0.01 * details.evaluations < details.failures < details.evaluations
    low, high = details.failure_region["layer.E"]
    assert edge <= low < high
    said = "\n".join(str(warning.message) for warning in caught)
    assert re.search(rf"{details.failures} of {details.evaluations} model evaluations failed.*layer\.E", said)


def test_a_good_model_fails_nowhere(plain):
    assert plain.diagnostics.failures == 0
    assert plain.diagnostics.failure_region == {}


# --- stop and resume --------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [None, "emcee"])
def test_a_chain_stopped_and_resumed_is_the_chain_never_stopped(tmp_path, method, monkeypatch):
    if method is None:
        # The chain that judges disagrees, and goes on.
        shifted(monkeypatch, 1.0)
    asked = {"walkers": 8, "rng": 3, "method": method}
    whole = ul.sample(halfspace_problem(), max_steps=4000, **asked)
    assert whole.diagnostics.steps > 150
    # Before it is judged first, and shortly before it was judged last: there it may be good enough already.
    for number, stop in enumerate((90, whole.diagnostics.steps - 3)):
        path = tmp_path / f"chain{number}.h5"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ul.UnderlayWarning)
            stopped = ul.sample(halfspace_problem(), max_steps=stop, backend=path, **asked)
        assert stopped.diagnostics.steps == stop
        resumed = ul.sample(halfspace_problem(), max_steps=4000, backend=path, resume=True, **asked)
        assert resumed.diagnostics.steps == whole.diagnostics.steps
        np.testing.assert_array_equal(resumed.chain, whole.chain)
        again = ul.sample(halfspace_problem(), max_steps=4000, backend=path, resume=True, **asked)
        np.testing.assert_array_equal(resumed.chain, again.chain)


def test_kill_9_loses_nothing(tmp_path):
    path = tmp_path / "a.chain"
    program = textwrap.dedent(
        f"""
        import sys
        sys.path[:0] = {[str(TESTS), str(TESTS.parent / "src")]!r}
        from support.posterior_cases import halfspace_problem
        from underlay.inference.sampling import run as sampling
        keep = sampling._Run._keep
        def told(run, state):
            keep(run, state)
            print(run.steps, flush=True)
        sampling._Run._keep = told
        sampling._FIRST_CHECK = 10**9
        sampling.sample(
            halfspace_problem(), walkers=8, max_steps=100_000, rng=3, backend={str(path)!r}, method="emcee"
        )
        """
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        told = 0
        while told < 150:
            told = int(process.stdout.readline())
        os.kill(process.pid, signal.SIGKILL)
        told = max([told, *(int(line) for line in process.stdout.read().split())])
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        posterior = ul.sample(
            halfspace_problem(),
            walkers=8,
            max_steps=told + 1,
            rng=3,
            backend=path,
            resume=True,
            method="emcee",
        )
    assert posterior.diagnostics.steps == told + 1
    with open_chain(path, ("layer.E", "instrument.contact_depth"), 8, resume=True) as (_, kept):
        stored = kept.steps
    # What was stored is the chain of a run that was never killed.
    reference = tmp_path / "b.chain"
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        ul.sample(
            halfspace_problem(), walkers=8, max_steps=told + 1, rng=3, backend=reference, method="emcee"
        )
    with open_chain(reference, ("layer.E", "instrument.contact_depth"), 8, resume=True) as (
        _,
        kept,
    ):
        np.testing.assert_array_equal(stored, kept.steps)


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("what", ["curve", "noise", "prior"])
def test_a_chain_of_another_problem_is_refused(kept, what):
    other = {
        "curve": halfspace_problem(halfspace_curve(seed=2)),
        "noise": halfspace_problem(noise=ul.Noise(force=1.1 * WHITE)),
        "prior": ul.Problem(
            halfspace_scene(),
            halfspace_curve(),
            {"layer.E": ul.Normal(1e6, 1e4), "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5)},
            ul.Noise(force=WHITE),
        ),
    }[what]
    with pytest.raises(ul.InputError, match="the chain of another problem"):
        ul.sample(other, walkers=8, backend=kept, resume=True)


def test_resume_begins_where_there_is_nothing_yet(tmp_path):
    path = tmp_path / "a.chain"
    posterior = ul.sample(baseline_problem(), walkers=8, backend=path, resume=True)
    assert posterior.converged
    assert path.exists()


# --- bad input --------------------------------------------------------------------------------------------


def test_baselines_without_a_prior_get_wide_bounds():
    half = ul.Scene(ul.Paraboloid(2.5e-6), ul.Layer(ul.Isotropic(5e3, 0.5)), uncertainties="none")
    depth, noise = np.linspace(-1e-6, 1e-6, 300), ul.Noise(force=2e-11)
    curves = [ul.synthesize(half, depth, noise, np.random.default_rng(seed)) for seed in range(2)]
    free = {"layer.E": (1e2, 1e6), "instrument.baseline": None}
    problem = ul.Problem.joint([(half, one) for one in curves], free, ["layer.E"], noise)
    with pytest.warns(
        ul.UnderlayWarning, match=r"baseline\[0\], instrument.baseline\[1\]: no bounds and no prior"
    ):
        posterior = ul.sample(problem, method="importance")
    assert 5e3 in posterior.answer("layer.E").interval
    assert 0.0 in posterior.answer("instrument.baseline[1]").interval


def test_an_improper_prior_is_refused():
    problem = ul.Problem(halfspace_scene(), halfspace_curve(), {"layer.E": None}, ul.Noise(force=WHITE))
    assert isinstance(problem.priors["layer.E"], Flat)
    with pytest.raises(ul.InputError, match=r"the prior of layer\.E is improper.*finite bounds"):
        ul.sample(problem)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"walkers": 3}, "3 walkers are too few for 2 parameters: at least 6"),
        ({"max_steps": 2}, "max_steps must be at least"),
        ({"rng": -1}, "rng must be a seed"),
        ({"rng": "today"}, "rng must be a seed"),
        ({"resume": True}, "to resume a sampling, give"),
        ({"method": "nuts"}, "unknown method 'nuts'"),
        ({"method": "importance", "backend": "a.h5"}, "are no chain"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(ul.InputError, match=message):
        ul.sample(halfspace_problem(), **options)


# --- people -----------------------------------------------------------------------------------------------


def test_silent_when_not_a_terminal_and_talking_when_asked(capfd):
    ul.sample(baseline_problem(), walkers=8)
    assert capfd.readouterr() == ("", "")
    ul.sample(baseline_problem(), walkers=8, progress=True, method="emcee")
    out, err = capfd.readouterr()
    assert out == ""
    assert "effective samples" in err

"""The mixture along the ridges of a posterior: densities whose integral is known, and what must be declined."""

import itertools
import json
from dataclasses import replace
from types import SimpleNamespace

import emcee
import h5py
import numpy as np
import pytest
from scipy import integrate, stats

import underlay as ul
from support.posterior_cases import (
    WHITE,
    baseline_answer,
    baseline_problem,
    halfspace_curve,
    halfspace_problem,
)
from support.posterior_quadrature import reference
from support.random_posteriors import random_problem
from underlay.inference.ridge.importance import (
    Proposal,
    aimed,
    judged,
    leak_of,
    leak_of_walk,
    learn,
    produced,
    weigh,
)
from underlay.inference.ridge.march import (
    Budget,
    OutOfTimeError,
    Part,
    PriorNormal,
    Target,
    climb,
    march,
    march_inside,
    nodes_of,
    small_basis,
)
from underlay.inference.ridge.mixture import LEVELS, Mixture, WeightedDraws, pareto_fit, smoothed
from underlay.inference.sampling import weighted as opinions
from underlay.inference.sampling.convergence import effective_size
from underlay.inference.sampling.counted import CountedDensity
from underlay.inference.sampling.posterior import arviz_library
from underlay.inference.sampling.run import IndependenceMove
from underlay.inference.sampling.weighted import Ridges
from underlay.report.posterior_tables import posterior_diagnostics_table


class Known:
    """A density in z with no problem behind it."""

    coordinates = SimpleNamespace(scaled=lambda z: z)

    def __init__(self, log_density):
        self.log_density, self.evaluations = log_density, 0

    def __call__(self, z):
        self.evaluations += len(z)
        return np.where((np.abs(z) < 7.5).all(axis=1), self.log_density(z), -np.inf)


def found(density, starts, seed=0):
    target = Known(density)
    proposal = learn(
        target, [np.asarray(s, dtype=float) for s in starts], np.random.default_rng(seed), Budget(60.0)
    )
    drawn = produced(target, proposal, np.random.default_rng(seed + 1), Budget(60.0))
    leak = leak_of_walk(target, drawn, proposal, np.random.default_rng(seed + 2))
    return proposal, drawn, judged(drawn, proposal, leak)


# --- coordinates ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "prior",
    [
        ul.LogUniform(1e4, 1e8),
        ul.Normal(1e6, 2e5),
        ul.LogNormal(1e6, 0.5),
        ul.HalfNormal(1e6),
        ul.Uniform(1e5, 5e6),
    ],
)
def test_the_prior_is_a_standard_normal(prior):
    problem = halfspace_problem().revised(free={"layer.E": prior})
    coordinates = PriorNormal(problem)
    z = np.linspace(-4.0, 4.0, 81)[:, None]
    vectors = coordinates.scaled(z)
    np.testing.assert_allclose(coordinates.normal(vectors), z, atol=1e-9)
    # Both densities describe one distribution: prior(q) = N(z) |dz/dq|, and the slope is that of z itself.
    step = 1e-7
    slopes = (coordinates.normal(vectors + step) - coordinates.normal(vectors - step))[:, 0] / (2.0 * step)
    # The part of a normal prior below zero is a constant factor.
    difference = coordinates.log_slope(vectors, z) - np.log(slopes)
    # Rounding of z over the step, and its curvature four deviations out.
    np.testing.assert_allclose(difference, difference[40], atol=1e-4)
    assert abs(difference[40]) < 1e-5


def test_the_evidence_of_a_linear_problem_is_known():
    """Readings with a normal baseline are a normal vector: sigma^2 I + tau^2 1 1'."""
    posterior = ul.sample(baseline_problem(), walkers=16)
    curve = halfspace_curve()
    residuals = curve.force - (baseline_problem().members[0].model(np.zeros(1)))
    covariance = WHITE**2 * np.eye(len(curve)) + 1e-10
    exact = stats.multivariate_normal(np.zeros(len(curve)), covariance).logpdf(residuals)
    value, error = posterior.log_evidence
    assert 0.0 < error < 0.03
    assert abs(value - exact) < 4.0 * error


def test_the_evidence_and_the_quantiles_are_those_of_quadrature():
    problem = halfspace_problem()
    answer = reference(problem)
    posterior = ul.sample(problem, method="importance")
    value, error = posterior.log_evidence
    assert abs(value - answer.log_evidence) < 4.0 * error + 1e-3
    for name in problem.names:
        draws = posterior.of(name)
        off = (np.quantile(draws, (0.025, 0.5, 0.975)) - answer.quantiles[name]) / draws.std()
        # Four times what was asked of the weights, and of the resampling again.
        assert np.abs(off).max() < 4.0 * 0.07 * np.sqrt(2.0)


# --- densities of known integral --------------------------------------------------------------------------


def normal(z):
    return stats.multivariate_normal(np.zeros(z.shape[1])).logpdf(z).reshape(len(z))


def correlated(z):
    covariance = np.array([[1.0, 0.98, 0.0], [0.98, 1.0, 0.3], [0.0, 0.3, 4.0]]) * 0.05
    return stats.multivariate_normal(np.zeros(3), covariance).logpdf(z)


def banana(z):
    return (
        stats.norm.logpdf(z[:, 0])
        + stats.norm.logpdf(z[:, 1], 0.7 * (z[:, 0] ** 2 - 1.0), 0.05)
        + stats.norm.logpdf(z[:, 2], 0.3 * z[:, 0], 0.01)
    )


def two_tops(z):
    one, other = (stats.norm.logpdf(z, m, 0.1).sum(axis=1) for m in (-1.0, 1.5))
    return np.logaddexp(np.log(0.8) + one, np.log(0.2) + other)


def wall(z):
    return np.where(z[:, 0] < 0.0, np.log(2.0) + normal(z), -np.inf)


@pytest.mark.parametrize(
    ("density", "starts"),
    [
        (normal, [np.zeros(1)]),
        (normal, [np.full(4, 0.5)]),
        (correlated, [np.zeros(3)]),
        (banana, [np.array([0.0, -0.7, 0.0])]),
        (two_tops, [np.full(2, -1.0), np.full(2, 1.5)]),
        (wall, [np.array([-0.5, 0.0])]),
    ],
    ids=["one", "four", "correlated", "banana", "two tops", "wall"],
)
def test_a_density_of_integral_one_has_an_evidence_of_one(density, starts):
    proposal, drawn, told = found(density, starts)
    assert told.accepted, told.refused
    assert proposal.optima == len(starts)
    assert abs(told.log_evidence) < 4.0 * told.log_evidence_error + 1e-6
    assert drawn.quantile_errors().max() < 0.1


def test_a_top_that_no_start_leads_to_is_missed_and_not_noticed():
    """What neither k-hat nor the leak can see: the reason for many starts, and for the chain's other moves."""
    _, _, told = found(two_tops, [np.full(2, -1.0)])
    assert told.log_evidence == pytest.approx(np.log(0.8), abs=0.05)


def test_a_place_that_lies_on_no_ridge_is_climbed_from():
    target = Known(two_tops)
    places = [np.array([1.1, 1.2]), np.array([-1.2, -1.1])]
    proposal = learn(target, [np.full(2, -1.0)], np.random.default_rng(0), Budget(60.0), places=places)
    assert proposal.optima == 2
    drawn = produced(target, proposal, np.random.default_rng(1), Budget(60.0))
    value, error = drawn.log_evidence
    assert abs(value) < 4.0 * error + 1e-6


def test_an_arm_that_no_optimum_leads_to_is_found_by_the_scan():
    """A thin layer whose contact is at the end of its prior: 2.7 % of the mass, behind a saddle."""
    problem = random_problem(7)
    ridges = Ridges(problem, CountedDensity(problem), np.random.default_rng(0))
    ridges.seek()
    thickness = problem.names.index("layer.thickness")
    z = ridges.mixture.places[:, thickness]
    # By quadrature 2.6 % of the posterior are thinner than the saddle, at z = -0.8.
    assert ridges.mixture.weights[z < -0.8].sum() > 0.01


def test_the_leak_tells_of_a_mixture_that_leaves_a_part_out():
    density = Known(two_tops)
    one, both = (
        found(two_tops, starts)[0] for starts in ([np.full(2, -1.0)], [np.full(2, -1.0), np.full(2, 1.5)])
    )
    rng = np.random.default_rng(1)
    where = np.where(rng.random(4096) < 0.8, -1.0, 1.5)
    z = where[:, None] + 0.1 * rng.standard_normal((4096, 2))
    leaks, told = [], []
    for proposal in (one, both):
        drawn = produced(density, proposal, np.random.default_rng(0), Budget(60.0))
        leaks.append(leak_of(density(z) - proposal.mixture.log_density(z), drawn))
        told.append(judged(drawn, proposal, leaks[-1]))
    # A fifth of the posterior is where the first does not reach; by its definition a hundredth for the second.
    assert leaks[0] > 0.15
    assert leaks[1] == pytest.approx(0.01, abs=0.012)
    assert "hardly reaches" in told[0].refused
    assert told[1].accepted


def test_an_open_end_is_not_believed():
    drawn = produced(Known(normal), found(normal, [np.zeros(2)])[0], np.random.default_rng(0), Budget(60.0))
    proposal = found(normal, [np.zeros(2)])[0]
    assert judged(drawn, proposal, 0.01).accepted
    open_ended = Proposal(proposal.mixture, 1, "the ridge ends in a cliff")
    assert judged(drawn, open_ended, 0.01).refused == "the ridge ends in a cliff"


def test_no_time_means_no_mixture():
    assert learn(Known(normal), [np.zeros(2)], np.random.default_rng(0), Budget(-1.0)) is None


class FewAsks(Budget):
    """Time that is used up after so many asks."""

    def __init__(self, asks):
        super().__init__(60.0)
        self.asks = asks

    def require(self):
        self.asks -= 1
        if self.asks < 0:
            raise OutOfTimeError


def test_whenever_the_time_is_used_up_there_is_a_mixture_or_none():
    normal = stats.multivariate_normal(np.zeros(2), [[1.0, 0.8], [0.8, 1.0]]).logpdf
    found = [
        learn(Known(normal), [np.zeros(2)], np.random.default_rng(0), FewAsks(asks)) for asks in range(70)
    ]
    # None until a ridge was walked, and from then on a mixture, the first right at its end.
    there = [proposal is not None for proposal in found]
    assert there == sorted(there)
    assert not there[0]
    assert there[-1]


def test_the_climb_is_newtons_method():
    # Correlated to 0.86, one direction 8000 times as long as the other, none longer than the prior.
    precision = np.array([[1e8, 2.1e4], [2.1e4, 6.0]])
    top = climb(
        lambda z: -0.5 * np.einsum("ni,ij,nj->n", z - 0.3, precision, z - 0.3), np.zeros(2), small_basis(2)
    )
    # A quadratic's differences are exact.
    np.testing.assert_allclose(top.place, 0.3, atol=2e-2)
    np.testing.assert_allclose(top.basis @ top.basis.T, np.linalg.inv(precision), rtol=1e-2)
    # The mass of a normal: its top times its volume.
    assert top.log_mass == pytest.approx(-0.5 * np.linalg.slogdet(precision)[1], abs=0.02)


def test_the_nodes_of_a_ridge_add_up_to_the_mass():
    top = climb(correlated, np.zeros(3), small_basis(3))
    ridge = march(correlated, top)
    assert not ridge.open_end
    # Slices of a normal are normal: two dimensions of (2 pi)^(1/2) each are left out of a slice's mass.
    total = np.logaddexp.reduce([node.log_weight for node in ridge.nodes]) + np.log(2.0 * np.pi)
    # A sum over nodes half a standard deviation apart or more, cut ten log units down.
    assert total == pytest.approx(0.0, abs=0.1)


def test_a_bent_sheet_is_walked_inside_its_slices():
    """Two directions as wide as the prior, and a third that follows the square of one of them."""

    def sheet(z):
        return stats.norm.logpdf(z[:, :2]).sum(axis=1) + stats.norm.logpdf(z[:, 2], 0.5 * z[:, 1] ** 2, 0.05)

    ridge = march(sheet, climb(sheet, np.array([0.05, 0.1, 0.0]), small_basis(3)))
    nodes, open_end = march_inside(sheet, ridge)
    assert not open_end
    assert len(nodes) > 3 * len(ridge.slices)
    # Every node stands on the sheet, and together they reach its ends.
    places = np.array([node.place for node in nodes])
    assert np.abs(places[:, 2] - 0.5 * places[:, 1] ** 2).max() < 0.1
    assert np.ptp(places[:, :2], axis=0).min() > 5.0
    total = np.logaddexp.reduce([node.log_weight for node in nodes]) + 0.5 * np.log(2.0 * np.pi)
    assert total == pytest.approx(0.0, abs=0.3)
    # What lies straight has no sheet.
    straight = march(correlated, climb(correlated, np.zeros(3), small_basis(3)))
    assert len(march_inside(correlated, straight)[0]) == len(straight.slices)


# --- the mixture ------------------------------------------------------------------------------------------


def mixture_of_two():
    factors = np.array([[[1.0, 0.0], [0.5, 0.2]], [[0.3, 0.0], [0.0, 0.3]]])
    return Mixture(np.array([0.7, 0.3]), np.array([[0.0, 0.0], [2.0, 1.0]]), factors)


def test_the_density_of_the_mixture_is_that_of_its_components():
    mixture = mixture_of_two()
    z = np.random.default_rng(0).normal(size=(50, 2))
    parts = [
        np.log(w) + stats.multivariate_t(m, f @ f.T, df=5).logpdf(z)
        for w, m, f in zip(mixture.weights, mixture.places, mixture.factors, strict=True)
    ]
    np.testing.assert_allclose(mixture.log_density(z), np.logaddexp(*parts), rtol=1e-12)
    np.testing.assert_allclose(mixture.responsibilities(z).sum(axis=1), 1.0, rtol=1e-12)
    line = Mixture(np.array([0.5, 0.5]), np.array([[0.0], [1.0]]), np.array([[[0.3]], [[1.0]]]))
    area, _ = integrate.quad(lambda x: np.exp(line.log_density(np.array([[x]]))[0]), -np.inf, np.inf)
    assert area == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("draws", [Mixture.draw, Mixture.spread])
def test_draws_of_the_mixture_have_its_density(draws):
    mixture = mixture_of_two()
    z = draws(mixture, 20_000, np.random.default_rng(1))
    # Its first coordinate: a mixture of Student's t; of the 20,000 every tenth, for Kolmogorov's independent ones.
    few = np.random.default_rng(2).permutation(z[:, 0])[:2000]

    def below(x):
        return 0.7 * stats.t.cdf(x, 5) + 0.3 * stats.t.cdf((x - 2.0) / 0.3, 5)

    assert stats.kstest(few, below).pvalue > 0.01
    assert stats.kstest(few, stats.t(5).cdf).pvalue < 1e-6


def test_draws_that_are_spread_know_a_share_better():
    """4096 independent draws know a share of a half to 0.008; a net of them in four dimensions to a third."""
    mixture, off = mixture_of_two(), {}
    for draws in (Mixture.draw, Mixture.spread):
        z = [draws(mixture, 4096, np.random.default_rng([4, i])) for i in range(12)]
        # 0.7 of the weight is in a component whose middle is at the first coordinate 0, 0.3 about 2, 0.3 wide.
        below = 0.7 * 0.5 + 0.3 * stats.t.cdf(-2.0 / 0.3, 5)
        off[draws] = np.sqrt(np.mean([((part[:, 0] < 0.0).mean() - below) ** 2 for part in z]))
    # Twelve numbers know their spread to 20 %.
    assert off[Mixture.draw] > 0.005
    assert off[Mixture.spread] < 0.5 * off[Mixture.draw]


def test_what_is_learnt_from_draws_comes_nearer():
    rng = np.random.default_rng(3)
    start = Mixture(
        np.array([0.5, 0.5]), np.array([[-1.0, 0.0], [1.0, 0.0]]), np.array([np.eye(2), np.eye(2)])
    )
    target = stats.multivariate_normal([0.4, -0.2], [[0.3, 0.2], [0.2, 0.3]])

    def share(mixture):
        z = mixture.spread(4096, rng)
        weights = np.exp(target.logpdf(z) - mixture.log_density(z))
        return weights.sum() ** 2 / np.square(weights).sum() / len(z), z, weights / weights.sum()

    before, z, weights = share(start)
    after = share(start.learnt(z, weights))[0]
    assert after > 1.5 * before


# --- the tail ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [-0.3, 0.2, 0.7])
def test_the_index_of_a_pareto_tail_is_found(index):
    draws = np.sort(stats.genpareto.rvs(index, scale=2.0, size=4000, random_state=1))
    k, scale = pareto_fit(draws)
    # Its standard error is (1 + k) / sqrt(n), 2.7 % at most; the weak prior adds a thousandth.
    assert k == pytest.approx(index, abs=4.0 * 0.027 + 0.002)
    assert scale == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("width", [0.5, 0.8, 1.5])
def test_smoothed_weights_are_those_of_arviz(width):
    z = np.random.default_rng(5).standard_normal(3000) * width
    log_weights = stats.norm.logpdf(z) - stats.norm.logpdf(z, scale=width)
    mine, k = smoothed(log_weights)
    theirs, their_k = arviz_library().psislw(log_weights.copy())
    assert k == pytest.approx(float(their_k), abs=1e-6)
    np.testing.assert_allclose(mine - np.logaddexp.reduce(mine), theirs, atol=1e-8)


def test_weights_without_a_tail():
    assert smoothed(np.zeros(100))[1] == -np.inf
    assert smoothed(np.full(3, -1.0))[1] == np.inf


# --- the move ---------------------------------------------------------------------------------------------


def chain_of(move, problem, steps=1500):
    """Draws of one parameter, (steps, walkers), by that move and some stretches."""
    sampler = emcee.EnsembleSampler(
        16, 1, CountedDensity(problem), moves=[(move, 0.8), (emcee.moves.StretchMove(), 0.2)], vectorize=True
    )
    mean, sd = baseline_answer()
    scale = problem.physical(np.ones((1, 1)))[0, 0] - problem.physical(np.zeros((1, 1)))[0, 0]
    start = problem.vector({"instrument.baseline": mean}) + sd / scale * np.linspace(-2, 2, 16)[:, None]
    state = emcee.State(start, random_state=np.random.RandomState(3).get_state())
    chain = [now.coords.copy() for now in sampler.sample(state, iterations=steps, store=False)]
    return problem.physical(np.array(chain))[200:, :, 0]


def test_the_independent_move_yields_the_distribution_whatever_the_mixture():
    problem = baseline_problem()
    coordinates = PriorNormal(problem)
    mean, sd = baseline_answer()
    at = coordinates.normal(np.array([problem.vector({"instrument.baseline": mean + sd})]))
    # Beside the posterior and twice as wide.
    mixture = Mixture(np.ones(1), at, np.full((1, 1, 1), 2.0 * sd / 1e-5))
    move = IndependenceMove(coordinates, mixture, CountedDensity(problem))
    exact = stats.norm(mean, sd)
    draws = chain_of(move, problem)
    statistic = stats.kstest(draws.ravel(), exact.cdf).statistic
    assert stats.kstwobign.sf(statistic * np.sqrt(effective_size(draws))) > 0.01
    # The control: without the factor it is another distribution.
    move.log_proposal = lambda vectors, _=None: np.zeros(len(vectors))
    draws = chain_of(move, problem)
    statistic = stats.kstest(draws.ravel(), exact.cdf).statistic
    assert stats.kstwobign.sf(statistic * np.sqrt(effective_size(draws))) < 1e-6


def test_what_is_cut_away_is_proposed_to_nobody():
    problem = baseline_problem()
    coordinates = PriorNormal(problem)
    mixture = Mixture(np.ones(1), np.full((1, 1), 9.0), np.full((1, 1, 1), 1e-3))
    far = IndependenceMove(coordinates, mixture, CountedDensity(problem))
    state = emcee.State(np.zeros((4, 1)), log_prob=np.full(4, -1e300))
    state, accepted = far.propose(SimpleNamespace(random=np.random.RandomState(0)), state)
    np.testing.assert_array_equal(state.coords, 0.0)
    assert len(accepted) >= 4
    assert not accepted.any()


# --- what a user sees -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def posterior():
    return ul.sample(halfspace_problem(), walkers=16)


def test_the_result_says_how_it_was_found(posterior):
    d = posterior.diagnostics
    assert d.method == "emcee"
    assert d.moves["IndependenceMove"] > 0.3
    assert set(d.moves) == {"IndependenceMove", "KernelMove", "DEMove", "StretchMove"}
    assert len(d.effective) == 2
    assert set(d.quantile_errors) == set(posterior.names)
    assert max(max(errors) for errors in d.quantile_errors.values()) <= 0.1
    assert d.importance.accepted
    assert d.importance.k_hat < 0.5
    assert posterior.log_evidence.value == d.importance.log_evidence


def test_the_page_tells_it(posterior):
    told = posterior_diagnostics_table(posterior).to_string()
    for words in ("IndependenceMove", "k-hat", "believed", "ln(evidence)", "2.5, 50, 97.5 % quantiles", "+-"):
        assert words in told
    quick = posterior_diagnostics_table(ul.sample(halfspace_problem(), method="importance")).to_string()
    assert "no chain" in quick
    assert "R-hat" not in quick


def test_files_of_before_have_none(posterior, tmp_path):
    path = tmp_path / "posterior.npz"
    posterior.save(path)
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    about = json.loads(str(arrays.pop("about")))
    for later in ("method", "effective", "quantile_errors", "moves", "importance", "weighted"):
        del about["diagnostics"][later]
    np.savez_compressed(path, about=np.array(json.dumps(about)), **arrays)
    loaded = ul.Posterior.load(path)
    assert loaded.log_evidence is None
    assert loaded.diagnostics.rhat == posterior.diagnostics.rhat
    assert "no mixture was found" in posterior_diagnostics_table(loaded).to_string()


def test_a_resumed_chain_goes_on_with_its_mixture(posterior, tmp_path, monkeypatch):
    path = tmp_path / "chain.h5"
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        ul.sample(halfspace_problem(), walkers=16, max_steps=60, backend=path)
    monkeypatch.setattr(Ridges, "seek", None)  # nothing is looked for again
    resumed = ul.sample(halfspace_problem(), walkers=16, backend=path, resume=True)
    np.testing.assert_array_equal(resumed.chain, posterior.chain)
    assert resumed.log_evidence == posterior.log_evidence
    assert resumed.diagnostics.importance.optima == 1


def test_a_chain_of_before_goes_on_without(tmp_path):
    path = tmp_path / "chain.h5"
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        ul.sample(halfspace_problem(), walkers=16, max_steps=30, backend=path)
    with h5py.File(path, "r+") as file:
        del file["proposal"]
        file.attrs["format"] = "underlay chain 1"
    with pytest.warns(ul.UnderlayWarning, match="not converged after 60 steps"):
        resumed = ul.sample(halfspace_problem(), walkers=16, max_steps=60, backend=path, resume=True)
    assert "IndependenceMove" not in resumed.diagnostics.moves
    assert resumed.diagnostics.importance is None


@pytest.mark.parametrize("spoilt", ["count", "weight", "parameters"])
def test_a_damaged_mixture_is_refused(tmp_path, spoilt):
    path = tmp_path / "chain.h5"
    with pytest.warns(ul.UnderlayWarning, match="not converged"):
        ul.sample(halfspace_problem(), walkers=16, max_steps=20, backend=path)
    with h5py.File(path, "r+") as file:
        file["proposal"][{"count": 0, "parameters": 1, "weight": 4}[spoilt]] = -2.5
    with pytest.raises(ul.FileFormatError, match="mixture"):
        ul.sample(halfspace_problem(), walkers=16, backend=path, resume=True)


def test_models_are_compared_by_their_evidence(posterior):
    other = halfspace_problem(noise=ul.Noise(force=1.3 * WHITE))
    table = ul.compare_models(
        {"as it is": (halfspace_problem(), posterior), "louder": (other, ul.sample(other, walkers=16))}
    )
    odds = table.loc["as it is", "log_evidence"] - table.loc["louder", "log_evidence"]
    assert table["probability"].sum() == pytest.approx(1.0)
    assert table.loc["as it is", "probability"] == pytest.approx(1.0 / (1.0 + np.exp(-odds)))
    # 40 readings told that they scatter 1.3 times as much: n (ln 1.3 - (1 - 1/1.69) / 2) = 2.3 on average, +- 1.8.
    assert -2.0 < odds < 7.0
    # An evidence under a prior that is none compares with no other.
    unknown = halfspace_problem(noise=ul.Noise())
    table = ul.compare_models(
        {"a": (halfspace_problem(), posterior), "b": (unknown, ul.sample(unknown, walkers=16))}
    )
    assert table["probability"].isna().all()


def test_it_is_kept_with_the_posterior(posterior, tmp_path):
    posterior.save(tmp_path / "posterior.npz")
    loaded = ul.Posterior.load(tmp_path / "posterior.npz")
    assert loaded.diagnostics == posterior.diagnostics
    assert loaded.log_evidence == posterior.log_evidence


def test_weighted_draws_alone(posterior):
    quick = ul.sample(halfspace_problem(), method="importance")
    d = quick.diagnostics
    assert quick.converged
    assert d.method == "importance"
    assert d.reason.startswith("accepted")
    assert d.rhat == d.autocorrelation_time == ()
    assert d.importance.effective > 500.0
    # Each is there several times, and the summary does not count them as so many.
    assert quick.chain[..., 0].size == pytest.approx(4 * d.importance.draws, abs=8.0)
    assert (quick.summary()["ess"] <= d.importance.effective * (1.0 + 1e-9)).all()
    for name in quick.names:
        ratio = quick.of(name).std() / posterior.of(name).std()
        assert ratio == pytest.approx(1.0, abs=0.15)
    # The same seed, the same draws.
    again = ul.sample(halfspace_problem(), method="importance")
    np.testing.assert_array_equal(again.chain, quick.chain)


def test_weighted_draws_that_are_not_accepted_say_why(monkeypatch):
    def seek(self):
        self.proposal = _narrow(self)

    monkeypatch.setattr(Ridges, "seek", seek)
    with pytest.raises(ul.FitError, match=r"not accepted: .*k-hat.*take the sampler emcee"):
        ul.sample(halfspace_problem(), method="importance")


def _narrow(ridges):
    at = ridges.coordinates.normal(np.zeros((1, 2)))
    return Proposal(Mixture(np.ones(1), at, 1e-4 * np.eye(2)[None]), 1, "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "nuts"}, "unknown method 'nuts'; known: 'emcee', 'importance'"),
        ({"method": "importance", "backend": "chain.h5"}, "leave backend out"),
    ],
)
def test_bad_methods(options, message):
    with pytest.raises(ul.InputError, match=message):
        ul.sample(halfspace_problem(), **options)


def test_a_disagreement_is_said(monkeypatch):
    draws = Ridges.draws

    def shifted(self):
        drawn, proposal = draws(self)
        return replace(drawn, vectors=drawn.vectors + 0.7 * drawn.deviations), proposal

    monkeypatch.setattr(Ridges, "draws", shifted)
    with pytest.warns(UserWarning, match=r"weighted draws disagree: .*quantile of layer\.E by"):
        posterior = ul.sample(halfspace_problem(), walkers=16)
    assert not posterior.converged
    assert posterior.log_evidence is None
    assert posterior.diagnostics.importance.disagreement
    assert not posterior.diagnostics.weighted


def test_draws_are_weighted_ones_where_a_chain_agrees(posterior):
    d = posterior.diagnostics
    assert d.weighted
    assert "weighted draws agree with it" in d.reason
    assert d.effective == (d.importance.effective,) * 2
    assert max(max(errors) for errors in d.quantile_errors.values()) == d.importance.quantile_error <= 0.035
    assert posterior.chain.shape[1:] == (16, 2)
    # A chain that is asked for is one, and needs more steps to know as much as it must.
    chain = ul.sample(halfspace_problem(), walkers=16, method="emcee")
    assert not chain.diagnostics.weighted
    assert chain.diagnostics.steps > d.steps
    off = np.quantile(posterior.samples, LEVELS, axis=0) - np.quantile(chain.samples, LEVELS, axis=0)
    # The errors that both tell, three at once: 0.035 and 0.06.
    assert (np.abs(off) < 3.0 * 0.07 * np.std(chain.samples, axis=0).to_numpy()).all()


def test_a_chain_whose_weights_fall_goes_on_until_it_knows_by_itself(posterior, monkeypatch):
    """Weights are relied on before a chain can tell of what they miss; that it does so is feigned."""
    monkeypatch.setattr(opinions, "leak_of", lambda *_: 0.5)
    refused = ul.sample(halfspace_problem(), walkers=16)
    assert "hardly reaches" in refused.diagnostics.importance.refused
    assert refused.converged
    assert not refused.diagnostics.weighted
    chain = ul.sample(halfspace_problem(), walkers=16, method="emcee")
    assert posterior.diagnostics.steps < refused.diagnostics.steps
    # Checks come at other steps, 15 % apart; an error that falls below its bound and rises again may pass one of
    # the chain's and fail the other's next: then there are two steps of 15 % between them.
    assert chain.diagnostics.steps / 1.15**2 - 2 < refused.diagnostics.steps
    assert refused.diagnostics.steps < 1.15**2 * chain.diagnostics.steps + 2
    assert max(max(errors) for errors in refused.diagnostics.quantile_errors.values()) <= 0.06


def test_resampling_keeps_what_light_draws_know():
    """Half of the draws know a tail of 2.5 %; as many resampled ones have a twentieth of them there."""
    problem = halfspace_problem()
    ridges = Ridges(problem, CountedDensity(problem), np.random.default_rng(0))
    count = 4096
    x = np.concatenate([-1.0 - np.arange(count // 2) / count, np.arange(count // 2) / count])
    weights = np.concatenate([np.full(count // 2, 0.05), np.full(count // 2, 0.95)]) * 2.0 / count
    z = np.column_stack([x, x])
    drawn = WeightedDraws(z, z, np.log(weights), np.zeros(count))
    off = {}
    for name, rows in (
        ("as many", lambda: drawn.resampled(count, ridges.for_draws)),
        ("several", None),
    ):
        found = [
            np.quantile(
                ridges.resampled(drawn, 8, ridges.for_draws).coords[..., 0] if rows is None else x[rows()],
                0.025,
            )
            for _ in range(16)
        ]
        off[name] = np.sqrt(np.mean(np.square(np.array(found) - drawn.quantiles((0.025,))[0, 0])))
    assert off["several"] < 0.5 * off["as many"]


def test_a_mixture_that_is_no_good_costs_the_evidence_and_not_the_chain(monkeypatch):
    seek = Ridges.seek

    def spoilt(self):
        best = seek(self)
        self.proposal = _narrow(self)
        return best

    monkeypatch.setattr(Ridges, "seek", spoilt)
    # The others do it all: with the share they have beside a good mixture five times the steps are needed.
    monkeypatch.setattr("underlay.inference.sampling.run._INDEPENDENT", 0.1)
    posterior = ul.sample(halfspace_problem(), walkers=16)
    assert posterior.converged
    assert posterior.log_evidence is None
    assert "k-hat" in posterior.diagnostics.importance.refused


def test_without_a_mixture_the_chain_is_the_old_one(monkeypatch):
    monkeypatch.setattr(opinions, "judged", None)
    monkeypatch.setattr("underlay.inference.sampling.weighted.learn", lambda *_, **__: None)
    posterior = ul.sample(halfspace_problem(), walkers=16)
    assert posterior.converged
    assert posterior.diagnostics.importance is None
    assert posterior.log_evidence is None
    assert "IndependenceMove" not in posterior.diagnostics.moves
    with pytest.raises(ul.FitError, match="no ridge was found"):
        ul.sample(halfspace_problem(), method="importance")


def test_a_target_is_the_posterior():
    problem = halfspace_problem()
    coordinates = PriorNormal(problem)
    target = Target(coordinates, problem, CountedDensity(problem))
    z = coordinates.normal(np.array([[0.0, 0.02], [0.01, 0.03]]))
    # Densities of one posterior in two coordinates differ by the slopes between them.
    vectors = coordinates.scaled(z)
    np.testing.assert_allclose(
        target(z), problem.log_posterior(vectors) - coordinates.log_slope(vectors, z), rtol=1e-12
    )
    assert target(np.array([[8.0, 0.0]]))[0] == -np.inf


def test_noise_that_is_a_parameter_has_a_known_evidence():
    """One parameter more whose prior is narrow: the evidence is that of the problem in which it is known."""
    known = halfspace_problem()
    free = {**known.free, "noise.force": ul.LogNormal(WHITE, 1e-3)}
    wider = known.revised(free=free, noise=ul.Noise(force=WHITE))
    one, other = (ul.sample(p, method="importance").log_evidence for p in (known, wider))
    assert abs(one.value - other.value) < 4.0 * np.hypot(one.error, other.error) + 1e-3
    assert len(list(itertools.chain(one, other))) == 4


def core_and_wings(z):
    """Log-density of a normal core, 93 %, and of a bent ridge far wider that the core hides."""
    return np.logaddexp(np.log(0.93) + core(z), np.log(0.07) + wings(z))


def core(z):
    return stats.multivariate_normal([0.0, 0.0], 1e-4 * np.eye(2)).logpdf(z)


def wings(z):
    # Along x a normal of width 1, across it one of width 0.02 about 0.5 x^2.
    return stats.norm(0.0, 1.0).logpdf(z[:, 0]) + stats.norm(0.0, 0.02).logpdf(z[:, 1] - 0.5 * z[:, 0] ** 2)


def test_a_part_that_the_sum_hides_is_walked_by_itself():
    target = Known(core_and_wings)
    parts = [
        Part(lambda z: np.log(0.93) + core(z), np.zeros(2), 0.01 * np.eye(2)),
        Part(lambda z: np.log(0.07) + wings(z), np.zeros(2), np.diag([1.0, 0.02])),
    ]
    assert [part.as_normal()[1] for part in parts] == [False, True]
    rng = np.random.default_rng(3)
    proposal = learn(target, [np.zeros(2)], rng, Budget(60.0), parts=parts)
    drawn = produced(target, proposal, rng, Budget(60.0))
    value, error = drawn.log_evidence
    assert drawn.k_hat < 0.5
    assert value == pytest.approx(0.0, abs=4.0 * error)
    # What a normal says of its mass: the part's own integral.
    assert parts[0].as_normal()[0].log_weight == pytest.approx(
        np.log(0.93) - 0.5 * np.log(2.0 * np.pi), abs=1e-6
    )


def test_an_aimed_mixture_knows_the_ends_better_by_as_many_draws():
    target = Known(core_and_wings)
    parts = [Part(lambda z: np.log(0.07) + wings(z), np.zeros(2), np.diag([1.0, 0.02]))]
    parts.append(Part(core, np.zeros(2), 0.01 * np.eye(2)))
    plain = Mixture.along(nodes_of(parts, Budget(60.0))[0])
    at_ends = aimed(plain, weigh(target, Known.coordinates, plain, 2000, np.random.default_rng(5)))
    # Of x: 7 % in wings of width 1 hold the 2.5 % quantile at the lower 2.5 / 7 of them.
    exact = stats.norm.ppf([0.025 / 0.07, 1.0 - 0.025 / 0.07])
    told = []
    for mixture in (plain, at_ends):
        draws = [
            weigh(target, Known.coordinates, mixture, 2000, np.random.default_rng([6, i])) for i in range(8)
        ]
        off = [drawn.quantiles()[[0, 2], 0] - exact for drawn in draws]
        told.append(np.mean([drawn.quantile_errors()[[0, 2], 0] * drawn.deviations[0] for drawn in draws]))
        # Draws that are taken component by component are worth more than is told; 16 numbers know a spread to 18 %.
        assert np.sqrt(np.mean(np.square(off))) < 1.5 * told[-1]
    # A share a = 0.025 has a variance of a (1 - a) / n among draws of the posterior itself, of (2 a (1 - a))^2 / n
    # where all are aimed at that quantile alone, a tenth. Half of them are, at four ends and two medians: a quarter
    # of the variance goes, at least.
    assert told[1] ** 2 < 0.75 * told[0] ** 2

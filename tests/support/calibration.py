"""Simulation-based calibration: do posteriors of simulated data hold the truth as often as they say?

Talts, Betancourt, Simpson, Vehtari and Gelman (2018), arXiv:1804.06788. Parameters are drawn from the prior,
a curve is made from them, and its posterior is sampled; the rank of each true value among independent draws
of its posterior is then uniform, whatever the data, if generator, likelihood and sampler belong together.
"""

import warnings
import zlib
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

import underlay as ul
from underlay.inference.design.identifiability import information, prior_information

#: Draws a true value is ranked among: ranks are 0 .. DRAWS, in BINS bins of equal width.
DRAWS = 99
BINS = 20
SOLVER = ul.Auto(1e-4)


@dataclass(frozen=True)
class Case:
    """One scene of the study: what is free, with its prior, and what disturbs the force."""

    title: str
    scene: ul.Scene
    depth: np.ndarray
    free: dict
    noise: ul.Noise
    sampling_rate: float = 100.0

    def problem(self, curve, noise=None):
        return ul.Problem(self.scene, curve, self.free, noise or self.noise, solver=SOLVER)

    def generator(self, seed):
        """Chance of one replica: scenes do not share theirs."""
        return np.random.default_rng([seed, zlib.crc32(self.title.encode())])

    def draw(self, rng):
        """A curve made with numbers from the prior."""
        truth = {path: float(prior.sample(rng, 1)[0]) for path, prior in self.free.items()}
        numbers = {path: value for path, value in truth.items() if not path.startswith("noise.")}
        noise = replace(
            self.noise,
            **{path.partition(".")[2]: value for path, value in truth.items() if path.startswith("noise.")},
        )
        scene = self.scene.with_values(numbers)
        return ul.synthesize(scene, self.depth, noise, rng, sampling_rate=self.sampling_rate, solver=SOLVER)


def cases():
    """The scenes of the study by name."""
    depth = np.linspace(-5e-6, 1e-4, 50)
    tip = ul.Paraboloid(1e-3)
    contact = {"instrument.contact_depth": ul.Normal(0.0, 1e-6)}
    soft, layer = ul.Isotropic(1e5, 0.45), ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4)
    return {
        "half-space": Case(
            "gel without an end",
            ul.Scene(tip, ul.Layer(soft)),
            depth,
            {"layer.E": ul.LogNormal(1e5, 0.5), **contact, "noise.force": ul.LogNormal(5e-5, 0.3)},
            ul.Noise(),
        ),
        "rigid base": Case(
            "cartilage on bone",
            ul.Scene(tip, layer, ul.RIGID),
            depth,
            {"layer.E": ul.LogNormal(1e6, 0.5), "layer.thickness": ul.LogNormal(5e-4, 0.3), **contact},
            ul.Noise(force=2e-3, relative=0.01),
        ),
        "elastic base": Case(
            "layer on a softer or stiffer base, its thickness measured by a needle",
            ul.Scene(tip, layer, ul.Isotropic(3e6, 0.45)),
            depth,
            {
                "layer.E": ul.LogNormal(1e6, 0.5),
                "layer.thickness": ul.Normal(5e-4, 2.5e-5),
                "substrate.E": ul.LogNormal(3e6, 0.8),
                **contact,
            },
            ul.Noise(force=2e-3),
        ),
        "long-tailed thickness": Case(
            "a layer of which hardly more is known than its order of magnitude",
            ul.Scene(tip, layer, ul.RIGID),
            depth,
            {"layer.E": ul.LogNormal(1e6, 0.5), "layer.thickness": ul.LogNormal(5e-4, 0.6), **contact},
            ul.Noise(force=2e-3, relative=0.01),
        ),
        "open base": Case(
            "a base that may be as good as rigid",
            ul.Scene(tip, layer, ul.Isotropic(1e8, 0.3)),
            depth,
            {"layer.E": ul.LogNormal(1e6, 0.5), "substrate.E": ul.LogUniform(3e5, 3e10), **contact},
            ul.Noise(force=2e-3),
        ),
        "correlated": Case(
            "cartilage on bone, correlated noise of unknown size, an uncertain tip",
            ul.Scene(tip, layer, ul.RIGID),
            depth,
            {
                "layer.E": ul.LogNormal(1e6, 0.5),
                "layer.thickness": ul.Normal(5e-4, 2.5e-5),
                "indenter.radius": ul.Normal(1e-3, 2e-5),
                "noise.force": ul.LogNormal(2e-3, 0.3),
                "noise.correlation_time": ul.LogNormal(0.03, 0.4),
            },
            ul.Noise(correlation_time=0.03),
        ),
    }


def replica(case, seed, *, walkers=32, max_steps=8000, understated=1.0):
    """Rank of each true value, and whether its 90 % interval holds it, for one simulated curve.

    `understated` divides the noise the likelihood believes in: the control that must fail.
    """
    rng = case.generator(seed)
    curve = case.draw(rng)
    noise = case.noise if understated == 1.0 else replace(case.noise, force=case.noise.force / understated)
    with warnings.catch_warnings():
        # A chain that did not meet the stop rule is counted, not hidden.
        warnings.simplefilter("ignore", ul.UnderlayWarning)
        posterior = ul.sample(case.problem(curve, noise), walkers=walkers, max_steps=max_steps, rng=rng)
    rows = {}
    for name in posterior.names:
        draws = posterior.of(name).ravel()
        few = rng.choice(draws, size=DRAWS, replace=False)
        low, high = np.quantile(draws, [0.05, 0.95])
        truth = curve.truth[name]
        rows[name] = {"rank": int((few < truth).sum()), "inside90": bool(low <= truth <= high)}
    return rows, posterior.diagnostics


def levels(case, seed):
    """Posterior probability below each true value of `replica`'s curve, without a Markov chain.

    Importance sampling from a Student distribution (4 degrees of freedom) whose mean and covariance are learnt
    in four rounds, from the curvature at the truth on: it must agree with the sampler on the same curves, and
    is quick enough for many more. For scenes with known noise.
    """
    rng = case.generator(seed)
    curve = case.draw(rng)
    problem = case.problem(curve)
    mean = problem.vector({name: curve.truth[name] for name in problem.names})
    told = information(problem, mean, problem.noises(mean)) + prior_information(problem, mean)
    covariance = 1.5 * np.linalg.inv(told)
    for draws in (3000, 3000, 3000, 3000, 8000):
        proposal = stats.multivariate_t(mean, covariance, df=4)
        vectors = proposal.rvs(draws, random_state=rng)
        ratio = problem.log_posterior(vectors) - proposal.logpdf(vectors)
        weights = np.exp(ratio - ratio.max())
        weights /= weights.sum()
        mean = weights @ vectors
        centred = vectors - mean
        # A little wider than the posterior, whose tails the weights must reach.
        covariance = 1.3 * (centred.T * weights) @ centred
    values = problem.physical(vectors)
    below = {
        name: float(weights[values[:, i] < curve.truth[name]].sum()) for i, name in enumerate(problem.names)
    }
    return below, float(1.0 / np.square(weights).sum())


def uniformity(ranks):
    """Chi-squared statistic and p-value of ranks 0 .. DRAWS against a uniform distribution in BINS bins."""
    counts, _ = np.histogram(ranks, bins=np.linspace(-0.5, DRAWS + 0.5, BINS + 1))
    result = stats.chisquare(counts)
    return float(result.statistic), float(result.pvalue)

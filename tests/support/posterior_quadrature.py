"""Posteriors by quadrature, with no chain and no draws: what a sampler's quantiles are compared with.

What acts linearly is integrated over for every place of a grid in the rest. With the ratio k = E2 / E held the
force is E times a curve, and with white noise of known size the likelihood is a normal in E: twenty nodes about
its middle do, whatever the prior. A baseline with a normal prior, or a flat one without a bound within reach, is
integrated in closed form. Cells in ln h, ln k, contact depth and Poisson's ratio begin as a coarse grid over the
whole prior; those that hold something, and their neighbours, are halved along the axis in which the posterior
changes most from one to the next, until it changes little in any. More halvings tell how far that was from the end.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import interpolate, special

import underlay as ul

E_PATH, E2_PATH, H_PATH = "layer.E", "substrate.E", "layer.thickness"
CONTACT, BASELINE = "instrument.contact_depth", "instrument.baseline"
LEVELS = (0.025, 0.5, 0.975)
NODES = 21
REACH = 5.5
# A place this far below the top holds nothing.
DEPTH = 9.0
# Cells of a line at first, by the number of axes; how many are kept while they are far too large; how many may be.
COARSE = {1: 400, 2: 48, 3: 20}
FEWEST_KEPT, MOST_CELLS = 2000, 250_000
# Mean change of the logarithm from a cell to the next below which the midpoint rule is exact: 0.8 for a normal in
# cells as wide as its standard deviation, whose sum is off by 2 exp(-2 pi^2). By the number of axes, for fewer
# cells carry less of what is summed over the nodes; and halvings after that.
LITTLE, EXTRA = {1: 0.05, 2: 0.3, 3: 0.8}, 1


@dataclass
class Reference:
    """Quantiles (SI) by name, (levels,), standard deviations of ln or of the number itself, and ln(evidence)."""

    quantiles: dict
    log_evidence: float
    cells: int
    #: Largest change of a quantile over the last halvings, in standard deviations of a normal as wide.
    error: float = 0.0


class Quadrature:
    """One problem with white noise of known size, a layer's E free, and a baseline of zero or a free one."""

    def __init__(self, problem, kept=FEWEST_KEPT):
        self.fewest_kept = kept
        (self.member,) = problem.members
        self.problem = problem
        self.names = problem.names
        self.sigma = float(self.member.noise.force)
        self.axes = [name for name in self.names if name not in (E_PATH, BASELINE)]
        self.priors = problem.priors

    def axis_range(self, name):
        """Range of an axis that holds all of its prior but 1e-7: of a logarithm where it is positive."""
        coordinate = self.problem.coordinates[self.names.index(name)]
        prior = coordinate.prior.truncated(coordinate.low, coordinate.high)
        low, high = prior.quantile(np.array([1e-7, 1.0 - 1e-7]))
        if name == E2_PATH:
            layer = self.priors[E_PATH].quantile(np.array([1e-7, 1.0 - 1e-7]))
            return np.log(low / layer[1]), np.log(high / layer[0])
        return (np.log(low), np.log(high)) if name == H_PATH else (low, high)

    def curves(self, places):
        """Force per E (N/Pa), (m, n), at places (m, axes); a row of nan where no law exists."""
        unit = float(self.member.base[E_PATH])
        physical = np.zeros((len(places), len(self.names)))
        for j, name in enumerate(self.names):
            if name == E_PATH:
                physical[:, j] = unit
            elif name != BASELINE:
                column = places[:, self.axes.index(name)]
                physical[:, j] = {E2_PATH: lambda q: unit * np.exp(q), H_PATH: np.exp}.get(name, lambda q: q)(
                    column
                )
        forces = np.empty((len(places), len(self.member.force)))
        for rows in np.array_split(np.arange(len(places)), max(1, len(places) // 2000)):
            read = self.member.readings(physical[rows], stiffness=False)
            forces[rows] = np.where(read.possible[:, None], read.contact / unit, np.nan)
        return forces

    def log_axis_prior(self, places):
        """ln density (m,) of the axes but the ratio of moduli."""
        total = np.zeros(len(places))
        for j, name in enumerate(self.axes):
            if name == H_PATH:
                h = np.exp(places[:, j])
                total += self.priors[name].log_density(h) + np.log(h)
            elif name != E2_PATH:
                total += self.priors[name].log_density(places[:, j])
        return total

    def weights(self, places):
        """ln posterior (m, nodes) with ln dE of the nodes in it, E (m, nodes), and the baseline's mean and sd."""
        force, n = self.member.force, len(self.member.force)
        curves = self.curves(places)
        baseline = BASELINE in self.names
        mean, precision = 0.0, 0.0
        if baseline:
            prior = self.priors[BASELINE]
            if isinstance(prior, ul.Normal):
                mean, precision = prior.mean, prior.sd**-2
            elif not isinstance(prior, ul.Uniform):
                raise TypeError(prior)
        else:
            mean = float(self.member.base[BASELINE])
        s2 = self.sigma**2
        ff, fy, f1 = (curves**2).sum(1), curves @ force, curves.sum(1)
        y1, yy = force.sum(), force @ force
        # Least squares in E with the baseline projected out; (E, b) then factorise.
        total = n / s2 + precision
        aa = ff / s2 - (f1 / s2) ** 2 / total if baseline else ff / s2
        middle_b = (y1 / s2 + mean * precision) / total if baseline else 0.0
        ay = (fy / s2 - f1 / s2 * middle_b) if baseline else (fy - f1 * mean) / s2
        with np.errstate(invalid="ignore", divide="ignore"):  # rows without a law are nan until the end
            best, width = ay / aa, aa**-0.5
        nodes = np.linspace(-REACH, REACH, NODES)
        E = best[:, None] + width[:, None] * nodes
        if baseline:
            constant = -0.5 * (yy / s2 + mean**2 * precision - total * middle_b**2)
            constant += 0.5 * np.log(2.0 * np.pi / total) + (
                0.5 * np.log(precision / (2.0 * np.pi))
                if precision
                else -np.log(self.priors[BASELINE].high - self.priors[BASELINE].low)
            )
        else:
            constant = -0.5 * ((force - mean) @ (force - mean)) / s2
        constant -= n * np.log(self.sigma) + 0.5 * n * np.log(2.0 * np.pi)
        fit = (
            constant
            + 0.5 * (aa * best**2)[:, None]
            - 0.5 * nodes**2
            + np.log(width * (nodes[1] - nodes[0]))[:, None]
        )
        positive = E > 0.0
        safe = np.where(positive, E, 1.0)
        fit = fit + self.priors[E_PATH].log_density(safe) + self.log_axis_prior(places)[:, None]
        if E2_PATH in self.axes:
            base = safe * np.exp(places[:, self.axes.index(E2_PATH)])[:, None]
            fit = fit + self.priors[E2_PATH].log_density(base) + np.log(base)
        b_mean = middle_b - E * (f1 / s2 / total)[:, None] if baseline else None
        value = np.where(positive & np.isfinite(fit), fit, -np.inf)
        return value, E, b_mean, total**-0.5 if baseline else 0.0

    def cells(self):
        """Refined cells level by level: their middles (m, axes), widths (axes,), and `weights` of the middles."""
        low, high = (
            np.array(ends) for ends in zip(*(self.axis_range(name) for name in self.axes), strict=True)
        )
        counts = np.full(len(low), COARSE[len(low)])
        index = np.array(list(itertools.product(*(range(n) for n in counts))))
        extra = EXTRA
        while True:
            width = (high - low) / counts
            places = low + (index + 0.5) * width
            found = self.weights(places)
            mass = special.logsumexp(found[0], axis=1)
            changes = _changes(index, mass)
            resolved = changes.max() < LITTLE[len(low)]
            if resolved or len(index) > MOST_CELLS:
                yield places, width, found
                extra -= 1
            if extra < 0 or len(index) > MOST_CELLS:
                return
            # Cells far larger than the posterior hide how high it is: there the best few thousand are kept.
            enough = np.sort(mass)[-min(self.fewest_kept, len(mass))]
            kept = mass > (mass.max() - DEPTH if resolved else min(mass.max() - DEPTH, enough))
            axis = int(np.argmax(changes))
            index = _halved(_with_neighbours(index[kept], counts), axis)
            counts[axis] *= 2

    def reference(self):
        """Quantiles and evidence."""
        if not self.axes:
            return self.answer(np.zeros((1, 0)), np.zeros(0), self.weights(np.zeros((1, 0))))
        answers = [self.answer(*level) for level in self.cells()]
        last = answers[-1]
        for before in answers[:-1]:
            for name, exact in last.quantiles.items():
                # Widths of a normal between its 2.5 and 97.5 % quantiles.
                off = np.abs(before.quantiles[name] - exact).max() / (exact[-1] - exact[0]) * 3.92
                last.error = max(last.error, float(off))
        if len(answers) == 1:
            last.error = float("inf")
        return last

    def answer(self, places, width, found):
        """Quantiles and evidence from cells of one width."""
        value, E, b_mean, b_sd = found
        value = value + np.log(width).sum()
        top = value.max()
        share = np.exp(value - top)
        quantiles = {}
        for name in self.names:
            if name in (E_PATH, E2_PATH):
                logs = np.log(np.where(E > 0.0, E, 1.0))
                ratio = places[:, self.axes.index(name)][:, None] if name == E2_PATH else 0.0
                quantiles[name] = np.exp(_quantiles(logs + ratio, share))
            elif name == BASELINE:
                quantiles[name] = _smeared(b_mean, share, b_sd)
            else:
                axis = self.axes.index(name)
                values = _binned(places[:, axis], share.sum(axis=1), width[axis])
                quantiles[name] = np.exp(values) if name == H_PATH else values
        return Reference(quantiles, float(np.log(share.sum()) + top), value.size)


def _changes(index, mass):
    """Mean change of ln(mass) from a cell to the next along each axis, weighed by mass."""
    rows = {tuple(entry): row for row, entry in enumerate(index)}
    heavy = np.flatnonzero(mass > mass.max() - 4.0)
    weight = np.exp(mass[heavy] - mass.max())
    changes = []
    for axis in range(index.shape[1]):
        ahead = index[heavy].copy()
        ahead[:, axis] += 1
        other = np.array([rows.get(tuple(entry), -1) for entry in ahead])
        next_mass = np.where(other >= 0, mass[other], -np.inf)
        changes.append(np.average(np.minimum(np.abs(next_mass - mass[heavy]), 10.0), weights=weight))
    return np.array(changes)


def _with_neighbours(index, counts):
    """Cells and those that touch them along an axis, each once."""
    steps = np.concatenate(
        [np.zeros((1, index.shape[1]), int), *(s * np.eye(index.shape[1], dtype=int) for s in (1, -1))]
    )
    every = (index[:, None] + steps).reshape(-1, index.shape[1])
    return np.unique(every[((every >= 0) & (every < counts)).all(axis=1)], axis=0)


def _halved(index, axis):
    """Both halves of every cell along an axis."""
    halves = np.repeat(index, 2, axis=0)
    halves[:, axis] = 2 * halves[:, axis] + np.tile([0, 1], len(index))
    return halves


def _binned(middles, share, width):
    """Quantiles of bins of one width, their mass even over them."""
    bins, back = np.unique(np.round((middles - middles.min()) / width).astype(int), return_inverse=True)
    mass = np.bincount(back, weights=share)
    # Slopes of the spline divide by it.
    mass += 1e-14 * mass.sum()
    edges = middles.min() + (np.append(bins, bins[-1] + 1) - 0.5) * width
    upto = np.append(0.0, np.cumsum(mass)) / mass.sum()
    fine = np.linspace(edges[0], edges[-1], 20_001)
    return np.interp(LEVELS, interpolate.PchipInterpolator(edges, upto)(fine), fine)


def _quantiles(values, share):
    """Quantiles of nodes; those at one value are one, and half of each lies below it."""
    kept = share > 1e-12 * share.max()
    ordered, back = np.unique(values[kept], return_inverse=True)
    mass = np.bincount(back, weights=share[kept])
    upto = np.cumsum(mass) - 0.5 * mass
    return np.interp(np.array(LEVELS) * mass.sum(), upto, ordered)


def _smeared(means, share, sd):
    """Quantiles of a mixture of normals of one width."""
    kept = share > 1e-9 * share.max()
    m, w = means[kept], share[kept] / share[kept].sum()
    edges = np.linspace(m.min(), m.max() + 1e-300, 4001)
    counts, _ = np.histogram(m, edges, weights=w)
    middles = 0.5 * (edges[1:] + edges[:-1])
    ends = np.linspace(m.min() - 6.0 * sd, m.max() + 6.0 * sd, 1200)
    upto = np.array([counts @ special.ndtr((x - middles) / sd) for x in ends])
    return np.interp(LEVELS, upto, ends)


def reference(problem, kept=FEWEST_KEPT):
    """Quadrature of a problem's posterior; `kept` cells while they are too large: a thin wing may need many."""
    return Quadrature(problem, kept).reference()

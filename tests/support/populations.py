"""Made studies: curves' likelihoods of several sites of several animals, with a known mean."""

import math

import numpy as np
import pandas as pd

from underlay._csv import csv_text
from underlay.inference.population.likelihood import ROOTS, CurveLikelihood


def made_study(rng, *, animals, sites, between, within, mean=0.0, errors=(0.03, 0.3), openness=0.0):
    """Likelihoods and labels of one study.

    With `openness` curves measure a compliance 1/E with that error (of 1/exp(mean)): stiff ones are open upwards.
    """
    curves, labels = [], []
    for animal in range(animals):
        step = between * rng.normal()
        for _ in range(sites):
            value = mean + step + within * rng.normal()
            labels.append((f"a{animal}",))
            if openness:
                curves.append(_of_compliance(math.exp(-value) + openness * rng.normal(), openness))
            else:
                error = math.exp(rng.uniform(*map(math.log, errors)))
                curves.append(CurveLikelihood(tuple((value + error * (rng.normal() + ROOTS)).tolist())))
    return curves, labels


def _of_compliance(measured, error):
    """Likelihood of ln E where 1/E was measured: it levels off at 1/E = 0."""
    best = max(measured, 1e-3 * error)
    floor = max(measured / error, 0.0) if measured > 0.0 else 0.0
    places = []
    for root in ROOTS:
        compliance = _at_root(measured, error, best, -root)
        places.append(-math.log(compliance) if compliance > 0.0 else math.inf)
    return CurveLikelihood(tuple(places), above=floor if floor < ROOTS[-1] else math.inf)


def _at_root(measured, error, best, root):
    """Compliance at a signed root of the likelihood relative to its largest over positive compliances."""
    least = 0.5 * ((best - measured) / error) ** 2
    away = math.sqrt(2.0 * (0.5 * root**2 + least))
    return best if root == 0.0 else measured + error * math.copysign(away, root)


def table_of(curves, labels, **columns):
    """The table of a map with these likelihoods."""
    middles = [math.exp(one.middle) for one in curves]
    return pd.DataFrame(
        {
            "name": [f"curve {i}" for i in range(len(curves))],
            "status": "fitted",
            "verdict": "good",
            "animal": [label[0] for label in labels],
            "layer.E": middles,
            "layer.E.stderr": [e * one.error for e, one in zip(middles, curves, strict=True)],
            "layer.E.likelihood": ["" if one.is_normal else one.as_text() for one in curves],
            **columns,
        }
    )


def write_study(path, *, group):
    """Write the table of a map of two groups of three animals, `group` being the column that says which."""
    rng = np.random.default_rng(6)
    tables = []
    for name in ("sham", "treated"):
        curves, labels = made_study(rng, animals=3, sites=3, between=0.2, within=0.2, mean=math.log(5e5))
        tables.append(table_of(curves, labels, reason="", **{group: name}))
    path.write_text(csv_text(pd.concat(tables, ignore_index=True)), encoding="utf-8")

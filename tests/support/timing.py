"""Commands that time things, made short: how often each is timed or drawn changes nothing but the time."""

import underlay as ul
from underlay.inference import answer_cost as answers
from underlay.inference import answer_cost as posteriors


def timed_once(monkeypatch):
    """Let `accuracy` time each law once and few of them in fits."""
    for timed in (ul.accuracy_cost, ul.answer_cost):
        monkeypatch.setitem(timed.__kwdefaults__, "rounds", 1)
    monkeypatch.setitem(ul.posterior_cost.__kwdefaults__, "steps", (20,))
    monkeypatch.setattr(posteriors, "_REFERENCES", 2)
    monkeypatch.setattr(
        answers, "compared_solvers", lambda: (ul.HalfSpace(), ul.Asymptotic(), ul.Exact(1e-6), ul.Auto())
    )

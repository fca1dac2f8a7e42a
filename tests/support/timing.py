"""Commands that time things, made short: how often each is timed or drawn changes nothing but the time."""

from functools import partial

import underlay as ul
from underlay.inference import answer_cost as answers
from underlay.inference import answer_cost as posteriors
from underlay.report import bench, bench_users


def timed_once(monkeypatch):
    """Let `accuracy` time each law once and few of them in fits, and `bench` one row of each of its tables."""
    for timed in (ul.accuracy_cost, ul.answer_cost):
        monkeypatch.setitem(timed.__kwdefaults__, "rounds", 1)
    monkeypatch.setitem(ul.posterior_cost.__kwdefaults__, "steps", (20,))
    monkeypatch.setattr(posteriors, "_REFERENCES", 2)
    monkeypatch.setattr(
        answers, "compared_solvers", lambda: (ul.HalfSpace(), ul.Asymptotic(), ul.Exact(1e-6), ul.Auto())
    )
    few, fits = (tuple(case for case in bench.CASES if case.is_fit is fit)[:1] for fit in (False, True))
    monkeypatch.setattr(bench, "bench_table", partial(bench.bench_table, few, rounds=1))
    monkeypatch.setattr(bench, "fit_table", partial(bench.fit_table, fits, rounds=1))
    monkeypatch.setattr(bench, "depth_table", partial(bench.depth_table, (10,), rounds=1))
    user = tuple(case for case in bench_users.USER_CASES if case.what == "reading a plain CSV of 1000 points")
    monkeypatch.setattr(bench_users, "user_table", partial(bench_users.user_table, user, rounds=1))

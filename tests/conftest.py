"""What is made once for all tests because it takes seconds: the pages of fits and of a posterior."""

import pytest

import underlay as ul
from support.reports import SAMPLES, joint_fit, small_posterior


@pytest.fixture(scope="session")
def report_pages(tmp_path_factory):
    """``{"fit": (fit, page), "joint": (fit, page), "posterior": (posterior, page)}``, the pages written."""
    folder = tmp_path_factory.mktemp("pages")
    problem = ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml")
    fit = ul.fit(problem)
    joint = joint_fit()
    sampled, posterior = small_posterior()
    return {
        "fit": (fit, ul.report(fit, folder / "fit.html")),
        "joint": (joint, ul.report(joint, folder / "joint.html")),
        "posterior": (posterior, ul.report(posterior, folder / "posterior.html", problem=sampled)),
    }

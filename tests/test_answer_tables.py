"""What the page on uncertainty says was measured is what the stored results say."""

from support.answer_tables import HOLDERS, PAGES, filled, stored
from support.worlds import NOISES


def test_pages_hold_the_stored_tables():
    for page in HOLDERS:
        assert (PAGES / page).read_text(encoding="utf-8") == filled(page)


def test_statistical_parts_cover_and_their_control_fails():
    """200 curves a world: three deviations of 95 % are 4.6 %. Turns and kinks that hardly show are too short."""
    worlds = stored("worlds_E").set_index("kind")
    short = ["ramp that turns", "kinked baseline"]
    assert (worlds["covered %"].drop(short) > 95.0 - 4.6).all()
    assert (worlds.loc[short, "covered %"] > 80.0).all()
    correlated = ["AR(1)", "AR(1) and white", "random walk", "1/f", "drag step", "adhesion"]
    assert (worlds.loc[correlated, "white covered %"] < 60.0).all()
    clean = worlds.loc["clean"]
    assert clean["width, geometric"] < 1.4


def test_intervals_are_short_for_what_they_hold():
    """Winkler's score over that of white noise, all worlds of noise together."""
    noise = stored("worlds_E").set_index("kind").loc[list(NOISES)]
    assert noise["score"].sum() < 0.19 * noise["score of white"].sum()


def test_hard_curves_come_out_as_they_should():
    found = stored("hard").set_index("kind")
    assert found.loc["gradual contact", "as it should"] == found.loc["gradual contact", "curves"] == 8
    assert found.loc["soft lever", "as it should"] >= 28
    assert (found["as it should"] >= 0.9 * found["curves"]).all()


def test_clean_curves_are_good():
    verdicts = stored("verdicts").set_index("kind")
    clean = verdicts.loc[["clean, h known", "clean, h free"]]
    assert (clean["not good"] <= 0.02 * clean["curves"]).all()

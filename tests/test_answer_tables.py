"""What the page on uncertainty says was measured is what the stored results say."""

from support.answer_tables import HOLDERS, PAGES, filled, stored


def test_pages_hold_the_stored_tables():
    for page in HOLDERS:
        assert (PAGES / page).read_text(encoding="utf-8") == filled(page)


def test_statistical_parts_cover_and_their_control_fails():
    """200 curves a world: three deviations of 95 % are 4.6 %. A ramp that turns is known to be too short."""
    worlds = stored("worlds_E").set_index("kind")
    assert (worlds["covered %"].drop("ramp that turns") > 95.0 - 4.6).all()
    correlated = ["AR(1)", "AR(1) and white", "random walk", "1/f", "drag step", "adhesion"]
    assert (worlds.loc[correlated, "white covered %"] < 60.0).all()
    clean = worlds.loc["clean"]
    assert clean["width, geometric"] < 1.25


def test_clean_curves_are_good():
    verdicts = stored("verdicts").set_index("kind")
    clean = verdicts.loc[["clean, h known", "clean, h free"]]
    assert (clean["not good"] <= 0.02 * clean["curves"]).all()

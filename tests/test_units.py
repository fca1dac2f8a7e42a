"""Units at the border: what is written is what is meant, and what is not understood is refused."""

import contextlib
import math
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import underlay as ul
from underlay import units as reading
from underlay.units import KINDS, format_quantity, human_unit, kind_of, parse_quantity, unit_factor


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("1.5 mm", "length", 1.5e-3),
        ("1.5mm", "length", 1.5e-3),
        ("27.5 um", "length", 27.5e-6),
        ("27.5 \u00b5m", "length", 27.5e-6),  # micro sign
        ("27.5 \u03bcm", "length", 27.5e-6),  # Greek mu
        ("0.4 MPa", "pressure", 4e5),
        ("0.4 N/mm^2", "pressure", 4e5),
        ("0.4 N/mm²", "pressure", 4e5),
        ("20 uN", "force", 2e-5),
        ("1 gf", "force", 9.80665e-3),
        ("1 kgf", "force", 9.80665),
        ("250 Å", "length", 2.5e-8),
        ("250 \u212b", "length", 2.5e-8),
        ("35 deg", "angle", math.radians(35)),
        ("35°", "angle", math.radians(35)),
        ("0.019 N/m", "stiffness", 0.019),
        ("2 nm/mN", "compliance", 2e-6),
        ("0.45", "dimensionless", 0.45),
        (0.45, "dimensionless", 0.45),
        ("45 %", "dimensionless", 0.45),
        ("60 nm/V", "sensitivity", 6e-8),
        ("-3e-2 s", "time", -0.03),
    ],
)
def test_quantities_are_read_as_written(text, kind, value):
    # 4 ulp: one rounding each for the number, the factor and their product.
    assert parse_quantity(text, kind) == pytest.approx(value, rel=4 * sys.float_info.epsilon)


@pytest.mark.parametrize("text", ["1.5 mm", "0.3 mm", "1.1 um", "7.7 nm", "0.7 kPa"])
def test_a_decimal_with_a_decimal_prefix_is_the_nearest_double(text):
    number, unit = text.split()
    shift = {"mm": "e-3", "um": "e-6", "nm": "e-9", "kPa": "e3"}[unit]
    kind = "pressure" if unit == "kPa" else "length"
    assert parse_quantity(text, kind) == float(number + shift)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"dimensionless"}))
def test_a_bare_number_is_refused_where_a_unit_is_needed(kind):
    with pytest.raises(ul.UnitError, match="no unit") as told:
        parse_quantity("3.0", kind)
    assert KINDS[kind].units[-1] in str(told.value)


def test_a_length_where_a_pressure_belongs_names_both():
    with pytest.raises(ul.UnitError, match=r"'mm' is a unit of length, but a pressure is needed"):
        parse_quantity("5 mm", "pressure")


@pytest.mark.parametrize(
    ("text", "kind", "meant"),
    [
        ("6 Mm", "length", "mm"),
        ("10 mPa", "pressure", "MPa"),
        ("2 MN", "force", "mN"),
        ("5 Ms", "time", "ms"),
        ("3 mPa/m", "stiffness per area", "MPa/m"),
    ],
)
def test_a_slip_of_the_shift_key_is_not_a_factor_of_1e9(text, kind, meant):
    with pytest.raises(ul.UnitError, match=f"did you mean {meant}\\? allowed"):
        parse_quantity(text, kind)


def test_slow_oscillations_are_measured_in_millihertz():
    assert parse_quantity("10 mHz", "frequency") == pytest.approx(0.01)


def test_an_angle_is_not_a_dimensionless_number():
    with pytest.raises(ul.UnitError, match="unit of angle"):
        parse_quantity("35 deg", "dimensionless")


@pytest.mark.parametrize(
    "text",
    [
        "3 parsnips", "3 m**999999999", "3 m^-12", "three mm", "", "mm", "1e999 mm", "nan mm", "inf mm",
        "1 2 mm", "3 __import__('os')", "3 (((((", "3 " + "m " * 30, "1_0 mm", "0x10 mm", "1,5 mm",
    ],
)  # fmt: skip
def test_rubbish_is_a_unit_error(text):
    with pytest.raises(ul.UnitError):
        parse_quantity(text, "length")


@pytest.mark.parametrize("value", [None, True, [1.0], {"m": 1}, b"1 mm"])
def test_what_is_no_text_or_number_is_a_unit_error(value):
    with pytest.raises(ul.UnitError):
        parse_quantity(value, "length")


@given(st.text(max_size=60))
def test_any_text_is_a_number_or_our_error(text):
    with contextlib.suppress(ul.UnitError):
        assert math.isfinite(parse_quantity(text, "length"))


def test_an_unknown_kind_is_named():
    with pytest.raises(ul.InputError, match=r"no kind of quantity 'colour'; there are length, pressure"):
        parse_quantity("1 mm", "colour")


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (4.2e5, "pressure", "0.42 MPa"),
        (1.2e4, "pressure", "12 kPa"),
        (3.1e9, "pressure", "3.1 GPa"),
        (50.0, "pressure", "50 Pa"),
        (27.5e-6, "length", "27.5 um"),
        (1.5e-3, "length", "1.5 mm"),
        (3e-9, "length", "3 nm"),
        (2e-8, "force", "20 nN"),
        (-2e-5, "force", "-20 uN"),
        (math.radians(35), "angle", "35 deg"),
        (0.45, "dimensionless", "0.45"),
        (0.0, "length", "0 mm"),
    ],
)
def test_people_read_a_unit_of_the_size(value, kind, text):
    assert format_quantity(value, kind) == text


def test_the_uncertainty_sets_the_digits():
    assert format_quantity(1.50342e-3, "length", 2.1e-5) == "1.503 ± 0.021 mm"
    assert format_quantity(1.50342e-3, "length", 0.0) == "1.503 mm"
    assert format_quantity(1.5e-3, "length", float("nan")) == "1.5 mm"


@given(st.floats(min_value=1e-12, max_value=1e12), st.sampled_from(sorted(KINDS)))
def test_what_is_written_for_people_reads_back(value, kind):
    # format_quantity shows four significant digits.
    assert parse_quantity(format_quantity(value, kind), kind) == pytest.approx(value, rel=6e-4)


@given(st.floats(min_value=1e-9, max_value=1e9))
def test_the_human_unit_is_the_largest_with_at_least_a_tenth(value):
    unit, factor = human_unit(value, "force")
    assert factor == unit_factor(unit, "force")
    larger = [unit_factor(other, "force") for other in KINDS["force"].units]
    larger = [other for other in larger if other > factor]
    assert value >= 0.0999 * factor or factor == unit_factor("pN", "force")
    assert all(value < 0.1001 * other for other in larger)


def test_kinds_of_units():
    assert kind_of("gf") == "force"
    assert kind_of("m/N") == "compliance"
    assert kind_of("K") is None
    assert kind_of("") == "dimensionless"


@pytest.mark.parametrize("prefix", sorted(reading._PREFIXES))
@pytest.mark.parametrize(
    "text", [*reading._BASES, "N/m", "m/N", "m/s", "N/s", "m/V", "m/A", "um/nN", "nm/kN"]
)
def test_the_small_table_reads_what_pint_reads(prefix, text):
    fast, full = reading._parse_simple(prefix + text), reading._parse_any(prefix + text)
    known = text != "A" and not (prefix and text in {"um/nN", "nm/kN"})  # no current, no second prefix
    assert (fast is not None) == known
    if fast is not None:
        assert fast[0] == full[0]
        # One rounding for each prefix in pint's product.
        assert fast[1] == pytest.approx(full[1], rel=4 * sys.float_info.epsilon)


def test_every_unit_for_people_is_in_the_small_table():
    for kind, of in KINDS.items():
        for unit in of.units:
            assert reading._parse_simple(unit)[0] == kind


def test_mechanics_does_not_import_pint():
    code = (
        "import sys, types, pathlib\n"
        "root = pathlib.Path(sys.argv[1])\n"
        "package = types.ModuleType('underlay'); package.__path__ = [str(root / 'underlay')]\n"
        "sys.modules['underlay'] = package\n"  # the package without its own list of names
        "import underlay.mechanics.solvers\n"
        "assert not {'pint', 'pandas', 'lmfit', 'matplotlib'} & set(sys.modules)\n"
    )
    root = Path(__file__).resolve().parents[1] / "src"
    subprocess.run([sys.executable, "-c", code, str(root)], check=True)

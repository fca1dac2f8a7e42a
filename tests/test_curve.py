"""The curve: read-only, SI, checked once, and refused in one clear line when it cannot be fitted."""

import pickle

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from underlay.data.curve import Metadata, check_fittable


def ramp(points=20):
    depth = np.linspace(0.0, 1e-6, points)
    return ul.Curve(depth, 1e-3 * depth**1.5, time=np.arange(points) * 0.1, metadata={"name": "ramp"})


def test_arrays_are_copies_and_read_only():
    depth = np.linspace(0.0, 1e-6, 5)
    curve = ul.Curve(depth, depth)
    depth[0] = 7.0
    assert curve.depth[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        curve.depth[0] = 1.0
    with pytest.raises(AttributeError):
        curve.depth = depth


def test_parts_and_notes_share_what_nobody_can_write_to():
    curve = ramp()
    whole = curve.loading().with_metadata(note="same points")
    assert np.shares_memory(whole.depth, curve.depth)
    assert np.shares_memory(whole.force, curve.force)
    # A view that is read-only, of memory that is not, is a copy.
    depth = np.linspace(0.0, 1e-6, 5)
    view = depth[:]
    view.flags.writeable = False
    assert not np.shares_memory(ul.Curve(view, view).depth, depth)


def test_one_label_for_all_points_is_kept_once():
    labels = ramp(1000).loading().segment
    assert labels.strides == (0,)
    assert labels.shape == (1000,)
    assert (labels == "loading").all()
    again = pickle.loads(pickle.dumps(ramp(1000).loading()))  # noqa: S301  our own
    np.testing.assert_array_equal(again.segment, labels)
    assert len(again.select(slice(3, 7)).segment) == 4
    with pytest.raises(ul.CurveError, match="segment holds 'sideways'"):
        ul.Curve([0.0, 1.0], [0.0, 1.0], segment=np.broadcast_to(np.array("sideways"), (2,)))


def test_a_series_is_as_good_as_an_array():
    series = pd.Series([0.0, 1.0, 2.0], index=[5, 6, 7])
    curve = ul.Curve(series, series * 2, time=series, segment=pd.Series(["loading", "hold", "unloading"]))
    np.testing.assert_array_equal(curve.force, [0.0, 2.0, 4.0])
    assert len(curve) == 3


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        (([1.0, 2.0], [1.0]), "force has 1 points but depth has 2"),
        (([[1.0, 2.0]], [1.0]), r"shape \(1, 2\)"),
        ((["a"], [1.0]), "depth must hold numbers"),
        (([1.0], [1.0], [1.0, 2.0]), "time has 2 points"),
        (([1.0], [1.0], None, ["up"]), "segment holds 'up'; allowed are loading, hold, unloading"),
        (([1.0], [1.0], None, ["unloading again"]), "unloading again"),
        (([1.0], [1.0], None, ["hold", "hold"]), "segment has 2 points"),
    ],
)
def test_what_is_no_curve_is_refused(columns, told):
    with pytest.raises(ul.CurveError, match=told):
        ul.Curve(*columns)


def test_metadata_are_plain_immutable_and_travel():
    curve = ramp().with_metadata(position=[1.0, 2.0], header={"a": np.float64(1.5)}, truth_is=None)
    assert curve.metadata["position"] == (1.0, 2.0)
    with pytest.raises(TypeError):
        curve.metadata["name"] = "other"
    again = pickle.loads(pickle.dumps(curve))  # noqa: S301  our own bytes
    assert again.metadata == curve.metadata
    assert Metadata(again.metadata).to_dict()["header"] == {"a": 1.5}
    with pytest.raises(ul.InputError, match="must be text, a number"):
        curve.with_metadata(file=open)


def test_frames_go_both_ways():
    curve = ul.Curve([0.0, 1.0], [2.0, 3.0], [0.0, 0.1], ["loading", "hold"], {"name": "x"})
    frame = curve.to_frame()
    again = ul.Curve.from_frame(frame)
    for column in ("depth", "force", "time", "segment"):
        np.testing.assert_array_equal(getattr(again, column), getattr(curve, column))
    assert again.metadata["name"] == "x"
    frame.loc[0, "depth"] = 9.0  # a copy: the curve does not change
    assert curve.depth[0] == 0.0


def test_a_missing_column_names_those_that_are_there():
    with pytest.raises(ul.CurveError, match="no column 'force'; it has 'depth', 'load'"):
        ul.Curve.from_frame(pd.DataFrame({"depth": [1.0], "load": [2.0]}))


def test_points_are_selected_by_mask_slice_and_index():
    curve = ramp(10)
    assert len(curve.select(curve.depth > 5e-7)) == 5
    assert len(curve.select(slice(2, 4))) == 2
    np.testing.assert_array_equal(curve.select([3, 1]).time, curve.time[[3, 1]])
    assert len(curve.select([])) == 0
    with pytest.raises(ul.CurveError, match="cannot select"):
        curve.select([99])


def test_a_given_segment_is_used_and_else_the_motion():
    depth = np.concatenate((np.linspace(0, 1, 50), np.ones(50), np.linspace(1, 0, 50))) * 1e-6
    moved = ul.Curve(depth, depth, time=np.arange(150) * 0.1)
    # The first and the last point at rest belong to either side.
    assert [len(part) for part in (moved.loading(), moved.hold(), moved.unloading())] == [50, 51, 49]
    named = ul.Curve(depth, depth, segment=["hold"] * 150)
    assert len(named.loading()) == 0
    assert len(named.hold()) == 150


@pytest.mark.parametrize(
    ("curve", "told"),
    [
        (ramp(7), "has 7 points; at least 8"),
        (ul.Curve(np.append(np.arange(9.0), np.nan), np.ones(10)), "depth holds nan at point 9"),
        (ul.Curve(np.arange(10.0), np.append(np.ones(9), np.inf)), "force holds inf at point 9"),
        (ul.Curve(-np.arange(10.0), np.ones(10)), "depth never increases"),
        (ul.Curve(np.ones(10), np.ones(10)), "depth never increases"),
        (ul.Curve(np.arange(10.0), np.zeros(10)), "force is zero at every point"),
    ],
)
def test_a_curve_that_cannot_be_fitted_says_why_in_one_line(curve, told):
    with pytest.raises(ul.CurveError, match=told) as refusal:
        check_fittable(curve)
    assert "\n" not in str(refusal.value)


def test_no_point_beyond_a_known_contact():
    check_fittable(ramp())
    check_fittable(ramp(), contact_depth=0.5e-6)
    with pytest.raises(ul.CurveError, match="no point beyond contact"):
        check_fittable(ramp(), contact_depth=2e-6)

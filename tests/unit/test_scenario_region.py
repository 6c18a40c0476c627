"""Regions of a scenario: faces, corners, centre and radius against one another and against the core."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fleet import _core
from fleet.scenario.polyhedron import GeometryError, corners, largest_ball
from fleet.scenario.region import Region, from_box, from_prism, from_regular_prism

quick = settings(max_examples=40, deadline=None, derandomize=True)
place = st.tuples(*[st.floats(-20, 20).map(lambda x: round(x, 3))] * 3)
size = st.tuples(*[st.floats(0.1, 10).map(lambda x: round(x, 3))] * 3)


def box(low, sides):
    return from_box("r", low, np.add(low, sides))


@st.composite
def solids(draw):
    """A polyhedron around a random point: faces touch a random ellipsoid, closed by a box."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    normals = rng.normal(size=(draw(st.integers(0, 8)), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    center = np.array(draw(place))
    A = np.vstack((np.eye(3), -np.eye(3), normals))
    b = A @ center + rng.uniform(0.5, 3.0, len(A))
    # Rows of any length describe the same solid.
    scale = rng.uniform(0.1, 10.0, len(A))
    return Region("r", A * scale[:, None], b * scale)


@quick
@given(solids())
def test_corners_span_the_region(region):
    """Every corner is on at least three faces and in none's far side; their hull has the inner ball."""
    slack = region.b - region.vertices @ region.A.T
    assert slack.min() > -1e-7
    assert (np.sum(slack < 1e-6, axis=1) >= 3).all()
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reach = (region.vertices - region.center) @ directions.T
    assert (reach.max(axis=0) >= region.inradius - 1e-6).all()


@quick
@given(solids())
def test_the_inner_ball_is_inside_and_cannot_grow(region):
    assert region.depth(region.center) == pytest.approx(region.inradius, abs=1e-6)
    around = region.center + np.random.default_rng(2).normal(size=(500, 3))
    assert max(region.depth(point) for point in around) <= region.inradius + 1e-9


@quick
@given(region=solids(), seed=st.integers(0, 2**32 - 1))
def test_depth_is_the_cores(region, seed):
    points = np.random.default_rng(seed).normal(size=(20, 3)) * 5 + region.center
    mine = [region.depth(point) for point in points]
    assert mine == pytest.approx(_core.inside(region.faces, points), abs=1e-12)
    assert np.linalg.norm(region.A, axis=1) == pytest.approx(np.ones(len(region.b)), abs=1e-14)


@quick
@given(place, size)
def test_closed_form_of_a_box_is_the_general_one(low, sides):
    region = box(low, sides)
    center, radius = largest_ball(region.A, region.b)
    assert region.inradius == pytest.approx(radius, abs=1e-7)
    assert region.center == pytest.approx(center, abs=1e-6)
    found = corners(region.A, region.b, region.center)
    gaps = np.linalg.norm(found[:, None] - region.vertices[None], axis=2)
    assert found.shape == (8, 3)
    assert gaps.min(axis=0).max() < 1e-6


@quick
@given(sides=st.integers(3, 12), apothem=st.floats(0.5, 5), height=st.floats(0.5, 20), at=place)
def test_regular_prism_is_the_prism_over_its_own_corners(sides, apothem, height, at):
    low, high = at[2], at[2] + height
    regular = from_regular_prism("r", at[:2], apothem, sides, low=low, high=high)
    base = regular.vertices[::2, :2]
    for ring in (base, base[::-1]):
        region = from_prism("r", ring.tolist(), low, high)
        assert region.inradius == pytest.approx(regular.inradius, abs=1e-6)
        points = np.random.default_rng(sides).normal(size=(50, 3)) * 5 + regular.center
        assert [region.depth(p) for p in points] == pytest.approx(
            [regular.depth(p) for p in points], abs=1e-9
        )


@quick
@given(solids(), solids())
def test_overlap_is_symmetric_and_agrees_with_corners(first, second):
    assert first.overlaps(second) == second.overlaps(first)
    if first.depth(second.center) > 1e-6 or any(first.depth(v) > 1e-3 for v in second.vertices):
        assert first.overlaps(second)
    moved = Region("r", second.A, second.b + second.A @ np.array([500.0, 0, 0]))
    assert not first.overlaps(moved)


@quick
@given(place, size, place, size)
def test_overlap_of_boxes(low, sides, other_low, other_sides):
    gaps = np.minimum(np.add(low, sides), np.add(other_low, other_sides)) - np.maximum(low, other_low)
    assume(np.all(np.abs(gaps) > 1e-6))
    assert box(low, sides).overlaps(box(other_low, other_sides)) == bool((gaps > 0).all())


@quick
@given(place, size, st.floats(0.01, 0.99), st.floats(1.01, 3))
def test_covers(low, sides, smaller, larger):
    region = box(low, sides)
    for factor, covered in ((smaller, True), (larger, False)):
        half = np.array(sides) / 2 * factor
        inner = from_box("i", region.center - half, region.center + half)
        assert region.covers(inner) == covered


@pytest.mark.parametrize("turns", [2, 3])
def test_star_is_not_a_base(turns):
    """A star polygon turns one way at each corner, but more than once in all."""
    count = 2 * turns + 1
    angles = 2 * np.pi * turns / count * np.arange(count)
    with pytest.raises(GeometryError, match="convex"):
        from_prism("star", np.column_stack((np.cos(angles), np.sin(angles))).tolist(), 0.0, 1.0)


def test_box_is_bit_exact():
    """The faces of a box are those of `Polyhedron::from_box`, without rounding."""
    region = from_box("b", [-5.8, -3.0, 17.5], [-3.8, -1.0, 19.5])
    assert region.center.tolist() == [-4.8, -2.0, 18.5]
    assert region.inradius == 1.0
    normals = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    offsets = [-3.8, 5.8, -1.0, 3.0, 19.5, -17.5]
    assert region.wire() == {
        "name": "b",
        "shape": [{"a": a.tolist(), "b": b} for a, b in zip(normals, offsets, strict=True)],
    }
    corner_set = set(itertools.product((-5.8, -3.8), (-3.0, -1.0), (17.5, 19.5)))
    assert set(map(tuple, region.vertices.tolist())) == corner_set


def test_arrays_cannot_be_changed():
    region = from_box("b", [0, 0, 0], [1, 1, 1])
    for array in (region.A, region.b, region.center):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9

"""The depth sensor against closed forms of simple scenes."""

import numpy as np
import pytest

from tasks.simulation.materials import DARK, GLASS, MATT
from tasks.simulation.mesh import Mesh
from tasks.simulation.noise import NoiseParams, measured, mixed, returned
from tasks.simulation.sensor import Scene, SensorParams, Views, capture
from tasks.simulation.volunteers import looking

EXACT = NoiseParams(disparity_step=0.0, jitter_px=0.0, mixing=0.0)
WIDE = {"rays": 10**6, "baseline_m": 0.0}
"""All pixels, no shadow."""


def plate(y, x=(-9, 9), z=(-9, 9), material=MATT, lean=0.0):
    """Return a rectangle across y; it leans back by `lean` metres per metre of height."""
    corners = [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])]
    vertices = np.array([(u, y + lean * v, v) for u, v in corners], np.float32)
    triangles = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)
    return Mesh(vertices, triangles, np.full(2, material, np.uint8))


def scene(*plates, threads=0):
    return Scene(
        Mesh(
            np.concatenate([p.vertices for p in plates]),
            np.concatenate([p.triangles + np.uint32(4 * i) for i, p in enumerate(plates)]),
            np.concatenate([p.materials for p in plates]),
        ),
        threads,
    )


def level(k=1, rate=0.0):
    """Return k views from the origin along y, upright."""
    zeros = np.zeros(k)
    return Views(np.zeros((k, 3)), looking(zeros, zeros, zeros), np.full(k, rate))


def seen(scene, views=None, seed=0, **params):
    """Return right, up and ahead of the points, metres."""
    params = SensorParams(**({"noise": EXACT} | WIDE | params))
    views = level() if views is None else views
    points = capture(scene, views, params, np.random.default_rng(seed)).points.astype(float)
    return points * (1, 1, -1)


def test_all_pixels_see_a_wall_ahead_as_a_pinhole_does():
    right, up, ahead = seen(scene(plate(2.0))).T
    params = SensorParams()
    column, row = (u * params.focal_px / ahead for u in (right, -up))
    assert len(ahead) == params.columns * params.rows
    assert ahead == pytest.approx(2.0, abs=1e-5)
    # centres of pixels: halves, an equal number on both sides
    assert (column.min(), column.max()) == pytest.approx((-89.5, 89.5), abs=1e-3)
    assert (row.min(), row.max()) == pytest.approx((-159.5, 159.5), abs=1e-3)
    assert np.unique(np.rint(column * 2) % 2) == [1]


def test_points_are_in_the_frame_of_the_device_however_it_is_held():
    views = Views(
        np.array([(0.3, -0.2, 1.0)]), looking(*np.array([[0.4], [-0.3], [0.2]])), np.zeros(1)
    )
    right, up, ahead = seen(scene(plate(2.0)), views).T
    # the wall's plane in the device frame, from the angles alone: Rz(h) Rx(90 + p) Rz(t)
    h, p, t = 0.4, -0.3, 0.2
    forward = np.cos(h) * np.cos(p)
    x = np.sin(h) * np.cos(t) + np.cos(h) * -np.sin(p) * np.sin(t)
    y = -np.sin(h) * np.sin(t) + np.cos(h) * -np.sin(p) * np.cos(t)
    assert len(ahead) > 1000
    assert x * right + y * up + forward * ahead == pytest.approx(2.2, abs=1e-5)


@pytest.mark.parametrize("metres", [0.49, 4.01])
def test_nothing_is_seen_nearer_or_farther_than_the_range(metres):
    assert len(seen(scene(plate(metres)))) == 0


def test_a_snapshot_holds_no_more_points_than_the_limit():
    params = SensorParams(rays=700, noise=EXACT)
    returns = capture(scene(plate(1.0)), level(40), params, np.random.default_rng(0))
    assert np.bincount(returns.snapshot).tolist() == [700] * 40
    assert len(np.unique(returns.points[:700], axis=0)) == 700


def test_noise_and_rounding_spread_as_far_as_stated_and_are_not_biased():
    params = NoiseParams()
    rng = np.random.default_rng(0)
    for depth in (1.0, 2.0, 4.0):
        step = params.disparity_step * depth**2
        true = depth + rng.uniform(-5 * step, 5 * step, 200_000)
        off = measured(true, params, rng) - true
        assert off.std() == pytest.approx(float(params.sigma(depth)), rel=0.03)
        assert abs(off.mean()) < 0.02 * step
    # 15 mm at 4 m
    assert float(params.sigma(4.0)) == pytest.approx(0.0152, abs=2e-4)


def test_depths_are_whole_steps_of_disparity():
    noise = NoiseParams(jitter_px=0.0, mixing=0.0)
    depths = seen(scene(plate(3.0, lean=0.3)), noise=noise)[:, 2]
    steps = 1 / (depths * noise.disparity_step)
    assert steps == pytest.approx(np.rint(steps), abs=1e-3)
    assert len(np.unique(np.rint(steps))) > 10


def test_on_a_plane_mixing_changes_nothing():
    noise = EXACT.model_copy(update={"mixing": 1.0})
    _, up, ahead = seen(scene(plate(2.0, lean=0.5)), noise=noise).T
    assert ahead == pytest.approx(2.0 + 0.5 * up, abs=1e-4)
    weights = np.array([0.0, 0.5, 1.0])
    assert mixed(np.full(3, 1.0), np.full(3, 3.0), weights) == pytest.approx([1.0, 1.5, 3.0])


@pytest.mark.parametrize(("mixing", "flying"), [(0.0, False), (0.3, True)])
def test_pixels_fly_between_the_sides_of_an_edge_and_nowhere_else(mixing, flying):
    noise = EXACT.model_copy(update={"mixing": mixing, "jitter_px": 0.5})
    right, _, ahead = seen(scene(plate(1.0, x=(0, 9)), plate(2.0)), noise=noise).T
    between = (ahead > 1.01) & (ahead < 1.99)
    assert between.any() == flying
    pixels = right * SensorParams().focal_px / ahead
    assert np.abs(pixels[between]).max(initial=0) < noise.window_px + 4 * noise.jitter_px
    # at most half of those that mix have one place on each side
    beside = np.abs(pixels) < noise.window_px
    assert between[beside].mean() <= mixing / 2


def test_what_the_projector_cannot_light_is_a_shadow_beside_nearer_things():
    # the camera sees the wall left of the plate's edge; the projector, 0.1 m to the right, only
    # what lies left of -0.1 (2 / 1 - 1)
    right, _, ahead = seen(scene(plate(1.0, x=(0, 9)), plate(2.0)), baseline_m=0.1).T
    wall = right[ahead > 1.5]
    pixel = 2.0 / SensorParams().focal_px
    assert wall.max() == pytest.approx(-0.1, abs=pixel)
    lit = seen(scene(plate(1.0, x=(0, 9)), plate(2.0)))
    assert lit[lit[:, 2] > 1.5, 0].max() == pytest.approx(0.0, abs=pixel)


def chance(material=MATT, incidence_deg=0.0, rate=0.0, n=100_000):
    kept = returned(
        np.full(n, np.deg2rad(incidence_deg)),
        np.full(n, material, np.uint8),
        np.full(n, rate),
        (np.arange(n) + 0.5) / n,
        NoiseParams(),
    )
    return kept.mean()


def test_returns_are_lost_on_dark_surfaces_at_grazing_angles_and_in_swift_turns():
    assert chance() == 1
    assert chance(material=DARK) == pytest.approx(0.4, abs=1e-4)
    assert [chance(incidence_deg=a) for a in (69, 77.5, 85, 89)] == pytest.approx(
        [1, 0.5, 0, 0], abs=1e-4
    )
    assert chance(rate=1.0) == pytest.approx(np.exp(-1), abs=1e-4)
    assert chance(rate=2.0) == pytest.approx(np.exp(-4), abs=1e-4)


def test_what_is_lost_is_lost_in_whole_windows():
    image = np.zeros((320, 180), bool)
    right, up, ahead = seen(scene(plate(2.0, material=DARK))).T
    f = SensorParams().focal_px
    image[
        np.rint(159.5 - up / ahead * f).astype(int), np.rint(89.5 + right / ahead * f).astype(int)
    ] = True
    windows = image[:315].reshape(35, 9, 20, 9).mean(axis=(1, 3))
    assert np.isin(windows, (0, 1)).all()
    assert windows.mean() == pytest.approx(0.4, abs=4 * np.sqrt(0.24 / windows.size))


def test_glass_returns_little_and_lets_some_through():
    params = SensorParams()
    n = params.columns * params.rows
    ahead = seen(scene(plate(1.0, material=GLASS), plate(2.0)))[:, 2]
    pane, behind = (np.abs(ahead - 1) < 0.01).sum() / n, (np.abs(ahead - 2) < 0.01).sum() / n
    assert (pane + behind) * n == len(ahead)
    spread = 4 * np.sqrt(0.25 / n)
    assert pane == pytest.approx(params.glass_return, abs=spread)
    assert behind == pytest.approx(0.95 * params.glass_through, abs=spread)
    # nothing lies behind
    assert len(seen(scene(plate(1.0, material=GLASS)))) == pytest.approx(0.05 * n, abs=spread * n)


def test_an_empty_scene_returns_nothing():
    empty = Scene(
        Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32), np.empty(0, np.uint8))
    )
    rng = np.random.default_rng(0)
    assert len(capture(empty, level(), SensorParams(), rng).points) == 0
    assert len(capture(empty, level(0), SensorParams(), rng).points) == 0


def test_the_number_of_threads_changes_no_bit():
    def bits(threads):
        rooms = scene(plate(2.0, x=(0, 3)), plate(3.0, lean=0.7), threads=threads)
        returns = capture(rooms, level(20, 0.3), SensorParams(), np.random.default_rng(4))
        return returns.points.tobytes() + returns.snapshot.tobytes()

    assert bits(1) == bits(2) == bits(0)

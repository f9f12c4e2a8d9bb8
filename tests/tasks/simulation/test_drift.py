"""Believed poses against true ones: what errors there are, and what they leave alone."""

import numpy as np
import pytest

from tasks.simulation.drift import DriftParams, believed
from tasks.simulation.rotations import matrices
from tasks.simulation.sensor import Views
from tasks.simulation.volunteers import looking

NONE = {"place_m": 0.0, "place_rad": 0.0, "walk_m": 0.0, "walk_rad": 0.0, "turn_rad": 0.0}


def straight(metres, k=101, rate=0.0):
    """Return the times and poses of a straight way, ten seconds a metre."""
    x = np.linspace(0, metres, k)
    views = Views(
        np.column_stack((x, np.zeros(k), np.full(k, 1.5))),
        looking(x, np.full(k, 0.3), np.full(k, 0.1)),
        np.full(k, rate),
    )
    return x * 10, views


def errors(times, true, params, n=400):
    """Return (n, k, 3) errors of position and (n, k) of heading over n seeds."""
    drawn = [believed(times, true, params, np.random.default_rng(seed)) for seed in range(n)]
    ahead = np.array([-matrices(views.rotations)[:, :, 2] for views in drawn])
    heading = np.arctan2(ahead[..., 1], ahead[..., 0])
    x, y, _ = -matrices(true.rotations)[:, :, 2].T
    turned = (heading - np.arctan2(y, x) + np.pi) % (2 * np.pi) - np.pi
    return np.array([views.positions for views in drawn]) - true.positions, turned


def test_without_errors_the_device_believes_the_truth():
    times, true = straight(5)
    views = believed(times, true, DriftParams(**NONE), np.random.default_rng(0))
    assert views.positions == pytest.approx(true.positions)
    assert views.rotations == pytest.approx(true.rotations)


@pytest.mark.parametrize("metres", [1.0, 9.0])
def test_drift_grows_with_the_root_of_the_way(metres):
    params = DriftParams(**NONE | {"walk_m": 0.02, "walk_rad": 0.01}, relocalised_s=1e9)
    shift, turn = errors(*straight(metres), params)
    assert shift[:, -1].std() == pytest.approx(0.02 * np.sqrt(metres), rel=0.1)
    assert turn[:, -1].std() == pytest.approx(0.01 * np.sqrt(metres), rel=0.1)
    assert not shift[:, 0].any()


def test_turning_on_the_spot_drifts_in_heading_only():
    times, true = straight(5, rate=0.5)
    still = Views(np.tile(true.positions[:1], (len(true), 1)), true.rotations, true.rates)
    params = DriftParams(**NONE | {"walk_m": 1.0, "turn_rad": 0.01}, relocalised_s=1e9)
    shift, turn = errors(times, still, params)
    assert shift == pytest.approx(0)
    assert turn[:, -1].std() == pytest.approx(0.01 * np.sqrt(0.5 * 50), rel=0.1)


def test_recognising_the_place_brings_the_device_back_at_once():
    times, true = straight(20, 401)
    params = {**NONE, "walk_m": 0.02, "left": 0.0}
    lost, _ = errors(times, true, DriftParams(**params, relocalised_s=1e9), 50)
    found, _ = errors(times, true, DriftParams(**params, relocalised_s=10.0), 50)
    assert found[:, -1].std() < 0.4 * lost[:, -1].std()
    # jumps are longer than any step of the drift, and about one in ten seconds
    steps = np.linalg.norm(np.diff(found, axis=1), axis=2)
    usual = np.linalg.norm(np.diff(lost, axis=1), axis=2).max()
    assert 5 < (steps > usual).sum(axis=1).mean() < 20


def test_the_error_of_the_place_moves_a_scan_as_a_whole():
    times, true = straight(5)
    params = DriftParams(**NONE | {"place_m": 0.01, "place_rad": 0.005})
    shift, turn = errors(times, true, params)
    assert np.ptp(turn, axis=1) == pytest.approx(0, abs=1e-9)
    assert turn[:, 0].std() == pytest.approx(0.005, rel=0.1)
    assert shift[:, 0].std(axis=0) == pytest.approx(0.01, rel=0.1)
    places = true.positions + shift
    apart = np.linalg.norm(places[:, 1:] - places[:, :1], axis=2)
    assert apart == pytest.approx(np.tile(np.linspace(0, 5, 101)[1:], (400, 1)))


def test_gravity_is_known_however_far_the_device_drifts():
    times, true = straight(20, rate=1.0)
    params = DriftParams(place_rad=0.5, walk_rad=0.5, turn_rad=0.5)
    views = believed(times, true, params, np.random.default_rng(1))
    # the building's z in device coordinates
    assert matrices(views.rotations)[:, 2] == pytest.approx(matrices(true.rotations)[:, 2])

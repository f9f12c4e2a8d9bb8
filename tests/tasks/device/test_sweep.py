"""Varied assumptions and wanted savings against closed forms of a campaign without repeats."""

from dataclasses import replace

import numpy as np
import pytest

from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams
from tasks.device.energy import savings, simulate_energy
from tasks.device.levers import Axis, moved, present
from tasks.device.sweep import SweepParams, sweep
from tasks.device.targets import TargetParams, solve_targets

DURATION_S, RAW, MAPSENSE, GRAMAP = 20.0, 12_000_000, 100_000, 300_000
PARAMS = EnergyParams(seeds=(0, 1, 2))
FREE_CPU = PARAMS.model_copy(update={"cpu_w": 0.0})


def recordings(s=8, **columns):
    """Return s recordings of s rooms of one storey: the first of each is of use."""
    alike = {
        "skills": np.nan,
        "duration_s": DURATION_S,
        "raw_points": 1_000_000,
        "voxel_points": 100_000,
        "snapshots": 40,
        "p_sum": 0.2,
        "bytes_raw": RAW,
        "bytes_mapsense": MAPSENSE,
        "bytes_gramap": GRAMAP,
        "usable": True,
    }
    values = {name: np.broadcast_to(v, s).copy() for name, v in (alike | columns).items()}
    return ScanWork(
        storeys=np.array(["0"] * s),
        rooms=np.array([f"r{i}" for i in range(s)]),
        scans=np.array([f"s{i}" for i in range(s)]),
        volunteers=np.array(["v"] * s),
        **values,
    )


def transmit_j(size, mw=283.17, base=132.86, mbit_s=20.0):
    return (mw * mbit_s + base) / 1000 * size * 8 / (mbit_s * 1e6) + 0.04


def expected(baseline, capture_w=2.5, **radio):
    """Return the saving of scans that are sent once, processed for nothing."""
    ours = capture_w * DURATION_S + transmit_j(MAPSENSE, **radio)
    size = RAW if baseline == "No Processing" else GRAMAP
    return 1 - ours / (capture_w * DURATION_S + transmit_j(size, **radio))


def test_each_axis_is_swept_and_each_pair():
    ranges = SweepParams(
        axes=(
            Axis(lever="capture_w", low=1, high=4),
            Axis(lever="throughput_mbit_s", low=5, high=20),
        ),
        joint=(("capture_w", "throughput_mbit_s"),),
        steps=3,
    )
    found = sweep(recordings(), FREE_CPU, ranges)
    assert len(found) == (3 + 3 + 9) * 2
    alone = found.second == ""
    assert sorted(set(found.first_values[found.first == "capture_w"])) == pytest.approx([1, 2, 4])
    assert np.isnan(found.second_values[alone]).all()
    for i in range(len(found)):
        values = {found.first[i]: found.first_values[i], found.second[i]: found.second_values[i]}
        capture_w = values.get("capture_w", 2.5)
        mbit_s = values.get("throughput_mbit_s", 20.0)
        by_hand = expected(found.baselines[i], capture_w, mbit_s=mbit_s)
        assert found.savings[i] == pytest.approx(by_hand, abs=1e-12)


def test_the_sweep_meets_the_simulation_at_its_own_constants():
    rng = np.random.default_rng(4)
    work = replace(
        recordings(40),
        rooms=np.array([f"r{i % 9}" for i in range(40)]),
        storeys=np.array(["0", "1"] * 20),
        usable=rng.random(40) > 0.3,
        p_sum=rng.random(40),
    )
    as_assumed = savings(simulate_energy(work, PARAMS))
    axes = tuple(
        Axis(lever=lever, low=value, high=value)
        for lever, value in (("capture_w", 2.5), ("t_q", PARAMS.t_q), ("attempts_max", 5))
    )
    # a longer axis beside it: more attempts are drawn, those of the fewer stay the same
    axes = (*axes, Axis(lever="attempts_max", low=9, high=9))
    found = sweep(work, PARAMS, SweepParams(axes=axes[:3], joint=(), steps=2))
    longer = sweep(work, PARAMS, SweepParams(axes=axes[1:], joint=(), steps=2))
    for i in range(len(found)):
        whole = (as_assumed.series == "storey") & (as_assumed.storeys == found.storeys[i])
        whole &= as_assumed.baselines == found.baselines[i]
        assert found.savings[i] == pytest.approx(as_assumed.savings[whole].item())
    t_q = longer.savings[longer.first == "t_q"]
    assert t_q == pytest.approx(found.savings[found.first == "t_q"])


def test_the_default_ranges_hold_the_default_constants():
    for axis in SweepParams().axes:
        assert axis.low <= getattr(EnergyParams(), axis.lever) <= axis.high, axis.lever
    values = sweep(recordings(), PARAMS, SweepParams()).savings
    assert np.isfinite(values).all() and (values < 1).all()


def test_ranges_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match=r"capture_w: low 3\.0 is above high 1\.0"):
        Axis(lever="capture_w", low=3, high=1)
    with pytest.raises(ValueError, match="Input should be"):
        Axis(lever="capture_watts", low=1, high=3)
    with pytest.raises(ValueError, match="no axis gives a range of cpu_w"):
        SweepParams(axes=(Axis(lever="t_q", low=0.1, high=1),), joint=(("t_q", "cpu_w"),))
    with pytest.raises(ValueError, match="t_q"):
        moved((recordings(), PARAMS), "t_q", 1.5)


def solved(work, params, axis, **wanted):
    wanted = {"no_processing": (), "gramap": ()} | wanted
    return solve_targets(work, params, TargetParams(axes=(axis,), **wanted))


def test_the_capture_power_that_brings_a_saving_is_the_closed_form_s():
    # (r - m) / (20 c + r) = T for c, with r and m the joules of both transfers
    axis = Axis(lever="capture_w", low=0.1, high=10)
    found = solved(recordings(), FREE_CPU, axis, no_processing=(0.6,))
    raw, ours = transmit_j(RAW), transmit_j(MAPSENSE)
    assert found.needed == pytest.approx(((raw - ours) / 0.6 - raw) / DURATION_S, rel=1e-9)
    assert found.present == pytest.approx(2.5)
    assert found.savings == pytest.approx(expected("No Processing"))
    assert found.best_values == pytest.approx(0.1)
    assert found.best_savings == pytest.approx(expected("No Processing", capture_w=0.1))


def test_the_bytes_that_bring_a_saving_are_the_closed_form_s():
    axis = Axis(lever="bytes_gramap_factor", low=0.5, high=200)
    found = solved(recordings(), FREE_CPU, axis, gramap=(0.24,))
    # 50 + m = 0.76 (50 + g), g the joules of the baseline's transfer
    joules = (50 + transmit_j(MAPSENSE)) / 0.76 - 50
    factor = (joules - 0.04) / (transmit_j(GRAMAP) - 0.04)
    assert found.needed == pytest.approx(factor, rel=1e-5)  # whole bytes


def test_a_target_that_is_met_needs_nothing_and_one_out_of_reach_has_no_answer():
    axis = Axis(lever="capture_w", low=1, high=5)
    found = solved(recordings(), FREE_CPU, axis, no_processing=(0.2, 0.9))
    assert found.targets.tolist() == [0.2, 0.9]
    assert found.needed[0] == 2.5
    assert np.isnan(found.needed[1])
    assert found.best_savings[1] == pytest.approx(expected("No Processing", capture_w=1))


def test_of_two_places_that_bring_a_saving_the_nearer_to_the_present_one_is_named():
    # with a threshold in (0.2, 0.6] the bad scan is rejected and no good one is
    work = recordings(4, p_sum=[0.2, 0.2, 0.2, 0.6], usable=[True, True, True, False])
    work = replace(work, rooms=np.array(["a"] * 4))
    params = FREE_CPU.model_copy(update={"t_q": 0.9, "seeds": tuple(range(10))})
    at_best = savings(simulate_energy(work, params.model_copy(update={"t_q": 0.3})))
    wanted = at_best.savings[(at_best.series == "storey")][1]
    axis = Axis(lever="t_q", low=0.05, high=0.95)
    found = solved(work, params, axis, no_processing=(wanted - 1e-9,))
    assert found.baselines.tolist() == ["No Processing"]
    assert found.savings[0] < wanted - 1e-6
    assert found.needed[0] == pytest.approx(0.6, abs=1e-9)


def test_levers_on_the_work_change_what_they_name_only():
    work = recordings(4, p_sum=[0.1, 0.9, np.nan, 0.5], usable=[True, True, False, True])
    case = (work, PARAMS)
    assert present(case, "bytes_raw_factor") == 1
    assert present(case, "unusable_share_foreseen") == 0.25
    assert present(case, "attempts_max") == 5
    halved, params = moved(case, "bytes_raw_factor", 0.5)
    assert halved.bytes_raw.tolist() == [RAW // 2] * 4 and params == PARAMS
    assert halved.bytes_gramap is work.bytes_gramap
    foreseen, params = moved(case, "unusable_share_foreseen", 0.5)
    assert foreseen.usable.tolist() == [True, False, True, False]  # the worst P_sum first
    assert (foreseen.p_sum > params.t_q).tolist() == [False, True, False, True]
    assert moved(case, "attempts_max", 3.4)[1].attempts_max == 3


def test_a_foreseen_share_costs_the_baselines_uploads_and_mapsense_none():
    work = recordings(40)
    work = replace(work, rooms=np.array(["a"] * 40), p_sum=np.linspace(0, 1, 40))
    work, params = moved((work, FREE_CPU), "unusable_share_foreseen", 0.25)
    params = params.model_copy(update={"attempts_max": 11, "gate_ns_per_snapshot": 0.0})
    energy = simulate_energy(work, params)
    whole = energy.series == "queries"
    ours, theirs = (whole & (energy.methods == m) for m in ("MapSense", "No Processing"))
    assert np.array_equal(energy.captures[ours], energy.captures[theirs])
    assert np.array_equal(energy.uploads[ours], energy.n_queries[ours])
    assert energy.rejected[ours].sum() > 0


def test_a_campaign_without_recordings_has_no_answers():
    assert len(sweep(recordings(0), PARAMS, SweepParams())) == 0
    assert len(solve_targets(recordings(0), PARAMS, TargetParams())) == 0

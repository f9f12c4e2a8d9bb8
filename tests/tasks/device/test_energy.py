"""The energy model against cases worked by hand, a slow second loop and closed forms."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_1samp

from storage.energy import ENERGY, Energy
from storage.savings import Savings
from storage.scan_work import ScanWork
from tasks.device.costs import EnergyParams, scan_costs
from tasks.device.energy import savings, simulate_energy
from tasks.device.queries import answer, draw_recordings

ONE = EnergyParams(n_queries=(1,), seeds=(0,))
FREE = {
    "capture_w": 0,
    "cpu_w": 0,
    "uplink_mw_per_mbit_s": 0,
    "uplink_base_mw": 0,
    "transfer_j": 0,
}
METHODS = ("MapSense", "GraMap", "No Processing")


def recordings(rooms="a", storeys="0", **columns):
    """Return recordings of a room each, all alike but for what is given."""
    s = len(rooms)
    alike = {
        "duration_s": 20.0,
        "skills": np.nan,
        "raw_points": 1_000_000,
        "voxel_points": 100_000,
        "snapshots": 40,
        "p_sum": 0.2,
        "bytes_raw": 12_000_000,
        "bytes_mapsense": 100_000,
        "bytes_gramap": 300_000,
        "usable": True,
    }
    values = {name: np.broadcast_to(v, s).copy() for name, v in (alike | columns).items()}
    return ScanWork(
        storeys=np.array([storeys] * s if isinstance(storeys, str) else storeys),
        rooms=np.array(list(rooms)),
        scans=np.array([f"s{i}" for i in range(s)]),
        volunteers=np.array([f"v{i % 6}" for i in range(s)]),
        **values,
    )


def row(energy, method, series="queries", n=1):
    """Return the figures of one method and one seed."""
    rows = (energy.methods == method) & (energy.series == series) & (energy.n_queries == n)
    (i,) = np.flatnonzero(rows)
    return {f.name: getattr(energy, f.name)[i].item() for f in fields(Energy)}


def campaign(seed=1, s=60, rooms=12, p_bad=0.3):
    """Return a campaign of two storeys whose gate is right more often than not."""
    rng = np.random.default_rng(seed)
    raw = rng.integers(500_000, 3_000_000, s)
    usable = rng.random(s) > p_bad
    return recordings(
        [f"r{i % rooms}" for i in range(s)],
        ["0" if i % rooms < rooms // 2 else "1" for i in range(s)],
        duration_s=rng.uniform(10, 60, s),
        raw_points=raw,
        voxel_points=raw // 6,
        p_sum=np.where(rng.random(s) < 0.1, np.nan, rng.normal(np.where(usable, 0.35, 0.55), 0.1)),
        bytes_raw=raw * 12,
        bytes_mapsense=raw // 10,
        bytes_gramap=raw // 3,
        usable=usable,
    )


def test_one_scan_that_answers_its_query_costs_what_one_works_out_by_hand():
    energy = simulate_energy(recordings(), ONE)
    # sending takes 0.28317 W x 20 + 0.13286 W = 5.79626 W
    by_hand = {
        # 2.5 W x 20 s | 2 W x (40 x 1 us + 1e6 x 200 ns + 1e5 x 700 ns) | 0.8 Mbit: 0.04 s
        "MapSense": (50.0, 2 * (4e-5 + 0.2 + 0.07), 5.79626 * 0.04 + 0.04),
        # 2 W x 1e6 x 700 ns | 2.4 Mbit: 0.12 s
        "GraMap": (50.0, 1.4, 5.79626 * 0.12 + 0.04),
        # 96 Mbit: 4.8 s
        "No Processing": (50.0, 0.0, 5.79626 * 4.8 + 0.04),
    }
    for method, joules in by_hand.items():
        found = row(energy, method)
        assert [found["capture_j"], found["process_j"], found["transmit_j"]] == pytest.approx(
            joules
        )
        assert found["total_j"] == pytest.approx(sum(joules))
        counts = [found[name] for name in ("captures", "rejected", "uploads", "unanswered")]
        assert counts == [1, 0, 1, 0]
    saved = savings(energy)
    # 50.8119304 against 52.1355512 and 77.862048
    assert saved.baselines[:2].tolist() == ["GraMap", "No Processing"]
    assert saved.savings[:2] == pytest.approx([0.0253881, 0.3474107], abs=1e-6)


def test_a_scan_that_is_always_rejected_is_made_up_to_the_limit_and_never_sent():
    energy = simulate_energy(recordings(p_sum=0.9), ONE.model_copy(update={"attempts_max": 4}))
    found = row(energy, "MapSense")
    assert [found[n] for n in ("captures", "rejected", "uploads", "unanswered")] == [4, 4, 0, 1]
    assert found["capture_j"] == pytest.approx(4 * 50)
    assert found["process_j"] == pytest.approx(4 * 2 * 40e-6)
    assert found["transmit_j"] == 0
    assert row(energy, "GraMap")["captures"] == row(energy, "No Processing")["captures"] == 1


def test_a_scan_the_server_cannot_use_costs_a_full_cycle_each_time():
    once = simulate_energy(recordings(), ONE)
    often = simulate_energy(recordings(usable=False), ONE)
    for method in METHODS:
        found = row(often, method)
        assert (found["captures"], found["uploads"], found["unanswered"]) == (5, 5, 1)
        assert found["total_j"] == pytest.approx(5 * row(once, method)["total_j"])


def test_a_rejected_scan_may_cost_a_part_of_its_capture():
    early = ONE.model_copy(update={"attempts_max": 3, "rejected_capture_share": 0.1})
    energy = simulate_energy(recordings(p_sum=0.9), early)
    assert row(energy, "MapSense")["capture_j"] == pytest.approx(3 * 5)
    assert row(energy, "GraMap")["capture_j"] == pytest.approx(50)
    kept = simulate_energy(recordings(p_sum=0.5), early)
    assert row(kept, "MapSense")["capture_j"] == pytest.approx(50)


def test_a_scan_that_was_not_assessed_is_not_rejected():
    energy = simulate_energy(recordings(p_sum=np.nan), ONE.model_copy(update={"t_q": 0.0}))
    assert row(energy, "MapSense")["uploads"] == 1


def test_a_repeat_takes_another_recording_of_the_room():
    work = recordings("aa", duration_s=[10.0, 100.0], p_sum=[0.1, 0.9], usable=[True, False])
    for seed in range(20):
        draws = draw_recordings(work, "0", seed, 1, 5)
        assert sorted(draws[0, :2]) == [0, 1]
        energy = simulate_energy(work, ONE.model_copy(update={"seeds": (seed,)}))
        bad_first = draws[0, 0] == 1
        for method in METHODS:
            found = row(energy, method)
            assert found["captures"] == 1 + bad_first
            assert found["capture_j"] == pytest.approx(2.5 * (110 if bad_first else 10))
            rejected = int(bad_first and method == "MapSense")
            assert (found["rejected"], found["unanswered"]) == (rejected, 0)
    assert {draw_recordings(work, "0", seed, 1, 5)[0, 0] for seed in range(20)} == {0, 1}


def test_when_a_room_s_recordings_are_used_up_any_of_the_storey_s_stands_in():
    work = recordings("abbc", storeys=["0", "0", "0", "1"])
    draws = np.array([draw_recordings(work, "0", seed, 2, 30) for seed in range(20)])
    for first in draws.reshape(-1, 30):
        own = [0] if first[0] == 0 else [1, 2]
        assert sorted(first[: len(own)]) == own
        assert set(first[len(own) :]) == {0, 1, 2}


def test_every_room_is_asked_for_before_one_is_asked_for_again():
    work = recordings("abcde")
    rooms = draw_recordings(work, "0", 3, 12, 1)[:, 0]
    for cycle in (rooms[:5], rooms[5:10]):
        assert sorted(cycle) == [0, 1, 2, 3, 4]
    assert len(set(rooms[10:])) == 2


def test_fewer_queries_and_attempts_give_the_first_of_the_same_draws():
    work = campaign()
    draws = draw_recordings(work, "1", 7, 40, 10)
    for queries, attempts in ((40, 3), (7, 10), (1, 1), (13, 7)):
        fewer = draw_recordings(work, "1", 7, queries, attempts)
        assert fewer.tolist() == draws[:queries, :attempts].tolist()


def test_the_mean_number_of_scans_is_the_closed_form_of_drawing_without_replacement():
    # of 40 recordings 30 are of use: the first of them comes after (40 + 1) / (30 + 1) draws
    work = recordings("a" * 40, usable=np.arange(40) >= 10)
    params = EnergyParams(n_queries=(200,), seeds=tuple(range(10)), attempts_max=11)
    energy = simulate_energy(work, params)
    rows = (energy.methods == "No Processing") & (energy.series == "queries")
    assert energy.captures[rows].sum() / 2000 == pytest.approx(41 / 31, abs=0.04)  # 2.7 sigma
    assert energy.unanswered.max() == 0


def one_after_the_other(draws, costs, usable):
    """Return the captures, rejections and joules of queries, looking at each scan in turn."""
    captures = rejected = 0
    capture = process = transmit = 0.0
    for attempts in draws:
        for scan in attempts:
            captures += 1
            capture += costs.capture_j[scan]
            process += costs.gate_j[scan]
            if costs.rejected[scan]:
                rejected += 1
                continue
            process += costs.process_j[scan]
            transmit += costs.transmit_j[scan]
            if usable[scan]:
                break
    return captures, rejected, capture, process, transmit


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 8), st.floats(0, 1), st.floats(0, 1))
def test_the_sums_are_those_of_looking_at_each_scan_in_turn(seed, attempts_max, t_q, p_bad):
    work = campaign(seed, p_bad=p_bad)
    params = EnergyParams(t_q=t_q, attempts_max=attempts_max)
    draws = draw_recordings(work, "0", seed, 25, attempts_max)
    for costs in scan_costs(work, params).values():
        found = answer(draws, costs, work.usable)
        names = ("captures", "rejected", "capture_j", "process_j", "transmit_j")
        sums = [getattr(found, name).sum() for name in names]
        assert sums == pytest.approx(one_after_the_other(draws, costs, work.usable))


def test_the_storey_is_one_query_per_room_and_queries_accumulate():
    energy = simulate_energy(campaign(), EnergyParams())
    for storey in ("0", "1"):
        here = energy.storeys == storey
        assert set(energy.n_queries[here & (energy.series == "storey")]) == {6}
        for method in METHODS:
            for seed in range(10):
                rows = here & (energy.methods == method) & (energy.seeds == seed)
                rows &= energy.series == "queries"
                assert energy.n_queries[rows].tolist() == [5, 10, 15, 20, 25, 30, 35, 40]
                assert (np.diff(energy.total_j[rows]) > 0).all()
    assert np.array_equal(energy.total_j, energy.capture_j + energy.process_j + energy.transmit_j)
    assert np.array_equal(energy.captures, energy.uploads + energy.rejected)


def test_the_same_seeds_give_the_same_bytes_and_a_storey_does_not_depend_on_the_others():
    work, params = campaign(), EnergyParams()
    table = ENERGY.to_table(simulate_energy(work, params))
    assert table.equals(ENERGY.to_table(simulate_energy(work, params)))
    alone = ScanWork(**{f.name: getattr(work, f.name)[work.storeys == "1"] for f in fields(work)})
    rows = [row for row in table.to_pylist() if row["storey"] == "1"]
    assert ENERGY.to_table(simulate_energy(alone, params)).to_pylist() == rows
    other = EnergyParams(seeds=tuple(range(10, 20)))
    assert not np.array_equal(simulate_energy(work, other).total_j, table["total_j"].to_numpy())


def totals(work, method, **constants):
    energy = simulate_energy(work, EnergyParams(**constants))
    return energy.total_j[energy.methods == method]


def test_without_a_gate_and_with_equal_bytes_and_free_processing_all_methods_take_the_same():
    work = campaign()
    work = replace(work, bytes_mapsense=work.bytes_raw, bytes_gramap=work.bytes_raw)
    ours, *theirs = (totals(work, method, t_q=1.0, cpu_w=0.0) for method in METHODS)
    for other in theirs:
        assert np.array_equal(ours, other)
    assert savings(simulate_energy(work, EnergyParams(t_q=1, cpu_w=0))).savings == pytest.approx(0)


def test_constants_of_zero_take_nothing_and_save_nothing():
    energy = simulate_energy(campaign(), EnergyParams(**FREE))
    assert not energy.total_j.any()
    assert np.isnan(savings(energy).savings).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("constant", "values"),
    [
        ("capture_w", (0, 1, 5)),
        ("cpu_w", (0, 1, 5)),
        ("uplink_mw_per_mbit_s", (50, 283, 400)),
        ("uplink_base_mw", (0, 132, 1288)),
        ("transfer_j", (0, 0.04, 12)),
        ("attempts_max", (1, 2, 5, 9)),
    ],
)
def test_more_of_a_constant_never_takes_less(method, constant, values):
    each = [totals(campaign(), method, **{constant: value}) for value in values]
    for less, more in pairwise(each):
        assert (more >= less - 1e-9).all()


@pytest.mark.parametrize("method", METHODS)
def test_more_usable_scans_never_take_more(method):
    work = campaign(p_bad=0.5)
    better = replace(work, usable=work.usable | (np.arange(len(work)) % 3 == 0))
    assert (totals(better, method) <= totals(work, method) + 1e-9).all()


def equal_but_for_the_gate(**columns):
    work = recordings("aabbccdd", bytes_mapsense=300_000, bytes_gramap=300_000, **columns)
    return savings(simulate_energy(work, EnergyParams(cpu_w=0.0))).savings


def test_a_gate_saves_if_it_rejects_what_the_server_would_and_costs_if_it_does_not():
    good = np.arange(8) % 2 == 0
    assert (equal_but_for_the_gate(p_sum=np.where(good, 0.1, 0.9), usable=good) > 0).all()
    # wrong each time: what it sends is of no use, what is of use it keeps
    wrong = equal_but_for_the_gate(p_sum=np.where(good, 0.9, 0.1), usable=good)
    assert (wrong < 0).all()


def test_the_interval_is_student_s_of_the_savings_per_seed():
    energy = simulate_energy(campaign(), EnergyParams())
    found = savings(energy)
    for i in range(len(found)):
        at = (energy.series == found.series[i]) & (energy.storeys == found.storeys[i])
        at &= energy.n_queries == found.n_queries[i]
        ours = energy.total_j[at & (energy.methods == "MapSense")]
        theirs = energy.total_j[at & (energy.methods == found.baselines[i])]
        expected = ttest_1samp(1 - ours / theirs, 0)
        interval = expected.confidence_interval(0.95)
        assert found.savings[i] == pytest.approx(np.mean(1 - ours / theirs))
        assert (found.low[i], found.high[i]) == pytest.approx((interval.low, interval.high))
        assert found.n_seeds[i] == 10
        gave_up = energy.unanswered[at & (energy.methods == "MapSense")]
        assert found.unanswered[i] == gave_up.mean()


def test_one_seed_has_no_interval():
    found = savings(simulate_energy(campaign(), EnergyParams(seeds=(3,))))
    assert np.isfinite(found.savings).all()
    assert np.isnan(found.low).all() and np.isnan(found.high).all()


def test_a_campaign_without_recordings_has_no_rows():
    empty = recordings("")
    energy = simulate_energy(empty, EnergyParams())
    assert len(energy) == 0 and isinstance(energy, Energy)
    assert len(savings(energy)) == 0 and isinstance(savings(energy), Savings)


def test_the_paper_s_radio_takes_2_3_joules_a_megabyte_at_20_mbit_s():
    # Huang et al. (2012) at 5, 10, 20 and 40 Mbit/s: 2.48, 2.37, 2.32 and 2.29 J/MB
    for throughput, expected in ((5, 2.48), (10, 2.37), (20, 2.32), (40, 2.29)):
        params = EnergyParams(throughput_mbit_s=throughput, transfer_j=0)
        work = recordings(bytes_raw=1_000_000)
        cost = scan_costs(work, params)["No Processing"].transmit_j
        assert cost == pytest.approx(expected, abs=0.005)

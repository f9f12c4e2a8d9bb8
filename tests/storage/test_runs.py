"""Runs of comparisons: their variant, seed and parameter set, and runs recorded before those."""

from datetime import UTC, datetime

import pyarrow.parquet as pq
import pytest

from storage.runs import COMPLETED, EVALUATE, Run, parameter_set, read_runs, recorded

PARAMS = {"hough": {"seed": 3, "cell": 0.05}, "codec": {"profile": "low"}, "deep": {"a": {"b": 1}}}


def changed(stage, **values):
    return PARAMS | {stage: PARAMS[stage] | values}


def test_runs_that_differ_in_seeds_alone_have_one_parameter_set():
    found = parameter_set(PARAMS)
    assert len(found) == 12 and int(found, 16) >= 0
    assert parameter_set(changed("hough", seed=99)) == found
    assert parameter_set(changed("deep", seed=1)) == found
    assert parameter_set({**PARAMS, "deep": {"a": {"seed": 7, "b": 1}}}) == found
    reordered = {name: dict(reversed(PARAMS[name].items())) for name in reversed(PARAMS)}
    assert parameter_set(reordered) == found


@pytest.mark.parametrize(
    "other",
    [
        changed("hough", cell=0.1),
        changed("hough", seeds=[1]),
        changed("deep", a={"b": 2}),
        {name: PARAMS[name] for name in ("hough", "codec")},
    ],
)
def test_other_parameters_are_another_set(other):
    assert parameter_set(other) != parameter_set(PARAMS)


def run_of(**changes):
    asked = {"verb": EVALUATE, "building": "hut", "storey": "0", "asked": "{}"}
    return Run(id="r1", started_at=datetime.now(UTC), **asked | changes)


def test_a_run_comes_back_with_its_variant_seed_and_parameters(tmp_path):
    run = run_of(variant="coarse", seed=0, parameters="abc")
    with recorded(str(tmp_path), run) as record:
        record.end(COMPLETED, "")
    (found,) = read_runs(tmp_path)
    assert (found.variant, found.seed, found.parameters) == ("coarse", 0, "abc")
    assert found.state == COMPLETED


def test_a_run_recorded_before_there_were_variants_is_plain_mapping(tmp_path):
    with recorded(str(tmp_path), run_of(verb="map")):
        pass
    (path,) = tmp_path.glob("runs/*/*/*.parquet")
    table = pq.read_table(path, partitioning=None)
    pq.write_table(table.drop_columns(["variant", "seed", "parameters"]), path)
    (found,) = read_runs(tmp_path)
    assert (found.variant, found.seed, found.parameters) == ("", None, "")

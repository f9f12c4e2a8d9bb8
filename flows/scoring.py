"""The verb `evaluate`: a plan against its truth, or an experiment of repeats."""

import json
import sys
from pathlib import Path

from flows.answers import print_answers, print_table
from flows.assignments import assigned
from flows.server import prefect_api
from flows.settings import Settings, load_settings
from flows.verbs import checked_name, writable
from storage.errors import MapSenseError

TOML = ".toml"


def evaluate(
    what: Path,
    truth: Path | None,
    truth_storey: str | None,
    building: str | None,
    storey: str | None,
    seeds: str | None,
    store: Path | None,
    assignments: list[str],
    jobs: int | None,
    as_json: bool,
) -> int:
    """Score a plan, a campaign, or what a file says."""
    settings = load_settings(store=store, jobs=jobs, params=assigned(assignments) or None)
    root = writable(settings.store, "store", "--store or MAPSENSE_STORE")
    if truth is not None:
        _refuse({"--seeds": seeds}, "a plan is scored as it is, once")
        return _evaluate_plan(what, truth, truth_storey, building, storey, root, settings, as_json)
    _refuse({"--truth-storey": truth_storey}, "it is of --truth")
    if what.suffix.lower() == TOML:
        given = {"--seeds": seeds, "--building": building, "--storey": storey}
        _refuse(given, f"{what} says it")
    elif not what.is_dir():
        raise MapSenseError(
            f"{what}: expected a plan with --truth TRUTH, a campaign's folder, or a file .toml "
            "that says what is compared"
        )
    return _run_experiment(what, building, storey, seeds, root, settings, as_json)


def _evaluate_plan(
    plan: Path,
    truth: Path,
    truth_storey: str | None,
    building: str | None,
    storey: str | None,
    root: Path,
    settings: Settings,
    as_json: bool,
) -> int:
    """Score a mapped plan against the truth."""
    from storage.plan_geojson import read_plan

    mapped = read_plan(plan)
    name = checked_name(building or mapped.building)
    level = checked_name(storey or mapped.storey)
    with prefect_api(root):
        from flows.evaluation import EvaluationRequest
        from flows.params import parse_params
        from flows.work import run_evaluation

        request = EvaluationRequest(
            store=str(root),
            building=name,
            storey=level,
            plan=str(plan.resolve()),
            truth=str(truth.resolve()),
            truth_storey=truth_storey,
            params=parse_params(settings.params),
        )
        answers = run_evaluation(request, not as_json)
    titled = answers if as_json else {f"{name}/{level}: {k}": v for k, v in answers.items()}
    print_answers(titled, as_json)
    return 0


def _run_experiment(
    what: Path,
    building: str | None,
    storey: str | None,
    seeds: str | None,
    root: Path,
    settings: Settings,
    as_json: bool,
) -> int:
    """Map and score every storey with every variant and seed."""
    with prefect_api(root):
        from flows.experiment import SEEDS
        from flows.experiment_file import campaign_experiment, read_experiment
        from flows.outcomes import by_variant, problems, runs_of
        from flows.work import run_repeats

        if what.is_dir():
            asked = SEEDS if seeds is None else _seeds(seeds)
            of = (building and checked_name(building), storey)
            request = campaign_experiment(what, str(root), settings.params, asked, *of)
        else:
            request = read_experiment(what, str(root), settings.params)
        outcomes = run_repeats(request, settings.jobs, not as_json)
    rows, wrong = by_variant(outcomes), problems(outcomes)
    if as_json:
        print(json.dumps({"variants": rows, "runs": runs_of(outcomes)}, indent=1))
    else:
        import pyarrow as pa

        print_table(pa.Table.from_pylist(rows))
        print(f"plans: {root / 'evaluations'}/BUILDING/STOREY/VARIANT/SEED")
    for line in wrong:
        print(f"mapsense: {line}", file=sys.stderr)
    return 1 if wrong else 0


def _seeds(text: str) -> tuple[int, ...]:
    """Return the seeds of `10`, ten of them, or of `0,3,7`, these."""
    try:
        given = [int(part) for part in text.split(",")]
    except ValueError:
        given = []
    if "," not in text and given and given[0] > 0:
        return tuple(range(given[0]))
    if "," not in text or not given or min(given) < 0 or len(set(given)) < len(given):
        raise MapSenseError(
            f"--seeds {text}: expected how many, as 10, or different ones, as 0,3,7"
        )
    return tuple(given)


def _refuse(given: dict[str, str | None], why: str) -> None:
    """Raise MapSenseError for a flag that has no meaning here."""
    for flag in [name for name, value in given.items() if value is not None]:
        raise MapSenseError(f"{flag}: leave it out, {why}")

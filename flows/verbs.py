"""The verbs of the command line that run flows."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flows.answers import print_answers, print_table, state_now
from flows.assignments import assigned, merged
from flows.failures import with_failures
from flows.forests import Kind, shipped
from flows.server import prefect_api
from flows.settings import Settings, load_settings
from storage.artifacts import check_name
from storage.errors import MapSenseError, StoreError
from storage.runs import COMPLETED, ENERGY, Run, goes_on, last_runs, read_runs


def map_scans(
    scans: Sequence[Path],
    building: str,
    storey: str,
    store: Path | None,
    out: Path | None,
    assignments: list[str],
    given: dict[str, Any],
    jobs: int | None,
    as_json: bool,
) -> int:
    """Map the scans of one storey."""
    flags = merged(assigned(assignments), given)
    settings = load_settings(store=store, jobs=jobs, params=flags or None)
    root = writable(settings.store, "store", "--store or MAPSENSE_STORE")
    for name in (building, storey):
        checked_name(name)
    if out is not None:
        writable(out, "folder of the results", "--out")
    with prefect_api(root):
        from flows.params import parse_params
        from flows.request import StoreyRequest
        from flows.work import is_done, run_storey

        request = StoreyRequest(
            store=str(root),
            building=building,
            storey=storey,
            scans=tuple(str(scan.resolve()) for scan in scans),
            params=parse_params(settings.params),
            out=str(out.resolve()) if out is not None else None,
        )
        summary = run_storey(request, settings.jobs, not as_json)
    _print_summary(summary, as_json)
    return 0 if is_done(summary) else 1


def run_demo(out: Path, store: Path | None, seed: int, jobs: int | None, as_json: bool) -> int:
    """Simulate, map and compare a small storey."""
    out = writable(out, "folder of the results", "--out")
    settings = load_settings(store=store or out / "store", jobs=jobs)
    root = writable(settings.store, "store", "--store")
    with prefect_api(root):
        from flows import demo
        from flows.params import parse_params
        from flows.request import StoreyRequest
        from flows.work import is_done, run_storey
        from storage.plan_geojson import read_plan

        truth, scans = demo.simulate(out, seed, lambda line: _tell(line, not as_json))
        request = StoreyRequest(
            store=str(root),
            building=demo.BUILDING,
            storey=demo.STOREY,
            # by name: scans of another seed may lie beside them
            scans=tuple(str(scan) for scan in scans),
            params=parse_params(settings.params),
            out=str(out),
            verb="demo",
        )
        summary = run_storey(request, settings.jobs, not as_json)
        mapped = read_plan(out / "plan.geojson")
        matches = demo.compare_rooms(truth, mapped)
        summary["objects"] = demo.compare_objects(truth, mapped)
    summary["rooms"] = [match.as_json() for match in matches]
    _print_summary(summary, as_json)
    if not as_json:
        import pyarrow as pa

        print("\nrooms of the simulated storey, and what was mapped of them (simulated scans):")
        print_table(pa.Table.from_pylist(summary["rooms"]))
        print("\nwhat stands in them, and what of it was found:")
        print_table(pa.Table.from_pylist(summary["objects"]))
    return 0 if is_done(summary) else 1


def simulate_campaign(
    plans: Sequence[Path],
    preset: str | None,
    storey: str | None,
    building: str,
    scans: int | None,
    seed: int,
    out: Path,
    assignments: list[str],
    as_json: bool,
) -> int:
    """Simulate the scans of storeys into a folder."""
    from pydantic import ValidationError

    from flows import campaign
    from flows.params import explain
    from tasks.device.work import RAW_BYTES

    if bool(plans) == bool(preset):
        raise MapSenseError("name a plan (GeoJSON or IFC) to scan, or a --preset, and not both")
    if scans is not None and scans < 1:
        raise MapSenseError(f"--scans {scans}: expected at least 1")
    checked_name(building)
    own = assigned(assignments)
    for name in {"scans", "seed"} & set(own.get("campaign", {})):
        raise MapSenseError(f"--set campaign.{name}: give it as --{name}")
    given = merged({"campaign": {"seed": seed}}, own)
    try:
        params = campaign.SimulationParams.model_validate(given)
    except ValidationError as error:
        raise MapSenseError(explain(error, campaign.SimulationParams)) from error
    out = writable(out, "folder of the campaign", "--out")
    if preset is not None:
        sites = campaign.preset_sites(preset, building)
        if preset == "paper" and scans is None:
            scans = campaign.PAPER_SCANS
    else:
        sites = [site for path in plans for site in campaign.plan_sites(path, storey, params)]
    made = campaign.simulate(
        sites, out, building, scans, params.campaign, lambda line: _tell(line, not as_json)
    )
    if as_json:
        print(made.model_dump_json(indent=1))
        return 0
    all_scans = [scan for each in made.storeys for scan in each.scans]
    points = sum(scan.points for scan in all_scans)
    print(
        f"{building}: {_count(len(all_scans), 'simulated scan')} of "
        f"{_count(len(made.storeys), 'storey')}, {points:,} points "
        f"({points * RAW_BYTES / 1e9:.2f} GB as raw floats)"
    )
    for each in made.storeys:
        print(f"{out / each.storey}: scans/, truth.geojson")
    return 0


def charge_campaign(
    folder: Path,
    building: str | None,
    store: Path | None,
    assignments: list[str],
    jobs: int | None,
    as_json: bool,
) -> int:
    """Charge MapSense, GraMap and No Processing for a campaign's scans."""
    settings = load_settings(store=store, jobs=jobs, params=assigned(assignments) or None)
    root = writable(settings.store, "store", "--store or MAPSENSE_STORE")
    from storage.campaign import read_campaign

    campaign = read_campaign(folder)
    name = building or f"{campaign.building}.scans"
    checked_name(name)
    with prefect_api(root):
        from flows.energy import EnergyRequest
        from flows.params import parse_params
        from flows.work import left_out, run_energy

        request = EnergyRequest(
            store=str(root),
            folder=str(folder.resolve()),
            building=name,
            params=parse_params(settings.params),
        )
        answers = run_energy(request, settings.jobs, not as_json)
        missing = left_out(request)
    print_answers(answers, as_json)
    for line in missing:
        print(f"mapsense: {line}", file=sys.stderr)
    return 1 if missing else 0


def train_classifier(
    kind: Kind,
    out: Path | None,
    work: Path,
    assignments: list[str],
    jobs: int | None,
    as_json: bool,
) -> int:
    """Train a classifier on simulated storeys, into a file."""
    settings = load_settings(jobs=jobs, params=assigned(assignments) or None)
    root = writable(work, "folder of the work", "--work")
    file = (out or shipped(kind)).resolve()
    writable(file.parent, "folder of the forest", "--out")
    with prefect_api(root):
        from flows.params import parse_params
        from flows.training import TrainRequest
        from flows.work import run_training

        request = TrainRequest(
            kind=kind,
            work=str(root),
            out=str(file),
            params=parse_params(settings.params),
            jobs=settings.jobs,
        )
        summary = run_training(request, not as_json)
    if as_json:
        print(json.dumps(summary, indent=1, ensure_ascii=False))
        return 0
    import pyarrow as pa

    examples = sum(summary["examples"].values())
    print(
        f"{summary['out']}: {_count(summary['trees'], 'tree')} of {examples:,} examples from "
        f"{_count(summary['storeys'], 'storey')} (simulated)"
    )
    print("\nof storeys held back in turn (simulated scans):")
    print_table(pa.Table.from_pylist(summary["scores"]))
    return 0


def run_again(
    building: str | None,
    storey: str | None,
    scan: str | None,
    stage: str | None,
    store: Path | None,
    jobs: int | None,
    as_json: bool,
) -> int:
    """Run again the storeys whose last run did not do all it was asked for.

    Parameters
    ----------
    scan, stage : str, optional
        Only where this scan, or this stage, failed.
    """
    settings = load_settings(store=store, jobs=jobs)
    root = writable(settings.store, "store", "--store or MAPSENSE_STORE")
    last = last_runs(read_runs(root, building, storey))
    # a campaign's energy is charged again by its own verb
    last = [run for run in last if run.verb != ENERGY]
    again = [run for run in last if run.state != COMPLETED and not goes_on(str(root), run)]
    again = with_failures(str(root), again, scan, stage)
    if not again:
        if as_json:
            print("[]")
        else:
            print(f"nothing to run again: {_tally(root, last)}")
        return 0
    summaries = _run_again(root, again, settings, as_json)
    if as_json:
        print(json.dumps(summaries, indent=1, ensure_ascii=False))
    else:
        for summary in summaries:
            _print_summary(summary, as_json=False)
    return 0 if all(summary["state"] == COMPLETED for summary in summaries) else 1


def _run_again(root: Path, runs: list[Run], settings: Settings, as_json: bool) -> list[Any]:
    with prefect_api(root):
        from pydantic import ValidationError

        from flows.params import explain
        from flows.request import StoreyRequest
        from flows.work import run_buildings

        requests = []
        for run in runs:
            asked = {k: v for k, v in run.request().items() if k != "run"}
            try:
                # a store may have been moved since
                requests.append(StoreyRequest.model_validate(asked | {"store": str(root)}))
            except ValidationError as error:
                raise MapSenseError(
                    f"{run.building}/{run.storey}: the last run was asked for something that "
                    f"is not understood any more ({explain(error, StoreyRequest)}); map it again"
                ) from error
        return run_buildings(requests, settings.jobs, not as_json)


def _tally(root: Path, last: list[Run]) -> str:
    states = [state_now(str(root), run) for run in last]
    counts = [f"{states.count(state)} {state}" for state in sorted(set(states))]
    return "last runs: " + ", ".join(counts) if counts else "no storey was mapped"


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _print_summary(summary: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(summary, indent=1, ensure_ascii=False))
        return
    name = f"{summary['building']}/{summary['storey']}"
    if (found := summary.get("found")) is None:
        print(f"mapsense: {name}: {summary['state']}: {summary['message']}", file=sys.stderr)
        return
    used, costs = summary["used"], summary["stages"].values()
    cached = sum(cost["cached"] for cost in costs)
    total = cached + sum(cost["computed"] + cost["failed"] for cost in costs)
    simulated = ", simulated" if summary["simulated"] else ""
    print(
        f"{name}: {_count(found['rooms'], 'room')}, {found['area_m2']} m², "
        f"{_count(found['walls'], 'wall')}, {_count(found['doors'], 'door')}, "
        f"{_count(found['windows'], 'window')}, "
        f"{_count(found['furniture'], 'piece')} of furniture "
        f"from {_count(len(used['scans']), 'scan')} "
        f"({used['points']:,} points{simulated}) in "
        f"{summary['seconds']:.1f} s, {cached} of {total} stages from the cache"
    )
    print(f"plan: {summary['out']}/plan.geojson, plan.svg, plan.png")
    if summary["message"]:
        print(f"mapsense: {name}: {summary['message']}", file=sys.stderr)


def checked_name(name: str) -> str:
    """Return a name that may be a folder of the store, else raise MapSenseError."""
    try:
        return check_name(name)
    except ValueError as error:
        raise MapSenseError(str(error)) from error


def _tell(line: str, wanted: bool) -> None:
    if wanted and sys.stderr.isatty():
        print(line, file=sys.stderr)


def writable(folder: Path, what: str, flag: str) -> Path:
    """Return a folder's absolute path after a file was written to it, before any work."""
    probe = folder / ".mapsense-probe"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(
            f"{folder}: the {what} cannot be written ({error.strerror}); make it writable, or "
            f"choose another with {flag}"
        ) from error
    return folder.resolve()

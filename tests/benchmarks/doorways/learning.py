"""What classifiers of variants learn from: a training's storeys, or stored ones."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow.parquet as pq
from commands import ask
from correction.stored import Stored

from doorways.storeys import Doorways
from storage import candidates as stored_candidates
from storage import wall_images
from storage.campaign import read_campaign
from storage.forest import Forest
from storage.plan import Plan
from storage.plan_digest import plan_digest
from storage.plan_geojson import read_plan
from tasks.doors.candidates import CandidateParams, find_candidates
from tasks.doors.examples import ExampleParams, examples
from tasks.forest import Examples, joined

TUNING = ("slab0", "slab1", "bent0", "ring0")
"""Storeys that parameters were chosen on: learnt from where there is no training, never scored."""
TRAINED = """
select s.building, s.stage, last(s.outputs[1] order by s.started_at) as uri
from stages s join runs r on s.run = r.id and s.building = r.building and s.storey = r.storey
where s.stage in ('wall_images', 'opening_candidates') and r.verb = 'train'
  and s.outcome != 'failed'
group by all
"""


def of_training(work: Path, forest: Forest) -> Examples:
    """Return the examples of the storeys a forest names, from the work folder of its training.

    Raises
    ------
    SystemExit
        If the folder has not all of them.
    """
    truths = _truths(work)
    made: dict[str, dict[str, str]] = {}
    for row in ask(work / "store", TRAINED):
        made.setdefault(row["building"], {})[row["stage"]] = row["uri"]
    found = []
    for storey in forest.provenance.storeys:
        uris = made.get(storey.building, {})
        if storey.digest not in truths or len(uris) != 2:
            raise SystemExit(f"{work}: holds no training of {storey.building}/{storey.storey}")
        images, some = (
            pq.read_table(work / "store" / uris[stage], partitioning=None)
            for stage in ("wall_images", "opening_candidates")
        )
        candidates = stored_candidates.from_table(some)
        of_storey = wall_images.from_table(images)
        found.append(examples(candidates, of_storey, truths[storey.digest], ExampleParams()))
    return joined(found)


def of_storey(stored: Stored, campaigns: Path) -> Examples:
    """Return the examples of a stored storey."""
    model = Doorways(stored, campaigns)
    candidates = find_candidates(model.images, CandidateParams())
    return examples(candidates, model.images, model.truth, ExampleParams())


def only(given: Examples, features: Sequence[int]) -> Examples:
    """Return the examples with some of their features."""
    return Examples(given.features[:, list(features)], given.labels, given.groups)


def _truths(work: Path) -> dict[str, Plan]:
    """Return the true plans of a training's campaigns by their digests."""
    found = {}
    for folder in sorted((work / "campaigns").iterdir()):
        if (folder / "campaign.json").exists():
            for storey in read_campaign(folder).storeys:
                truth = read_plan(folder / storey.truth)
                found[plan_digest(truth)] = truth
    return found

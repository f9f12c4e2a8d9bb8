"""The record of a campaign comes back as it was, or says what is wrong with it."""

import json

import pytest

from storage.campaign import (
    FILE,
    Campaign,
    CampaignScan,
    CampaignStorey,
    read_campaign,
    write_campaign,
)
from storage.errors import InputError

SCAN = CampaignScan(
    scan="s00v1",
    path="0/scans/s00v1.scan",
    room="r0",
    volunteer="v1",
    skill=0.7,
    duration_s=61.5,
    points=250_000,
)
REAL = SCAN.model_copy(update={"scan": "s01v2", "volunteer": "Zoë", "skill": None})
CAMPAIGN = Campaign(
    building="b",
    simulated=True,
    seed=3,
    storeys=(
        CampaignStorey(storey="0", truth="0/truth.geojson", scans=(SCAN, REAL)),
        CampaignStorey(storey="1", truth="1/truth.geojson", scans=()),
    ),
)
REMEDY = "name a folder that 'mapsense simulate' made"


@pytest.mark.parametrize(
    "campaign",
    [
        CAMPAIGN,
        CAMPAIGN.model_copy(update={"storeys": ()}),
        CAMPAIGN.model_copy(update={"seed": None}),
    ],
)
def test_a_campaign_comes_back_as_it_was(tmp_path, campaign):
    write_campaign(campaign, tmp_path)
    assert read_campaign(tmp_path) == campaign
    assert [path.name for path in tmp_path.iterdir()] == [FILE]


def test_a_campaign_replaces_the_one_before(tmp_path):
    write_campaign(CAMPAIGN, tmp_path)
    other = CAMPAIGN.model_copy(update={"storeys": ()})
    write_campaign(other, tmp_path)
    assert read_campaign(tmp_path) == other


def changed(change):
    record = CAMPAIGN.model_dump(mode="json")
    change(record["storeys"][0]["scans"][1], record)
    return json.dumps(record)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("{", "is no JSON ("),
        ("", "is no JSON ("),
        ("[]", "field '': input should be"),
        (
            changed(lambda scan, _: scan.pop("room")),
            "field 'storeys.0.scans.1.room': field required",
        ),
        (
            changed(lambda scan, _: scan.update(rom="r0")),
            "field 'storeys.0.scans.1.rom': extra inputs are not permitted",
        ),
        (
            changed(lambda scan, _: scan.update(points="many")),
            "field 'storeys.0.scans.1.points': input should be a valid integer",
        ),
        (changed(lambda _, all_: all_.pop("storeys")), "field 'storeys': field required"),
        (changed(lambda _, all_: all_.pop("seed")), "field 'seed': field required"),
    ],
)
def test_what_is_wrong_is_said_with_file_field_and_remedy(tmp_path, text, problem):
    if text is not None:
        (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError) as error:
        read_campaign(tmp_path)
    assert str(error.value).startswith(f"{tmp_path / FILE}: {problem}")
    assert str(error.value).endswith(f"; {REMEDY}")


def test_bytes_that_are_no_text_are_no_record(tmp_path):
    (tmp_path / FILE).write_bytes(b"\xff\xfe{}")
    with pytest.raises(InputError, match="is no JSON"):
        read_campaign(tmp_path)

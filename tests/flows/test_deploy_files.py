"""Files of buildings: what they say, and what is said of one that is wrong."""

import shutil
from pathlib import Path

import pytest

from flows.cli import main
from flows.deploying.building_file import read_building
from flows.deploying.prefect_file import read_shared
from storage.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
STOREY = '[[storeys]]\nstorey = "1"\nscans = ["scans"]\n'


@pytest.fixture
def read(tmp_path):
    def read(text, base=None):
        path = tmp_path / "north.toml"
        path.write_text(text)
        return read_building(path, base or {})

    return read


def test_a_file_says_where_scans_come_from_and_when_they_are_mapped(read, tmp_path):
    north = read(
        'building = "north"\ngrammar = "office"\ntags = ["campus"]\nconcurrency = 2\n'
        '[schedule]\ncron = "0 2 * * *"\ntimezone = "Europe/Berlin"\n'
        '[[storeys]]\nstorey = "1"\nscans = ["scans/1", "up/*.e57", "memory://bucket/1"]\n'
        "[params.hough]\ngamma_cell = 25\n",
        base={"hough": {"gamma_cell": 3, "seed": 4}},
    )
    assert (north.building, north.tags, north.concurrency) == ("north", ("campus",), 2)
    assert str(north.timing) == "0 2 * * * Europe/Berlin"
    assert north.settings == {"grammar": "office", "hough": {"gamma_cell": 25, "seed": 4}}
    (storey,) = north.storeys
    assert storey.scans == (
        str(tmp_path / "scans" / "1"),
        str(tmp_path / "up" / "*.e57"),
        "memory://bucket/1",
    )


def test_a_building_without_a_schedule_waits_to_be_asked(read):
    north = read(f'building = "north"\n{STOREY}')
    assert north.timing is None
    assert (north.concurrency, north.jobs, north.settings) == (1, None, {})


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("", 1, "'building' is missing; add it"),
        ('building = "../b"\n' + STOREY, 1, "'building' is \"../b\"; expected letters"),
        ('building = "b"', 1, "'storeys' is missing; add a table [[storeys]]"),
        ('building = "b"\nshedule = 1\n' + STOREY, 2, "did you mean 'schedule'"),
        ('building = "b"\nconcurrency = 0\n' + STOREY, 2, "'concurrency' is 0"),
        ('building = "b"\nsettle_s = -1\n' + STOREY, 2, "'settle_s' is -1"),
        ('building = "b"\ntags = [1]\n' + STOREY, 2, "'tags' has 1; expected texts"),
        ('building = "b"\ngrammar = "ofice"\n' + STOREY, 2, "'grammar' is \"ofice\""),
        ('building = "b"\n' + STOREY + STOREY, 6, "'storey' is \"1\" twice"),
        ('building = "b"\n[[storeys]]\nstorey = "1"\nscans = []', 4, "'scans' is empty"),
        ('building = "b"\n[[storeys]]\nstorey = "1"\nscans = ["s4://b/x"]', 4,
         "nothing reads 's4://'"),
        ('building = "b"\n[[storeys]]\nstorey = "1"\nscans = [\n"a",\n"s3://b/*"]', 6,
         "an address cannot be a pattern"),
        ('building = "b"\n[[storeys]]\nstorey = "1"\nscans = ["s3://key:secret@b/x"]', 4,
         "with credentials in it; put them into the environment"),
        ('building = "b"\n' + STOREY + '[schedule]\ncron = "61 * * * *"', 6,
         "'cron' is \"61 * * * *\"; expected minute hour"),
        ('building = "b"\n' + STOREY + '[schedule]\ncron = "@hourly"\nevery_s = 60', 6,
         "exactly one says when"),
        ('building = "b"\n' + STOREY + "[schedule]\nevery_s = 1", 6, "a number of 10 or more"),
        ('building = "b"\n' + STOREY + '[schedule]\ncron = "0 2 * * *"\ntimezone = "Berlin"', 7,
         "'timezone' is \"Berlin\"; expected a name as Europe/Berlin"),
        ('building = "b"\n' + STOREY + "[params.hough]\ngama_cell = 25", 6,
         "unknown setting 'hough.gama_cell': did you mean 'hough.gamma_cell'"),
        ('building = "b"\n' + STOREY + "[params.hough]\ngamma_cell = -5", 6,
         "setting 'hough.gamma_cell' = -5"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_file_line_and_remedy(read, text, line, sentence):
    with pytest.raises(InputError) as error:
        read(text)
    assert f"north.toml: line {line}: " in str(error.value)
    assert sentence in str(error.value)


def test_an_address_with_credentials_is_not_repeated(read):
    with pytest.raises(InputError) as error:
        read('building = "b"\n[[storeys]]\nstorey = "1"\nscans = ["s3://key:secret@b/x"]')
    assert "secret" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("deployments: []", "field 'deployments': there is none"),
        ("a: [", "is no YAML"),
        ("deployments: [{entrypoint: flows/scheduled.py:f, work_pool: {name: p}}]", "a file; name"),
        ("deployments: [{entrypoint: a.b, work_pool: {nam: p}}]", "field 'deployments.0.work_pool"),
    ],
)
def test_a_wrong_prefect_file_is_named(tmp_path, text, sentence):
    path = tmp_path / "prefect.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"prefect\.yaml: ") as error:
        read_shared(path)
    assert sentence in str(error.value)


def test_the_files_that_come_along_are_sound(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(["deploy", str(ROOT / "deployments"), "--check", "--json"])
    assert left.value.code == 0
    assert '"building": "example"' in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("buildings",), "PREFECT_API_URL is not set, so there is no server to deploy to"),
        (("nowhere", "--check"), "nowhere: cannot be read"),
        (("empty", "--check"), "empty: holds no file *.toml"),
        (("twice", "--check"), "give each building one file"),
        (("alone/north.toml", "--check"), "alone/prefect.yaml: cannot be read"),
    ],
)
def test_what_cannot_be_deployed_is_said_in_one_sentence(
    monkeypatch, capsys, tmp_path, arguments, sentence
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    for folder, names in {"buildings": "a", "twice": "ab", "alone": ["north"], "empty": ""}.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / f"{name}.toml").write_text(f'building = "b"\n{STOREY}')
        if folder != "alone":
            shutil.copy(ROOT / "deployments" / "prefect.yaml", tmp_path / folder)
    with pytest.raises(SystemExit) as left:
        main(["deploy", *arguments])
    said = capsys.readouterr()
    assert left.value.code == 1
    assert sentence in said.err
    assert said.err.count("\n") == 1

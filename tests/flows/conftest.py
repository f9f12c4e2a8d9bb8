"""What the tests of flows share."""

import pytest

from flows.cli import main


@pytest.fixture
def mapsense(tmp_path, monkeypatch, capsys):
    """Return what runs the command in an empty folder: its exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return left.value.code, said.out, said.err

    return run

"""`fastgen completion`, run by bash."""

import subprocess
import sys

import pytest

from fastgen.cli.main import main


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "fastgen.bash"
    command = [sys.executable, "-m", "fastgen", "completion", "bash"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    path.write_text(done.stdout)
    return path


def completed(script, *words, folder="/"):
    """Return what bash offers for the last word."""
    code = (
        f'cd {folder}; source {script}; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); '
        '$(complete -p fastgen | sed "s/.*-F //; s/ fastgen$//"); printf "%s\\n" "${COMPREPLY[@]}"'
    )
    command = ["bash", "-c", code, "bash", "fastgen", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.split()


def test_bash_completes_commands_options_and_values(script):
    assert completed(script, "gen") == ["generate"]
    assert {"generate", "report", "verify", "show"} <= set(completed(script, ""))
    assert "--quality" in completed(script, "generate", "--q")
    assert completed(script, "generate", "--quality", "dr") == ["draft"]
    assert completed(script, "completion", "z") == ["zsh"]


def test_bash_completes_files(script, tmp_path):
    (tmp_path / "port.yaml").touch()
    assert completed(script, "config", "--config", "por", folder=tmp_path) == ["port.yaml"]


def test_an_unknown_shell_and_a_missing_package_get_one_line(capsys, monkeypatch):
    assert main(["completion", "bsh"]) == 2
    assert "bash" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 2
    assert "fastgen[completion]" in capsys.readouterr().err

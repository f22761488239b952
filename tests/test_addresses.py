"""Places of datasets and output files as users write them, and passwords in addresses."""

import re
from pathlib import Path

import pytest

from fastgen.cli.main import main
from fastgen.dataset.addresses import place_of
from fastgen.dataset.job import Job
from fastgen.dataset.on_ray import _everywhere
from fastgen.dataset.storage import Folder, Remote, storage_of
from fastgen.errors import ConfigError, FastgenError, OutputError
from fastgen.redaction import without_secrets

pytestmark = pytest.mark.usefixtures("no_workers")

ARGUMENTS = ["--images", "1", "--size", "64x64", "--cameras", "A", "--workers", "1"]

MISTYPED = {
    "s3:/bucket/x": "write s3://bucket/x",
    "s3:bucket/x": "write s3://bucket/x",
    "s3//bucket/x": "write s3://bucket/x",
    "s3:///bucket/x": "write s3://bucket/x",
    "S3://bucket/x": "write s3://bucket/x",
    "s3:": "write s3://bucket/folder",
    "s3://": "names no bucket",
    "gs:///": "names no bucket",
    "https:/host/x": "write https://host/x",
    "unknown:/bucket/x": "write unknown://bucket/x",
    "file:/data/x": "write file:///data/x",
    "file://data/x": "write file:///data/x",
    "file:data/x": "write file:///data/x",
    "://": "has no protocol",
    "://bucket/x": "has no protocol",
    ":/bucket/x": "has no protocol",
    "C:\\boxes": "is a path of Windows",
    "C:/boxes": "is a path of Windows",
    "\\\\server\\boxes": "is a path of Windows",
    "~nobody-has-this-name/x": "no home folder ~nobody-has-this-name",
    "a\0b": "contains the character NUL",
    "": "is empty",
}


@pytest.mark.parametrize(("text", "words"), MISTYPED.items())
def test_mistyped_places_are_refused_with_advice(tmp_path, monkeypatch, capsys, text, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match=re.escape(words)):
        storage_of(text)
    for command in (["generate", text, *ARGUMENTS], ["verify", text], ["stats", text]):
        try:
            code = main(command)
        except SystemExit as stop:
            code = stop.code
        assert code == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line
    assert not list(tmp_path.iterdir())


def test_an_address_that_became_a_path_is_recognized():
    with pytest.raises(OutputError, match="write s3://bucket/x"):
        storage_of(Path("s3://bucket/x"))


@pytest.mark.parametrize(
    "text", ["boxes", "./s3:/x", "run:1", "a//b", "/data/s3:/x", "C:", "x~", "./~", "a.b/c", "-x"]
)
def test_folders_keep_their_names(text):
    assert place_of(text) == text
    assert isinstance(storage_of(text), Folder)


@pytest.mark.parametrize("text", ["memory://made/x", "simplecache::memory://made"])
def test_addresses_keep_their_names(text):
    assert place_of(text) == text
    assert isinstance(storage_of(text), Remote)


@pytest.mark.parametrize("before", ["", "file://", "local://"])
def test_local_addresses_and_tilde_are_folders(tmp_path, monkeypatch, before):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert storage_of(f"{before}~/x").root == tmp_path / "x"
    assert storage_of(f"{before}{tmp_path}/x").root == tmp_path / "x"
    assert _everywhere(Job(f"{before}~/x", 1)).out == f"{tmp_path}/x"


def test_tilde_is_the_home_folder_in_every_output_path(tmp_path, monkeypatch, capsys):
    home, here = tmp_path / "home", tmp_path / "here"
    home.mkdir()
    here.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(here)
    assert main(["generate", "~/out/", *ARGUMENTS]) == 0
    assert f"1 images in {home}/out; look at {home}/out/" in capsys.readouterr().out
    assert main(["verify", "~/out"]) == 0
    assert main(["stats", "~/out"]) == 0
    show = ["show", "--index", "0", "--size", "64x64"]
    assert main([*show, "-o", "~/a.png"]) == 0
    assert (home / "a.png").is_file()
    assert not list(here.iterdir())
    assert main([*show, "-o", "s3://bucket/a.png"]) == 2
    assert "s3://bucket/a.png: is an address; give a file" in capsys.readouterr().err


ADDRESSES = [
    "https://user:hush-hush@127.0.0.1:9/x",
    "https://user:hush-hush@127.0.0.1:9/x?name=y",
    "https://hush-hush@127.0.0.1:9/x",
    "https://127.0.0.1:9/x?Signature=hush-hush",
    "http://user:a%2Fhush-hush%40b@127.0.0.1:9/x",
    "http://user:a/hush-hush@b@127.0.0.1:9/x",
    "ftp://user:hush-hush@127.0.0.1:9/x",
    "memory://user:hush-hush@made/x",
    "nowhere://user:hush-hush@host/x",
    "s3:/user:hush-hush@bucket/x",
    "simplecache::http://user:hush-hush@127.0.0.1:9/x",
]


@pytest.mark.parametrize("address", ADDRESSES)
def test_passwords_are_never_printed(capfd, address):
    commands = (
        *(["generate", address, *ARGUMENTS], ["verify", address], ["stats", address]),
        ["verify", address, "--repair"],
        ["verify", address, address],
        ["show", "--index", "0", "-o", address],
    )
    for command in commands:
        try:
            code = main(command)
        except SystemExit as stop:
            code = stop.code
        assert code == 2
        out, err = capfd.readouterr()
        assert "hush" not in out + err
        assert "***" in err
        assert err.count("\n") == 1


@pytest.mark.parametrize("error", [FastgenError, OutputError, ConfigError])
def test_errors_of_the_library_hide_passwords(error):
    assert str(error("sftp://user:secret@host/x: no")) == "sftp://user:***@host/x: no"


@pytest.mark.parametrize(
    "text",
    [
        *("s3://bucket/a@b: is missing", "write to me@host: now", "https://host:80/x is gone"),
        *("abfs://container@account.dfs.core.windows.net/x", "is s3://bucket/x what you meant?"),
        "see https://host/x?: no",
    ],
)
def test_words_without_secrets_stay_as_they_are(text):
    assert without_secrets(text) == text


def test_a_password_is_hidden_where_it_stands_alone():
    found = without_secrets("denied for a/b@c and a%2Fb%40c", "ftp://u:a%2Fb%40c@host/x")
    assert found == "denied for *** and ***"

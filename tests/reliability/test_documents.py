"""Records and logs with a right checksum and any structure: one line, no escapes, and a run that goes on."""

import copy
import json
import os
import shutil

import pytest
from support.commands import cspr

from cspr_jax.errors import RefusedError
from cspr_jax.schema.identity import FORMAT_VERSION, digest, identity
from cspr_jax.store import documents
from cspr_jax.store.documents import DEEPEST, plain_json
from cspr_jax.store.files.checksum import DamagedError
from cspr_jax.sweep.inspection import status
from reliability.support import check_same, content, go, sweep_of
from reliability.test_damage import without_quarantine

VALUES = (
    *(None, True, 0, -1, 1, 10**12, 10**400, 0.5, 1e300, "", "x", "\x1b[31mred\x1b[0m", "\ud800", "[/x]", "a/b", "\0"),
    *([], {}, [[]], [None], ["\x1b"], [0], [10**12], {"count": 10**12}, {"count": "x"}, [{}] * 3, ["x"] * 40),
)
SMALL_VALUES = (None, -1, 10**12, "\x1b[31m", "\ud800", [], {"count": 10**12})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    sweep = sweep_of(folder, tiles=4)
    go(sweep, folder / "run")
    return sweep, folder / "run", content(folder / "run")


def places(value, at=()):
    """Every place of a document that can be changed."""
    if at:
        yield at
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield from places(one, (*at, key))


def put(document, at, value):
    for key in at[:-1]:
        document = document[key]
    if value is KeyError:
        del document[at[-1]]
    else:
        document[at[-1]] = copy.deepcopy(value)


def write(path, document):
    document = {key: value for key, value in document.items() if key != "checksum"}
    path.chmod(0o644)
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    path.write_text(json.dumps(document | {"checksum": digest(document) if "NaN" not in text else "0" * 64}))


def records(good, values):
    """Documents with something else at one place; each twice where its identity can fit again."""
    for at in places({key: value for key, value in good.items() if key != "checksum"}):
        for value in (*values, KeyError):
            for fits in (False, True):
                document = copy.deepcopy(good)
                put(document, at, value)
                if fits:
                    if at[0] != "settings" or not isinstance(document.get("settings"), dict):
                        continue
                    document["identity"] = identity(document["settings"])
                yield (*at, value), document


def look_at(finished, tmp_path, values, step):
    """Commands on directories with changed records: how many there were."""
    sweep, source, reference = finished
    good, count, directory = json.loads((source / "run.json").read_text()), 0, tmp_path / "run"
    shutil.copytree(source, directory)
    for i, (name, document) in enumerate(list(records(good, values))[::step]):
        write(directory / "run.json", document)
        for command in ("status", "verify"):
            code, out, err = cspr(command, directory)
            assert code in (0, 4) and (code == 0 or err), (name, command, err)
            assert all(line.isprintable() for line in (out + err).splitlines()), (name, command)
            assert code == 4 or command == "verify" or out, name
            count += 1
        if i % 10 == 0:
            (directory / "small.h5").unlink()
            if document["identity"] == good["identity"]:
                try:
                    assert go(sweep, directory).computed == 0, name
                except RefusedError as refused:  # a good record of another environment
                    assert name[0] == "environment" and "--accept-environment-change" in str(refused), name
                    shutil.copy(source / "small.h5", directory / "small.h5")
                    continue
                without_quarantine(directory)
                check_same(directory, reference)
                count += 1
            else:
                shutil.copy(source / "small.h5", directory / "small.h5")
    return count


def test_records_of_any_structure(finished, tmp_path):
    assert look_at(finished, tmp_path, SMALL_VALUES, 71) > 20


@pytest.mark.soak
def test_records_of_any_structure_all(finished, tmp_path):
    assert look_at(finished, tmp_path, VALUES, 1) > 5000


def test_settings_and_identity_belong_together(finished, tmp_path):
    """Settings that are another sweep's under this one's identity are damage, not a licence."""
    sweep, source, reference = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    document = json.loads((source / "run.json").read_text())
    document["settings"]["axes"]["y"] = [0.1, 0.2]
    write(tmp_path / "run" / "run.json", document)
    code, _, err = cspr("verify", tmp_path / "run")
    assert code == 4 and "its settings and its identity do not fit" in err
    assert go(sweep, tmp_path / "run").computed == 0
    assert without_quarantine(tmp_path / "run") == ["run.json.0"]
    check_same(tmp_path / "run", reference)
    assert FORMAT_VERSION == 2  # those of earlier formats are known by theirs


LINES = (
    *(b"[" * 30_000, b'{"a":' * 9_000 + b"1" + b"}" * 9_000, b"null", b"[1]", b"{}", b'{"event": 1, "time": 2}'),
    *(b'{"event": "x", "time": "y", "a": NaN}', b'{"event": "x", "time": "y", "a": 1e999}', b"\xff\xfe", b"\0" * 99),
    *(b'{"event": "x", "time": null}', b'{"event": "x", "time": "y", "a": ' + b"9" * 9_000 + b"}"),
)


def test_logs_of_any_content(finished, tmp_path):
    """A line that is none is passed over; escapes and lone surrogates are written out."""
    shutil.copytree(finished[1], tmp_path / "run")
    log = tmp_path / "run" / "log.jsonl"
    good = log.read_bytes()
    for line in LINES:
        log.write_bytes(good + line + b"\n")
        assert status(tmp_path / "run")["last"]["event"] == "finished", line[:40]
        assert cspr("status", tmp_path / "run", "--json")[0] == 0 == cspr("status", tmp_path / "run")[0]
    for word in ("\x1b[31m", "\u009b31m", "\ud800", "two\nlines", "[/x]"):
        log.write_text(json.dumps({"event": word, "time": word}) + "\n")
        code, out, _ = cspr("status", tmp_path / "run")
        assert code == 0 and len(out.splitlines()) == 5 and all(line.isprintable() for line in out.splitlines())
        assert json.loads(cspr("status", tmp_path / "run", "--json")[1])["last"]["event"] == word


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), lambda path: path.mkdir()])
def test_logs_that_are_no_file(finished, tmp_path, make):
    shutil.copytree(finished[1], tmp_path / "run")
    (tmp_path / "run" / "log.jsonl").unlink()
    make(tmp_path / "run" / "log.jsonl")
    assert status(tmp_path / "run")["last"] is None


def test_json_that_is_read():
    deep = "[" * (DEEPEST - 1) + "]" * (DEEPEST - 1)
    assert plain_json(deep) is not None and plain_json(b'{"a": [1, 2.5, "x"]}') == {"a": [1, 2.5, "x"]}
    for text in (f"[[{deep}]]", "NaN", "[Infinity]", "1e999", "{", b"\xff", "[" * 99_999, "9" * 9_999):
        with pytest.raises(DamagedError):
            plain_json(text)


def test_status_of_a_map_over_all_orientations(tmp_path):
    """Their axes are none of the file's: they follow from their divisions."""
    path = tmp_path / "o.toml"
    path.write_text(
        'schema = 1\nmap = "orientations"\nrobot = "laval-mssm"\n[axes]\nx = [1.0]\ny = [0.0]\nz = [1.5]\nz0 = [1.7]\n'
        "[trajectory]\nmax_arcs = 4\n[orientations]\ndivisions = 4\n[run]\ntile = [1, 1, 1, 1, 8, 4, 2]\n"
    )
    from cspr_jax.store.documents import Settings
    from cspr_jax.sweep.definition import read_sweep

    sweep = read_sweep(path)
    assert Settings.model_validate(sweep.settings).tiling == sweep.grid.tiling
    assert len(sweep.grid.tiling) > 1


HEADER = {"identity": "a" * 64, "tile": 3, "environment": "0" * 64, "near_zero": 2}


@pytest.mark.parametrize("key", HEADER)
def test_headers_hold_hashes_and_counts(key):
    assert documents.document(documents.Header, HEADER, "its header").undecided is None
    for value in (None, "x", "A" * 64, "a" * 63, "a" * 64 + "\n", -1, 10**30, True, 0.5, [3]):
        with pytest.raises(DamagedError):
            documents.document(documents.Header, HEADER | {key: value}, "its header")

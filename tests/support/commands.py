"""The command line, called in this process."""

import contextlib
import io
import json
from pathlib import Path

from cspr_jax.cli import main
from cspr_jax.store.reading.result import open_result


def cspr(*arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main([str(argument) for argument in arguments])
    return code, out.getvalue(), err.getvalue()


def plan(folder: Path, text: str, *arguments: object) -> tuple[int, str, str]:
    """The same of `cspr plan` for the text of a plan, which lies in the folder."""
    path = folder / "plan.toml"
    path.write_text(text, "utf-8")
    return cspr("plan", path, *arguments)


def strict_json(text: str) -> dict:
    """One JSON object on one line, without NaN and infinities."""
    assert text.count("\n") == 1

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def planned(folder: Path, text: str, code: int = 0) -> dict:
    """What `cspr plan --json` prints of a plan, without a word on standard error."""
    found, out, err = plan(folder, text, "--json")
    assert (found, err) == (code, "")
    return strict_json(out)


def swept(folder: Path, text: str):
    """The result of a sweep, which runs in the folder."""
    (folder / "s.toml").write_text(text, "utf-8")
    code, _, err = cspr("run", folder / "s.toml", "-o", folder / "run")
    assert (code, err) == (0, ""), err
    return open_result(folder / "run" / "s.h5")


def refuse_sweep(folder: Path, text: str, words: str) -> None:
    """A sweep that is refused in one line that holds some words: nothing is written."""
    (folder / "wrong.toml").write_text(text, "utf-8")
    code, out, err = cspr("run", folder / "wrong.toml", "-o", folder / "run")
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err
    assert not (folder / "run").exists()

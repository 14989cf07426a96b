"""Result files read by this process, where how they are read is not what a test is about."""

import contextlib
import io
from pathlib import Path

from cspr_jax.errors import StoreError
from cspr_jax.store import isolated, reader
from cspr_jax.store.netcdf import UNREADABLE, reason
from cspr_jax.store.seal import DamagedError


def read_here(monkeypatch) -> None:
    """Let this process read files, without limits: a process for each takes longer than all the rest."""

    @contextlib.contextmanager
    def reading(path, file, what):
        pipe = io.BytesIO()
        monkeypatch.setattr(reader, "FILE", Path(f"/dev/fd/{file}"))
        try:
            (reader._result if what == "result" else reader._content)(pipe)
        except (DamagedError, StoreError, *UNREADABLE) as error:
            reader._answer(pipe, {"refused": reason(error)})
        pipe.seek(0)
        yield pipe

    monkeypatch.setattr(reader, "_grant", lambda *limits: None)
    monkeypatch.setattr(isolated, "_reading", reading)
    monkeypatch.setattr(isolated, "_PATIENCE", None)  # nobody waits: all is there

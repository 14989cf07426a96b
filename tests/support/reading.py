"""Files read by this process, where how they are read is not what a test is about."""

import io
import json
from pathlib import Path

from cspr_jax.store.reading import isolated, reader


def read_here(monkeypatch) -> None:
    """Let this process read files, without limits: a process for each takes longer than all the rest."""

    def sent(self, path, file, words):
        pipe = io.BytesIO()
        reader.answer(Path(f"/dev/fd/{file}"), json.loads(json.dumps(words)), pipe)
        pipe.seek(0)
        return pipe

    monkeypatch.setattr(reader, "_grant", lambda *limits: None)
    monkeypatch.setattr(isolated.Reader, "_sent", sent)
    monkeypatch.setattr(isolated, "_PATIENCE", None)  # nobody waits: all is there

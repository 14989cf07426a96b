"""Certificates of motions from Python: checked by the independent checker."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from cspr_jax.api.arguments.checks import checked
from cspr_jax.config.reading import read_text
from cspr_jax.errors import ConfigError
from cspr_jax.runtime.exact_arithmetic import LIBRARY_LOCK, need_exact


class CertificateFinding(NamedTuple):
    """Finding of the checker of certificates.

    Fields:
        holds: whether the proof holds.
        message: what is proved, or what is not shown.
    """

    holds: bool
    message: str

    def to_dict(self) -> dict[str, Any]:
        """The finding as plain values, for JSON.

        Returns:
            "holds" and "message".
        """
        return self._asdict()


@checked()
def verify_certificate(path: str | Path) -> CertificateFinding:
    """Check a certificate by another way than that which proved it; see docs/certificates.md.

    Args:
        path: file that `cspr check --certificate` or `Plan.save_certificate` has written.

    Returns:
        whether its proof holds, and what it states.

    Raises:
        ConfigError: the file is no certificate, or is truncated or altered; or python-flint is not installed.
    """
    need_exact("verify_certificate")
    from cspr_jax.certificate_checker.checking import check  # few processes need it
    from cspr_jax.certificate_checker.reading import NotACertificate, read

    path = Path(path)
    try:
        with LIBRARY_LOCK:
            finding = check(read(read_text(path)))
    except NotACertificate as error:
        raise ConfigError(path, f"no certificate: {error}") from error
    return CertificateFinding(finding.holds, finding.message)

"""An authority, and certificates for machines of a cluster that speak TLS."""

import subprocess
from collections.abc import Mapping
from pathlib import Path


def _openssl(subject: str, key: Path, certificate: Path, *options: str) -> None:
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-noenc", "-days", "2"]
    command += ["-subj", f"/CN={subject}", "-keyout", str(key), "-out", str(certificate), *options]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603 - of the system


class Authority:
    """Signs certificates, which are in a folder with its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._key, self._certificate = folder / "ca.key", folder / "ca.crt"
        _openssl("authority", self._key, self._certificate)

    def certify(self, *addresses: str) -> Mapping[str, str]:
        """Return Ray's variables for a machine with these addresses, and that for itself."""
        key, certificate = (self._folder / f"{addresses[0]}.{end}" for end in ("key", "crt"))
        names = ",".join(f"IP:{each}" for each in ("127.0.0.1", *addresses))
        by = ("-CA", str(self._certificate), "-CAkey", str(self._key))
        _openssl("machine", key, certificate, *by, "-addext", f"subjectAltName={names}")
        return {
            "RAY_USE_TLS": "1",
            "RAY_TLS_CA_CERT": str(self._certificate),
            "RAY_TLS_SERVER_CERT": str(certificate),
            "RAY_TLS_SERVER_KEY": str(key),
        }

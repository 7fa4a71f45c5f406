"""The link to a service that knows `watch`, and the server behind a certificate."""

import http.client
import shutil
import ssl
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from orchestrator.config.northbound import Tls
from orchestrator.errors import CauseError
from orchestrator.model import Cause, Decision, State
from orchestrator.northbound.serve import certificate, reload_certificate
from orchestrator.northbound.static import Static
from orchestrator.service.published import Published
from orchestrator.service.streams import Streams
from tests.northbound.bench import SOON_S, bay, page

#: As docs/northbound.md makes it.
OPENSSL = [path for path in (shutil.which("openssl"),) if path]


@dataclass
class Bay:
    """One whose decision makes it news."""

    name: str
    decision: Decision | None = None
    state: str = "IDLE"

    def status(self) -> dict[str, Any]:
        return bay(self.name, self.state)

    def go(self, state: State) -> None:
        self.state, self.decision = state, Decision(state, Cause(state.lower()))


def test_changes_come_by_the_stream_of_the_service(tmp_path: Path) -> None:
    bays = [Bay("bay-1"), Bay("bay-2")]
    station = {"station": "hall", "language": "en", "alarm": "none"}
    streams = Streams(Published(bays, lambda: dict(station), lambda: 1000.0), time.monotonic, lambda _: None)
    streams.start()
    with page(tmp_path, controller=False) as (browser, controller):
        controller.begin(streams)
        controller.document = {}  # whoever asks for it gets nothing sensible
        with browser.stream() as events:
            whole = events.next("whole")[2]
            assert [one["name"] for one in whole["document"]["bays"]] == ["bay-1", "bay-2"]
            assert (whole["document"]["station"], whole["document"]["time"]) == ("hall", 1000.0)
            bays[1].go(State.TRIPPED)
            change = events.next("change")[2]
            assert {name: one["state"] for name, one in change["bays"].items()} == {"bay-2": "TRIPPED"}
    streams.close()


def made(openssl: str, directory: Path, name: str) -> Tls:
    tls = Tls(cert_file=directory / f"{name}-cert.pem", key_file=directory / f"{name}-key.pem")
    command = [
        openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj",
        f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(tls.key_file), "-out",
        str(tls.cert_file),
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    tls.key_file.chmod(0o600)
    return tls


@pytest.mark.parametrize("openssl", OPENSSL)
def test_it_is_served_with_a_certificate(openssl: str, tmp_path: Path) -> None:
    tls = made(openssl, tmp_path, "one")
    with page(tmp_path, controller=False, tls=tls) as (browser, _):
        trusting = ssl.create_default_context(cafile=tls.cert_file)
        client = http.client.HTTPSConnection("127.0.0.1", browser.port, timeout=SOON_S, context=trusting)
        client.request("GET", "/api/me")
        assert client.getresponse().status == 200
        client.close()


@pytest.mark.parametrize("openssl", OPENSSL)
def test_a_certificate_that_cannot_be_used_leaves_the_one_before(
    openssl: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = made(openssl, tmp_path, "one"), made(openssl, tmp_path, "two")
    context = certificate(one)
    reload_certificate(context, Tls(cert_file=two.cert_file, key_file=one.key_file))
    two.key_file.chmod(0o644)
    reload_certificate(context, two)
    first, second = capsys.readouterr().err.splitlines()
    assert "the certificate in use stays: " in first
    assert "mode 0644" in second
    assert presented(context, one.cert_file)
    two.key_file.chmod(0o600)
    reload_certificate(context, two)
    assert presented(context, two.cert_file)
    with pytest.raises(CauseError):
        certificate(Tls(cert_file=one.key_file, key_file=one.key_file))


def presented(context: ssl.SSLContext, trusted: Path) -> bool:
    """Whether a handshake in memory succeeds for one who trusts this certificate alone."""
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    server = context.wrap_bio(to_server, to_client, server_side=True)
    client = ssl.create_default_context(cafile=trusted).wrap_bio(to_client, to_server, server_hostname="127.0.0.1")
    done = set[ssl.SSLObject]()
    while len(done) < 2:
        for side in {client, server} - done:
            try:
                side.do_handshake()
                done.add(side)
            except ssl.SSLWantReadError:
                pass
    return True


def test_a_file_is_sent_packed_once_and_not_again(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "page.js").write_text("let a = 1;\n" * 100, encoding="utf-8")
    (tmp_path / "secret.key").write_text("no", encoding="utf-8")
    files = Static(tmp_path).files
    assert list(files) == ["deep/page.js"]
    file = files["deep/page.js"]
    assert file.packed is not None
    assert len(file.packed) < 100 < len(file.data)

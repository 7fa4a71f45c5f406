"""`orchestrator demo --page`: the demo in a browser, until Ctrl-C."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

import pytest

from tests.waiting import wait_until
from tests.whole.station import die_with_parent


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_it_says_where_and_leaves_nothing_when_it_is_ended(tmp_path: Path, end: signal.Signals) -> None:
    short = tmp_path.parents[1] / f"{os.getpid()}"  # a socket's path has 107 bytes at most
    short.mkdir(exist_ok=True)
    command = [sys.executable, "-P", "-m", "orchestrator", "demo", "--page", "--plain"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        preexec_fn=die_with_parent,
        env={**os.environ, "TMPDIR": str(short)},
    ) as process:
        assert process.stdout is not None
        address = next(found[0] for line in process.stdout if (found := re.search(r"http://127\.0\.0\.1:\d+/", line)))
        wait_until(lambda: b'"bay-1"' in urlopen(f"{address}api/status", timeout=5).read(), 10, "the bay", 0.05)
        process.send_signal(end)
        _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    assert not list(short.iterdir())
    with pytest.raises(OSError, match=r"refused|reset"):
        urlopen(address, timeout=5)

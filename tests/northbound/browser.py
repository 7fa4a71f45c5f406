"""Drives Debian's Chromium by the DevTools protocol over two pipes: no driver, no port, no package.

A `Tab` is one page. Expressions are JavaScript; their value comes back as JSON.
"""

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from select import select
from time import monotonic
from types import TracebackType
from typing import Any, Self

PROGRAM = shutil.which("chromium")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--mute-audio",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--remote-debugging-pipe",
)  # fmt: skip
WITHIN_S = 15.0
END_S = 5.0


class Browser:
    """`with Browser(directory) as browser`: Chromium runs, with a profile of its own in `directory`."""

    def __init__(self, directory: Path) -> None:
        assert PROGRAM is not None
        (read, self._out), (self._in, write) = os.pipe(), os.pipe()
        arguments = (PROGRAM, *OPTIONS, f"--user-data-dir={directory}", "about:blank")
        self._process = subprocess.Popen(  # the shell puts the pipes where Chromium looks for them
            ["bash", "-c", f'exec "$0" "$@" 3<&{read} 4>&{write}', *arguments], pass_fds=(read, write),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(read)
        os.close(write)
        self._ids, self._rest = count(1), b""
        self._answers: dict[int, Mapping[str, Any]] = {}
        self.events: list[Mapping[str, Any]] = []

    def ask(self, method: str, session: str = "", **params: object) -> Mapping[str, Any]:
        """One command and its result."""
        id_ = next(self._ids)
        message = {"id": id_, "method": method, "params": params, **({"sessionId": session} if session else {})}
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end_s = monotonic() + WITHIN_S
        while id_ not in self._answers:
            self._read(end_s, method)
        answer = self._answers.pop(id_)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]  # type: ignore[no-any-return]  # JSON

    def _read(self, end_s: float, what: str) -> None:
        ready, *_ = select([self._in], [], [], max(end_s - monotonic(), 0.0))
        data = os.read(self._in, 1 << 16) if ready else b""
        assert data, f"Chromium did not answer: {what}"
        *messages, self._rest = (self._rest + data).split(b"\0")
        for one in map(json.loads, messages):
            if "id" in one:
                self._answers[one["id"]] = one
            else:
                self.events.append(one)

    def tab(self, *, width: int = 1280, height: int = 800, language: str = "en-GB", dark: bool = False) -> "Tab":
        """A new page, in the same browser as the others: they share storage, locks and connections."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        tab = Tab(self, target, session)
        for domain in ("Page", "Runtime", "Network", "Log"):
            tab.ask(f"{domain}.enable")
        tab.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        tab.ask("Emulation.setLocaleOverride", locale=language)
        tab.ask("Network.setUserAgentOverride", userAgent="test", acceptLanguage=language)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        tab.ask("Emulation.setEmulatedMedia", features=[scheme, {"name": "prefers-reduced-motion", "value": "reduce"}])
        return tab

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._out)  # Chromium ends with its pipe
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)


class Tab:
    """One page of the browser."""

    def __init__(self, browser: Browser, target: str, session: str) -> None:
        self._browser, self._target, self._session = browser, target, session

    def ask(self, method: str, **params: object) -> Mapping[str, Any]:
        return self._browser.ask(method, self._session, **params)

    def open(self, url: str, until: str) -> Self:
        """Go there, and wait for what it should show."""
        self.ask("Page.navigate", url=url)
        self.wait(until)
        return self

    def value(self, expression: str) -> Any:
        """The value of an expression; a promise is waited for."""
        found = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, f"{expression}: {found['exceptionDetails']}"
        return found["result"].get("value")

    def wait(self, expression: str, within_s: float = WITHIN_S) -> None:
        """Wait until it is true, looking often."""
        look = f"(() => {{ try {{ return Boolean({expression}) }} catch {{ return false }} }})()"
        loop = (
            f"new Promise((done) => {{ const end = Date.now() + {within_s * 1000}; (function again() "
            f"{{ const it = {look}; it || Date.now() > end ? done(it) : setTimeout(again, 10) }})() }})"
        )
        end_s = monotonic() + within_s
        while not self.value(loop):  # a navigation ends a promise early
            assert monotonic() < end_s, f"never true: {expression}\n{self.value('document.body?.innerText')}"

    def text(self, selector: str) -> str:
        return str(self.value(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''"))

    def mouse(self, selector: str, *kinds: str) -> None:
        """Press or release the mouse over an element's centre."""
        x, y = self.value(
            f"(({{left, top, width, height}}) => [left + width / 2, top + height / 2])((() => {{ const it = "
            f"document.querySelector({json.dumps(selector)}); it.scrollIntoView({{block: 'center'}}); "
            "return it.getBoundingClientRect() })())"
        )
        for kind in kinds:
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def click(self, selector: str) -> None:
        self.mouse(selector, "mousePressed", "mouseReleased")

    def key(self, key: str, code: int, *kinds: str) -> None:
        for kind in kinds:
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def requests(self) -> list[str]:
        """The addresses asked for by this page."""
        return [
            one["params"]["request"]["url"]
            for one in self._browser.events
            if one.get("sessionId") == self._session and one["method"] == "Network.requestWillBeSent"
        ]

    def posted(self) -> list[Mapping[str, Any]]:
        """The bodies sent by this page."""
        sent = [
            one["params"]["request"]
            for one in self._browser.events
            if one.get("sessionId") == self._session and one["method"] == "Network.requestWillBeSent"
        ]
        return [json.loads(one["postData"]) for one in sent if "postData" in one]

    def complaints(self) -> list[str]:
        """What the console says: errors, and violations of the content security policy."""
        found = [one for one in self._browser.events if one.get("sessionId") == self._session]
        logged = [one["params"]["entry"]["text"] for one in found if one["method"] == "Log.entryAdded"]
        return logged + [str(one["params"]) for one in found if one["method"] == "Runtime.exceptionThrown"]

    def picture(self, file: Path) -> None:
        file.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot")["data"]))

    def close(self) -> None:
        self._browser.ask("Target.closeTarget", targetId=self._target)

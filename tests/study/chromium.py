"""Chromium without a window, driven through a pair of pipes: pages, their console, requests and prints."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WORDS = "--headless=new --no-sandbox --disable-dev-shm-usage --remote-debugging-pipe --hide-scrollbars"
WORDS += " --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"  # WebGL without a graphics card


class Browser:
    """One page in a browser of its own; ``told`` collects console messages, errors and requests."""

    def __init__(self, profile: Path) -> None:
        there, self._write = os.pipe()
        self._read, back = os.pipe()

        def pipes() -> None:  # the browser reads from 3 and writes to 4
            one, two = os.dup(there), os.dup(back)
            os.dup2(one, 3)
            os.dup2(two, 4)

        self._process = subprocess.Popen(
            [str(PROGRAM), *WORDS.split(), f"--user-data-dir={profile}", "about:blank"],
            preexec_fn=pipes, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(there)
        os.close(back)
        self._rest, self._number, self._session = b"", 0, None
        self.told: list[tuple[str, str]] = []
        page = next(t for t in self.do("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self.do("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def do(self, method: str, **values: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": values}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            pass
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            chunk = os.read(self._read, 1 << 20)
            assert chunk, "the browser ended"
            self._rest += chunk
        text, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        self._hear(message.get("method", ""), message.get("params", {}))
        return message

    def _hear(self, event: str, values: dict[str, Any]) -> None:
        if event == "Runtime.consoleAPICalled":
            self.told.append(("console", str(values["args"])))
        elif event == "Runtime.exceptionThrown":
            self.told.append(("error", str(values["exceptionDetails"])))
        elif event == "Log.entryAdded" and values["entry"]["level"] != "warning":
            self.told.append(("log", values["entry"]["text"]))
        elif event == "Network.requestWillBeSent" and not values["request"]["url"].startswith(("data:", "file:")):
            self.told.append(("request", values["request"]["url"]))
        elif event == "Page.loadEventFired":
            self.told.append(("loaded", ""))

    def open(self, path: Path, width: int = 1100, height: int = 800, *, phone: bool = False) -> None:
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        self.do("Emulation.setTouchEmulationEnabled", enabled=phone)
        self.do("Emulation.setFocusEmulationEnabled", enabled=True)
        self.told.clear()
        self.do("Page.navigate", url=path.as_uri())
        while ("loaded", "") not in self.told:
            self._next()
        self.told.remove(("loaded", ""))

    def ask(self, expression: str) -> Any:
        answer = self.do("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = 30.0) -> Any:
        end = time.monotonic() + seconds
        while not (found := self.ask(f"(() => {{ try {{ return {expression} }} catch (e) {{ return null }} }})()")):
            assert time.monotonic() < end, expression
            time.sleep(0.1)
        return found

    def printed(self) -> bytes:
        return base64.b64decode(self.do("Page.printToPDF", preferCSSPageSize=True)["data"])

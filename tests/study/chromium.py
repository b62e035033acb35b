"""Chromium without a window, driven through a pair of pipes: pages, their console, requests and prints."""

import base64
import json
import os
import shutil
import subprocess
import time

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WORDS = "--headless=new --no-sandbox --disable-dev-shm-usage --remote-debugging-pipe --hide-scrollbars"
WORDS += " --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"  # WebGL without a graphics card


class Browser:
    """One page in a browser of its own; ``told`` collects the events of the page, with their values as JSON."""

    def __init__(self, profile):
        there, self._write = os.pipe()
        self._read, back = os.pipe()

        def pipes():  # the browser reads from 3 and writes to 4
            one, two = os.dup(there), os.dup(back)
            os.dup2(one, 3)
            os.dup2(two, 4)

        self._process = subprocess.Popen(
            [str(PROGRAM), *WORDS.split(), f"--user-data-dir={profile}", "about:blank"],
            preexec_fn=pipes, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(there)
        os.close(back)
        self._rest, self._number, self._session, self.told = b"", 0, {}, []
        page = next(t for t in self.do("Target.getTargets")["targetInfos"] if t["type"] == "page")
        session = self.do("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        self._session = {"sessionId": session}
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{domain}.enable")

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def do(self, method, **values):
        self._number += 1
        message = {"id": self._number, "method": method, "params": values, **self._session}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            pass
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def _next(self):
        while b"\0" not in self._rest:
            chunk = os.read(self._read, 1 << 20)
            assert chunk, "the browser ended"
            self._rest += chunk
        text, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(text)
        self.told.append((message.get("method"), json.dumps(message.get("params"))))
        return message

    def open(self, path, width=1100, height=800, *, phone=False):
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        self.do("Emulation.setTouchEmulationEnabled", enabled=phone)
        self.do("Emulation.setFocusEmulationEnabled", enabled=True)
        self.told.clear()
        self.do("Page.navigate", url=path.as_uri())
        while not any(event == "Page.loadEventFired" for event, _ in self.told):
            self._next()

    def ask(self, expression):
        answer = self.do("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression, seconds=30.0):
        end = time.monotonic() + seconds
        while not (found := self.ask(f"(() => {{ try {{ return {expression} }} catch (e) {{ return null }} }})()")):
            assert time.monotonic() < end, expression
            time.sleep(0.1)
        return found

    def printed(self):
        return base64.b64decode(self.do("Page.printToPDF", preferCSSPageSize=True)["data"])

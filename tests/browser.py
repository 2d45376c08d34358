"""Headless Chromium driven through a pipe: no network port, no driver, no package."""

import base64
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)


def find():
    """Path of a Chromium, CMPC_CHROMIUM first; skips the test where there is none."""
    for name in (os.environ.get("CMPC_CHROMIUM", ""), *NAMES):
        if name and shutil.which(name):
            return shutil.which(name)
    pytest.skip("no Chromium found (CMPC_CHROMIUM, " + ", ".join(NAMES) + ")")


class Browser:
    """One page of a headless Chromium, by the DevTools protocol."""

    def __init__(self, profile: Path, width: int, height: int) -> None:
        to_child, self._out = os.pipe()
        self._in, from_child = os.pipe()

        def give_pipes() -> None:
            high = [os.dup(fd) for fd in (to_child, from_child)]
            while min(high) < 5:
                high = [os.dup(fd) for fd in high]
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        command = [find(), *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
        self._process = subprocess.Popen(
            command, preexec_fn=give_pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_child)
        os.close(from_child)
        self._number, self._buffer, self._session = 0, b"", None
        self.complaints: list[str] = []
        self.requests: list[str] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in targets if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self._width = width
        self.resize(height)

    def resize(self, height=None):
        """Show so many pixels of the page, the whole of it without an argument, and wait until it is drawn."""
        height = height or self.run("document.documentElement.scrollHeight")
        metrics = {"width": self._width, "height": height, "deviceScaleFactor": 1, "mobile": self._width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 50))))")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait()
        os.close(self._out)
        os.close(self._in)

    def call(self, method, **params):
        """Send a command and wait for its answer; events in between are noted."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _read(self):
        while b"\0" not in self._buffer:
            data = os.read(self._in, 1 << 20)
            assert data, "Chromium ended"
            self._buffer += data
        first, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(first)

    def _note(self, event):
        method, params = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(params["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.complaints.append(json.dumps(params["args"])[:500])
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.complaints.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"][:200])

    def open(self, path, fragment=""):
        """Load a file and wait until it says that it is ready."""
        self.call("Page.navigate", url="about:blank")  # another fragment alone would not load the page anew
        self.call("Page.navigate", url=path.resolve().as_uri() + fragment)
        self.run(
            "new Promise((done, fail) => { const look = () => document.documentElement?.dataset.ready"
            " ? requestAnimationFrame(() => requestAnimationFrame(done)) : setTimeout(look, 20); look();"
            " setTimeout(() => fail(new Error('not ready')), 15000); })"
        )

    def run(self, code):
        """Value of a JavaScript expression; a promise is waited for."""
        answer = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def press(self, key, text=None, modifiers=0):
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            extra = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, **extra)

    def mouse(self, kind, x, y, **extra):
        """Move, press or release the mouse: "mouseMoved", "mousePressed", "mouseReleased"."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **extra)

    def screenshot(self, path=None):
        """What is shown as an RGB array (height, width, 3); kept as a PNG if a path is given."""
        import io

        import numpy as np
        from PIL import Image

        shot = self.call("Page.captureScreenshot", format="png")
        data = base64.b64decode(shot["data"])
        if path is not None:
            path.write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

"""Chromium without a window, controlled through its debugging pipe with Python's standard library only."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def find():
    """Return the path of Chromium, or None if it is not installed."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Page:
    """A tab of the browser; `complaints` has the messages of its console, `requests` the addresses that it loads."""

    def __init__(self, browser, width, height=900, dark=False, reduced=True):
        self.browser = browser
        self.complaints, self.requests = [], []
        self.loaded = False
        self.target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = browser.call("Target.attachToTarget", targetId=self.target, flatten=True)["sessionId"]
        browser.pages[self.session] = self
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height)
        features = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce" if reduced else "no-preference"},
        ]
        self.call("Emulation.setEmulatedMedia", features=features)

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def resize(self, width, height=900):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def open(self, file):
        self.loaded = False
        self.call("Page.navigate", url=Path(file).resolve().as_uri())
        self.browser.until(lambda: self.loaded)
        return self

    def run(self, script):
        """Return the value of an expression of JavaScript; of a promise, the value that it resolves to."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def settle(self, frames=3):
        """Wait until the page has painted this number of frames."""
        step = "new Promise(done => requestAnimationFrame(() => setTimeout(done)))"
        for _ in range(frames):
            self.run(step)

    def everything(self):
        """Scroll through the page, so that every figure becomes interactive, and return to the top."""
        self.run(
            "(async () => { for (let y = 0; y < document.documentElement.scrollHeight; y += 400) {"
            " scrollTo(0, y); await new Promise(done => requestAnimationFrame(() => setTimeout(done, 20))); }"
            " scrollTo(0, 0); })()"
        )
        self.settle()

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)
        self.settle(2)

    def drag(self, start, end):
        button = {"button": "left", "buttons": 1, "clickCount": 1}
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start, **button)
        for part in (0.3, 0.7, 1.0):
            x, y = (a + part * (b - a) for a, b in zip(start, end))
            self.mouse("mouseMoved", x, y, button="left", buttons=1)
        self.mouse("mouseReleased", *end, **button)

    def screenshot(self, file, whole=True):
        if whole:
            height = self.run("document.documentElement.scrollHeight")
            width = self.run("innerWidth")
            self.resize(width, min(height, 16000))
            self.settle(4)
        data = self.call("Page.captureScreenshot", format="png")["data"]
        Path(file).write_bytes(base64.b64decode(data))

    def print(self):
        """Return the page as a PDF on A4 paper."""
        data = self.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
        return base64.b64decode(data)


class Browser:
    """A running browser with an empty profile of its own."""

    def __enter__(self):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_read, self.to_browser = os.pipe()
        self.from_browser, to_write = os.pipe()
        flags = (
            "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
            "--disable-component-update --disable-sync --hide-scrollbars --remote-debugging-pipe "
            # A tab in the background is painted, too.
            "--disable-backgrounding-occluded-windows --disable-renderer-backgrounding"
        ).split()

        # The browser reads its commands from the file descriptor 3 and writes its answers to 4.
        script = 'exec 3<&"$1" 4>&"$2"; shift 2; exec "$@"'
        command = ["bash", "-c", script, "bash", str(to_read), str(to_write), find()]
        self.process = subprocess.Popen(
            [*command, *flags, f"--user-data-dir={self.profile.name}", "about:blank"],
            pass_fds=(to_read, to_write), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(to_write)
        self.buffer, self.next, self.answers, self.pages = b"", 0, {}, {}
        return self

    def __exit__(self, *_):
        try:
            self.call("Browser.close")
            self.process.wait(10)
        except Exception:
            self.process.kill()
        self.profile.cleanup()

    def call(self, method, session=None, **parameters):
        self.next += 1
        number = self.next
        message = {"id": number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.to_browser, data):]
        self.until(lambda: number in self.answers)
        answer = self.answers.pop(number)
        if "error" in answer:
            raise AssertionError(f"{method}: {answer['error']}")
        return answer["result"]

    def until(self, is_done, seconds=60):
        end = time.monotonic() + seconds
        while not is_done():
            if time.monotonic() > end:
                raise TimeoutError("the browser does not answer")
            if select.select([self.from_browser], [], [], max(0.0, end - time.monotonic()))[0]:
                self._read()

    def _read(self):
        part = os.read(self.from_browser, 1 << 20)
        if not part:
            raise AssertionError("the browser ended")
        *messages, self.buffer = (self.buffer + part).split(b"\0")
        for text in messages:
            message = json.loads(text)
            if "id" in message:
                self.answers[message["id"]] = message
            elif page := self.pages.get(message.get("sessionId")):
                self._event(page, message["method"], message["params"])

    @staticmethod
    def _event(page, method, params):
        if method == "Page.loadEventFired":
            page.loaded = True
        elif method == "Network.requestWillBeSent":
            page.requests.append(params["request"]["url"])
        elif method == "Runtime.consoleAPICalled":
            page.complaints.append(str(params["args"]))
        elif method == "Runtime.exceptionThrown":
            page.complaints.append(str(params["exceptionDetails"]))
        elif method == "Log.entryAdded":
            page.complaints.append(params["entry"]["text"])

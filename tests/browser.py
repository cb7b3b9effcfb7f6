"""A headless Chromium that tests drive through its own pipe, with a film in place of a camera."""

import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


class Page:
    """A page in a browser of its own; close it."""

    def __init__(self, url: str, *, film: Path | None = None, denied: bool = False, size: str = "1280,900") -> None:
        ours, theirs = os.pipe(), os.pipe()
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", f"--window-size={size}"]
        flags += ["--use-fake-device-for-media-stream", "--autoplay-policy=no-user-gesture-required"]
        flags += ["--mute-audio", "--disable-background-networking"]
        flags += ["--deny-permission-prompts"] if denied else ["--use-fake-ui-for-media-stream"]
        flags += [f"--use-file-for-fake-video-capture={film}"] if film else []

        def plug() -> None:  # the browser reads from 3 and writes to 4
            high = [os.dup(os.dup(os.dup(end))) for end in (ours[0], theirs[1])]
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self._process = subprocess.Popen(
            [str(BROWSER), *flags, "about:blank"],
            preexec_fn=plug,  # noqa: PLW1509 - no threads here
            pass_fds=(3, 4),
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        os.close(ours[0])
        os.close(theirs[1])
        self.process = self._process.pid
        self._out, self._in, self._rest, self._number = ours[1], theirs[0], b"", 0
        self.events: list[dict[str, Any]] = []
        self._session: str | None = None
        try:
            self._attach(url)
        except BaseException:
            self.__exit__()
            raise

    def _attach(self, url: str) -> None:
        (target,) = [one for one in self.send("Target.getTargets")["targetInfos"] if one["type"] == "page"]
        attached = self.send("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")
        self.open(url)

    def open(self, url: str) -> None:
        """Load a page from its beginning, also one that differs behind # alone."""
        self.send("Page.navigate", url="about:blank")
        self.until("location.href === 'about:blank'")
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def send(self, method: str, **params: Any) -> Any:
        self._number += 1
        session = {"sessionId": self._session} if self._session else {}
        message = {"id": self._number, "method": method, "params": params, **session}
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                if not select.select([self._in], [], [], 60.0)[0] or not (more := os.read(self._in, 1 << 20)):
                    raise TimeoutError(f"{method}: the browser does not answer")
                self._rest += more
            one, self._rest = self._rest.split(b"\0", 1)
            answer = json.loads(one)
            if answer.get("id") != self._number:
                self.events.append(answer)
            elif "error" in answer:
                raise RuntimeError(answer["error"]["message"])
            else:
                return answer["result"]

    def run(self, program: str) -> Any:
        answer = self.send(
            "Runtime.evaluate", expression=program, returnByValue=True, awaitPromise=True, userGesture=True
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "failed"))
        return answer["result"].get("value")

    def until(self, condition: str, seconds: float = 180.0) -> Any:
        """Return what a condition has become as soon as it is no longer false."""
        end = time.monotonic() + seconds
        while not (found := self.run(condition)):
            if time.monotonic() > end:
                raise TimeoutError(condition)
            time.sleep(0.1)
        return found

    def key(self, name: str) -> None:
        self.send("Input.dispatchKeyEvent", type="keyDown", key=name, text=name if len(name) == 1 else "")
        self.send("Input.dispatchKeyEvent", type="keyUp", key=name)

    def said(self) -> list[str]:
        """Return errors and warnings of the console and the page."""
        self.run("0")
        logs = [e["params"]["entry"]["text"] for e in self.events if e.get("method") == "Log.entryAdded"]
        errors = [e["params"]["exceptionDetails"] for e in self.events if e.get("method") == "Runtime.exceptionThrown"]
        return logs + [e.get("exception", {}).get("description", e["text"]) for e in errors]

    def asked(self) -> list[str]:
        """Return the addresses that were asked for."""
        self.run("0")
        sent = [e["params"]["request"]["url"] for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return [url for url in sent if not url.startswith(("data:", "blob:"))]

    def picture(self, path: Path) -> None:
        from base64 import b64decode

        path.write_bytes(b64decode(self.send("Page.captureScreenshot", format="png")["data"]))

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(timeout=20)
        os.close(self._out)
        os.close(self._in)

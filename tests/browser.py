"""A headless Chromium that tests drive through its own pipe, with a film in place of a camera."""

import json
import os
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
        os.set_inheritable(ours[0], True)
        os.set_inheritable(theirs[1], True)
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", f"--window-size={size}"]
        flags += ["--use-fake-device-for-media-stream", "--autoplay-policy=no-user-gesture-required"]
        flags += ["--mute-audio", "--disable-background-networking"]
        flags += ["--deny-permission-prompts"] if denied else ["--use-fake-ui-for-media-stream"]
        flags += [f"--use-file-for-fake-video-capture={film}"] if film else []
        self._process = subprocess.Popen(
            ["sh", "-c", f'exec "$@" 3<&{ours[0]} 4>&{theirs[1]}', "sh", str(BROWSER), *flags, "about:blank"],
            pass_fds=(ours[0], theirs[1]),
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        os.close(ours[0])
        os.close(theirs[1])
        self._out, self._in, self._rest, self._number = ours[1], theirs[0], b"", 0
        self.events: list[dict[str, Any]] = []
        self._session: str | None = None
        (target,) = [one for one in self.send("Target.getTargets")["targetInfos"] if one["type"] == "page"]
        attached = self.send("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def send(self, method: str, **params: Any) -> Any:
        self._number += 1
        session = {"sessionId": self._session} if self._session else {}
        message = {"id": self._number, "method": method, "params": params, **session}
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                self._rest += os.read(self._in, 1 << 20)
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

    def until(self, condition: str, seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not self.run(condition):
            if time.monotonic() > end:
                raise TimeoutError(condition)
            time.sleep(0.1)

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

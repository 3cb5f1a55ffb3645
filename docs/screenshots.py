"""Pictures of every kind of report, and whether a browser finds fault with any.

    python docs/screenshots.py                      # build/screenshots/KIND-WIDTH-LOOK.png, KIND-paper.pdf
    python docs/screenshots.py --only fit-hyd validate
    python docs/screenshots.py --pages runs/excavator/fit/report.html    # of pages that are there
    python docs/screenshots.py --axe axe.min.js     # also asks axe-core, a checker of accessibility

The reports come from small fits of the virtual rig's logs, made once in
build/screenshots/runs. It needs Chromium. axe.min.js is in the package axe-core of npm.
"""

import argparse
import asyncio
import base64
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tornado.websocket import WebSocketClientConnection, websocket_connect

ROOT = Path(__file__).parents[1]
LOG, OTHER = (str(ROOT / f"examples/logs/rig_shoulder_{n}.csv") for n in (1, 2))
KINDS = {
    "fit-mech": ("fit-mech", LOG, "--set", "refinement.iterations=12"),
    "fit-hyd": ("fit-hyd", LOG, "--mech", "fit-mech"),
    "validate": ("validate", OTHER, LOG, "--fit", "fit-hyd", "--fit", "fit-mech"),
}
"""the command that makes each report; names of other kinds stand for their folders"""
WIDTHS = (400, 1400)
LOOKS = ("light", "dark")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PROBE = """(() => { const page = document.documentElement; return {
  ready: page.dataset.ready, width: innerWidth, content: page.scrollWidth, height: page.scrollHeight,
  empty: [...document.querySelectorAll(".chart")].filter(
    (e) => e.offsetParent && !e.querySelector(".panel > div > *")).length,
}; })()"""
OPEN = 'document.querySelectorAll("details").forEach((one) => { one.open = true; })'
AXE = """axe.run({runOnly: ["wcag2a", "wcag2aa", "best-practice"]}).then((found) => found.violations.map(
  (v) => `${v.impact} ${v.id}: ${v.help} (${v.nodes.length}, such as ${v.nodes[0].target})`))"""


def main() -> None:
    """Make the reports that are missing, and take their pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=ROOT / "build/screenshots")
    parser.add_argument(
        "--only", nargs="+", choices=KINDS, default=list(KINDS), metavar="KIND"
    )
    parser.add_argument("--pages", nargs="+", type=Path, default=[], metavar="PAGE")
    parser.add_argument("--axe", type=Path, help="axe.min.js")
    asked = parser.parse_args()
    pages = {"-".join(one.parts[-3:-1]): one.resolve() for one in asked.pages}
    if not pages:
        pages = {kind: page(kind, asked.out.resolve() / "runs") for kind in asked.only}
    asked.out.mkdir(parents=True, exist_ok=True)
    asyncio.run(
        shoot(pages, asked.out.resolve(), asked.axe.read_text() if asked.axe else "")
    )


def page(kind: str, runs: Path) -> Path:
    """Return the page of a kind of report, which is made if it is missing."""
    folder = runs / kind
    if not list(folder.glob("*.html")):
        command, *given = KINDS[kind]
        used = [name for name in given if name in KINDS]
        for name in used:
            page(name, runs)
        paths = [str(runs / one) if one in used else one for one in given]
        done = [
            sys.executable,
            "-m",
            "hydroid",
            command,
            *paths,
            "--out",
            str(folder),
            "--quiet",
        ]
        print(" ".join(done[2:]), flush=True)
        if subprocess.run(done, cwd=ROOT).returncode:
            sys.exit(f"{kind} was not made")
    order = sorted(
        folder.glob("*.html"), key=lambda file: (file.name != "report.html", file.name)
    )
    return order[0]


@contextmanager
def browser() -> Generator[Path]:
    """Start Chromium, and return its profile; it ends with the context."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        sys.exit("needs Chromium")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        how = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--remote-debugging-port=0",
        ]
        process = subprocess.Popen(
            [program, *how, f"--user-data-dir={profile}", "about:blank"],
            stderr=subprocess.DEVNULL,
        )
        try:
            yield Path(profile)
        finally:
            process.terminate()
            process.wait()


async def shoot(pages: dict[str, Path], out: Path, axe: str) -> None:
    """Take the pictures of some pages, and print what is wrong with them."""
    with browser() as profile:
        tab = await connected(profile)
        for kind, file in pages.items():
            for width in WIDTHS:
                for look in LOOKS:
                    found = await tab.picture(
                        file, (width, look), out / f"{kind}-{width}-{look}.png", axe
                    )
                    print(
                        f"{kind} {width} {look}: {'; '.join(found) or 'nothing'}",
                        flush=True,
                    )
            await tab.paper(file, out / f"{kind}-paper.pdf")


async def connected(profile: Path) -> "Tab":
    """Return the first tab of a browser that is starting."""
    port = profile / "DevToolsActivePort"
    while not (port.exists() and port.read_text().strip()):
        await asyncio.sleep(0.1)
    number, path = port.read_text().split()
    tab = Tab(
        await websocket_connect(
            f"ws://127.0.0.1:{number}{path}", max_message_size=1 << 28
        )
    )
    targets = (await tab.ask("Target.getTargets"))["targetInfos"]
    target = next(t["targetId"] for t in targets if t["type"] == "page")
    attached = await tab.ask("Target.attachToTarget", targetId=target, flatten=True)
    tab.session = attached["sessionId"]
    for domain in ("Page", "Runtime", "Network", "Log"):
        await tab.ask(f"{domain}.enable")
    return tab


class Tab:
    """A tab of Chromium, driven by its DevTools protocol."""

    def __init__(self, socket: WebSocketClientConnection) -> None:
        self.socket, self.session, self.number = socket, "", 0
        self.problems: list[str] = []

    async def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command, and return its answer; what the page complains of meanwhile
        is kept."""
        self.number += 1
        sent = {"id": self.number, "method": method, "params": parameters}
        await self.socket.write_message(
            json.dumps(sent | ({"sessionId": self.session} if self.session else {}))
        )
        while True:
            text = await self.socket.read_message()
            assert text is not None, "the browser has closed"
            message = json.loads(text)
            self._note(message)
            if message.get("id") == self.number:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]

    def _note(self, message: dict[str, Any]) -> None:
        what, how = message.get("method"), message.get("params", {})
        if what == "Runtime.exceptionThrown":
            self.problems.append(
                f"error: {how['exceptionDetails'].get('exception', {}).get('description')}"
            )
        elif what == "Log.entryAdded" or (
            what == "Runtime.consoleAPICalled" and how["type"] == "error"
        ):
            self.problems.append(f"console: {how.get('entry', how.get('args'))}")
        elif what == "Network.requestWillBeSent":
            url = how["request"]["url"]
            if not url.startswith(("file:", "data:", "about:")):
                self.problems.append(f"request: {url}")

    async def value(self, script: str) -> Any:
        """Run a script, and return its value."""
        answer = await self.ask(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        return answer["result"].get("value")

    async def load(self, file: Path, width: int, look: str) -> dict[str, Any]:
        """Open a page with all its folded parts, and return what PROBE finds."""
        self.problems.clear()
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        await self.ask("Emulation.setDeviceMetricsOverride", **size)
        await self.ask(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": look}],
        )
        await self.ask("Page.navigate", url=file.as_uri())
        began = time.monotonic()
        while (await self.value(PROBE) or {}).get(
            "ready"
        ) != "yes" and time.monotonic() < began + 60:
            await asyncio.sleep(0.1)
        await self.value(OPEN)
        await asyncio.sleep(2)
        return await self.value(PROBE)

    async def shot(self, left: float, top: float, width: float, height: float) -> bytes:
        """Return a part of the page [px] as PNG."""
        clip = {"x": left, "y": top, "width": width, "height": height, "scale": 1}
        taken = await self.ask(
            "Page.captureScreenshot", captureBeyondViewport=True, clip=clip
        )
        return base64.b64decode(taken["data"])

    async def picture(
        self, file: Path, seen: tuple[int, str], out: Path, axe: str
    ) -> Sequence[str]:
        """Take a picture of the whole page, and return what is wrong with it."""
        found = await self.load(file, *seen)
        out.write_bytes(await self.shot(0, 0, seen[0], min(found["height"], 16000)))
        wrong = list(self.problems)
        if found["content"] > found["width"]:
            wrong.append(f"is {found['content']} px wide")
        if found["empty"]:
            wrong.append(f"{found['empty']} charts are empty")
        if axe:
            await self.value(axe)
            wrong += await self.value(AXE)
        return wrong

    async def paper(self, file: Path, out: Path) -> None:
        """Print a page on A4."""
        await self.load(file, 1400, "light")
        printed = await self.ask(
            "Page.printToPDF", paperWidth=8.27, paperHeight=11.69, printBackground=False
        )
        out.write_bytes(base64.b64decode(printed["data"]))


if __name__ == "__main__":
    main()

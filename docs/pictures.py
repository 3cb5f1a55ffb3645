"""The pictures of the documentation that show the demo's fits (`make demo` first; needs
Chromium and OpenGL).

python docs/pictures.py [runs/demo]      # docs/arm_moving.gif, docs/report.png, docs/report_*.png
"""

import asyncio
import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from screenshots import browser, connected

from hydroid import load_identified, load_settings, read_logs
from hydroid.viewer.film import rendered
from hydroid.viewer.motion import simulated_motion

HERE = Path(__file__).parent
LOG = HERE.parent / "examples" / "logs" / "rig_shoulder_2.csv"
FITS = {"mech": "stage 1, a gain", "hyd": "stage 2, the hydraulics"}
SIZE, RATE, SPAN = (400, 330), 8, (3.4, 9.4)
"""of each arm [px]; pictures in a second; from when to when [s]"""
COLORS = 64
SHOTS = {
    "report": ("hyd/report.html", "", (1000, 1240), "light"),
    "report_phone": ("hyd/report.html", "", (400, 1000), "dark"),
    "report_motion": ("mech/report.html", ".beside", (1000, 420), "light"),
    "report_speed": (
        "hyd/report.html",
        "Valve: dead band and speed",
        (1000, 760),
        "light",
    ),
    "report_step": (
        "hyd/report.html",
        "Step and frequency response",
        (1000, 0),
        "light",
    ),
    "report_residuals": (
        "hyd/report.html",
        "Confidence intervals: are the residuals white?",
        (1000, 0),
        "dark",
    ),
}
"""page, title of the section or a selector (without: the page's beginning), width and
height [px] (0: to the end of the section), look"""
PLACE = """(() => { const place = (document.querySelector("%s".startsWith(".") ? "%s" : "none")
  ?? [...document.querySelectorAll("section, details")].find(
    (one) => one.querySelector("h2")?.textContent === "%s")).getBoundingClientRect();
  return [place.top + scrollY, place.height]; })()"""
FOLD = 'document.querySelectorAll("details").forEach((one) => { one.open = false; })'


def moving(demo: Path) -> None:
    """Film the arm with the fits of both stages, each over the ghost of a log that
    neither has seen."""
    log = read_logs(LOG, load_settings("fit-mech"))[0]
    motions = {
        words: simulated_motion(load_identified(demo / name), {"alone": log})
        for name, words in FITS.items()
    }
    pictures: list[Image.Image] = []
    times = np.arange(*SPAN, 1 / RATE).tolist()
    for words, motion in motions.items():
        left = list(motions).index(words) * SIZE[0]
        for k, shown in enumerate(
            rendered(motion, SIZE, ((time, "") for time in times))
        ):
            if len(pictures) <= k:
                pictures.append(Image.new("RGB", (len(motions) * SIZE[0], SIZE[1])))
            pictures[k].paste(Image.fromarray(shown), (left, 0))
            draw = ImageDraw.Draw(pictures[k])
            draw.text((left + 10, 8), words, "#101010", ImageFont.load_default(17))
            error = f"error {motion.error:.2g}° rms, {times[k]:.1f} s"
            draw.text((left + 10, 30), error, "#101010", ImageFont.load_default(14))
    frames = [one.quantize(COLORS, dither=Image.Dither.NONE) for one in pictures]
    how = {
        "save_all": True,
        "append_images": frames[1:],
        "duration": 1000 // RATE,
        "loop": 0,
    }
    frames[0].save(HERE / "arm_moving.gif", optimize=True, **how)


async def shots(demo: Path) -> None:
    """Take pictures of parts of reports."""
    with browser() as profile:
        tab = await connected(profile)
        for name, (page, title, (width, height), look) in SHOTS.items():
            await tab.load(demo / page, width, look)
            if title:
                top, whole = await tab.value(PLACE % (title, title, title))
            else:
                top, whole = await tab.value(f"{FOLD}, [0, 0]")
            file = HERE / f"{name}.png"
            file.write_bytes(await tab.shot(0, top, width, height or whole))
            Image.open(file).convert("RGB").quantize(
                128, dither=Image.Dither.NONE
            ).save(file, optimize=True)


if __name__ == "__main__":
    runs = Path(*sys.argv[1:2] or ["runs/demo"]).resolve()
    asyncio.run(shots(runs))
    moving(runs)

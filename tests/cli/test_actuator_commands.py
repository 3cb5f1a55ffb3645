"""`plot-actuator` and `view` as a user meets them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOG = ROOT / "examples" / "logs" / "rig_shoulder_1.csv"


def hydroid(*arguments: object, cwd: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from hydroid.cli.app import main; main()", *map(str, arguments)]
    blind = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, env=blind)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_an_estimate_is_drawn_with_the_settings_beside_it(tmp_path: Path):
    run = tmp_path / "run"
    run.mkdir()
    (run / "config.yaml").write_text((ROOT / "configs" / "fit-hyd.yaml").read_text())
    (run / "estimate.yaml").write_text("parameters: {A_A: 900, F1: 7.5}\n")
    done = hydroid("plot-actuator", "--params", run / "estimate.yaml", "--out", "out", cwd=tmp_path)
    assert done.stdout == f"{Path('out') / 'actuator.html'}\n"
    assert (tmp_path / "out" / "figures" / "actuator.svg").stat().st_size > 0
    assert (tmp_path / "out" / "figures" / "actuator.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["plot-actuator", "--out", "o", "--params", "bad.yaml"], "no force-stroke curve"),
        (["plot-actuator", "--out", "o", "--joint", "9"], "joints 1 to 7"),
        (
            ["plot-actuator", "--out", "o", "--config", "fit-mech"],
            "stage 1 (mech) does not model the actuators",
        ),
        (["view", "--params", "bad.yaml"], "no force-stroke curve"),
        (["view", "--pose", "asleep"], "no pose 'asleep'"),
        (["view", "--arm", "both"], "needs a log"),
        (["render", str(LOG), "-o", "a.avi"], "is no film or picture"),
        (["render", str(LOG), "--span", "now"], "'now' is no span"),
        (["render", "."], "cannot be read"),
    ],
)
def test_what_the_user_can_mend_is_one_line_and_exit_2(tmp_path: Path, arguments, says):
    (tmp_path / "bad.yaml").write_text("F1: 500\n")
    done = hydroid(*arguments, cwd=tmp_path, code=2)
    assert says in done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith("hydroid:")]
    assert len([line for line in lines if "note:" not in line and "compiling" not in line]) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.yaml"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_without_a_display_the_viewer_says_so_and_names_the_other_way(tmp_path: Path):
    done = hydroid("view", "-q", cwd=tmp_path, code=2)
    assert done.stderr.startswith("hydroid: no window can be opened")
    assert "hydroid render" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_motion_is_written_where_pictures_can_be_rendered(tmp_path: Path):
    short = tmp_path / "short.csv"
    short.write_text("\n".join(LOG.read_text().splitlines()[:101]) + "\n")
    command = "from hydroid.cli.app import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", command, "render", str(short), "-q", "-o", "a.gif"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    if done.returncode == 2 and "can be rendered" in done.stderr:
        pytest.skip("no OpenGL on this machine")
    assert done.returncode == 0, done.stderr
    from PIL import Image

    with Image.open(tmp_path / "a.gif") as picture:
        frames = []
        for k in range(picture.n_frames):
            picture.seek(k)
            frames.append(picture.convert("RGB").tobytes())
    assert len(frames) == 10
    assert len(set(frames)) > 5  # it moves


def test_a_former_option_names_what_it_is_now(tmp_path: Path):
    done = hydroid("view", "--gif", "a.gif", cwd=tmp_path, code=2)
    assert "--gif is now `hydroid render" in done.stderr

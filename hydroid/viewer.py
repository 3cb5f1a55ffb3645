"""The whole arm as one simulated member moves it: in MuJoCo's own viewer, in real time, or as a picture file.

What is stepped is the simulation, with the joints that move; the whole arm only takes over its angles. The
viewer's motor sliders are the commands in %: a log moves them, or, without one, the hand.
"""

import io
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any, Protocol

import mujoco
import mujoco.viewer
import numpy as np
from numpy.typing import NDArray

from hydroid.errors import RunError
from hydroid.settings.arm import Arm
from hydroid.simulation import HydraulicSimulation, Members
from hydroid.simulation.population import quiet_mujoco

Array = NDArray[np.float64]

FRAME = 1 / 60
"""between two pictures of the viewer [s]"""
LATE = 0.1
"""a machine too slow by this [s] shows slow motion instead of jumps"""
GIF_FRAME = 0.1
"""between two pictures of a file [s]"""
SIZE = 480, 360
"""of a file's pictures [px]"""


class Viewer(Protocol):
    """What is used of `mujoco.viewer.Handle`."""

    def is_running(self) -> bool: ...  # noqa: D102
    def sync(self) -> None: ...  # noqa: D102
    def set_texts(self, texts: Any) -> None: ...  # noqa: D102


class Player:
    """One member on its way, and the whole arm in the pose that it has.

    Args:
        spec: the arm's MJCF; its motors become the sliders.
        arm: its settings.
        simulation: what moves; its first pose is the start.
        member: one parameter set.
        angle: of all joints at each sample [rad], shape (T, J); what does not move stands as in the first.
        live: the sliders command, for ever; otherwise the record does, to its end.

    Attributes:
        model: the whole arm.
        data: its state; `ctrl` holds the commands [%].
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        arm: Arm,
        simulation: HydraulicSimulation,
        member: Members,
        angle: Array,
        *,
        live: bool,
    ) -> None:
        self._arm, self._simulation, self._member, self._angle = arm, simulation, member, angle
        self._live, self._steps = live, len(simulation.command)
        self._step = simulation.record.arm.model.opt.timestep
        for name in arm.joint_names:
            motor = spec.actuator(name)
            motor.ctrllimited, motor.ctrlrange = True, [-100.0, 100.0]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        motors = np.array([self.model.actuator(name).id for name in arm.joint_names])
        self._motors: NDArray[np.intp] = motors[simulation.joints]
        self.restart()

    def restart(self) -> None:
        """Go back to the start."""
        self._run, self._taken = self._simulation.begin(self._member), 0
        mujoco.mj_resetData(self.model, self.data)
        self._take_over()

    @property
    def time(self) -> float:
        """Simulated so far [s]."""
        return self._taken * self._step

    @property
    def duration(self) -> float:
        """Of the record [s]; inf where the sliders command."""
        return np.inf if self._live else self._steps * self._step

    def advance(self, until: float) -> None:
        """Simulate to the step before `until` [s], or to the record's end, and pose the arm so.

        Raises:
            RunError: the simulation diverged.
        """
        with quiet_mujoco():
            while self.time + self._step <= min(until, self.duration) + 1e-9:
                if not self._live:
                    self.data.ctrl[self._motors] = self._simulation.command[self._taken]
                self._run.step(self.data.ctrl[self._motors])
                self._taken += 1
            if not self._run.healthy.all():
                raise RunError(f"the simulation diverged before {self.time:.2f} s")
            self._take_over()

    def words(self) -> tuple[str, str]:
        """What stands beside the picture: joints that move, and command and angle of each."""
        moving = self._simulation.joints
        lines = [f"{self._arm.joint_names[j]}  {j + 1}" for j in moving]
        seen = [
            f"{self.data.ctrl[motor]:4.0f} %  {np.degrees(self.data.qpos[j]):7.2f} deg"
            + ("" if self._live else f"  (log {np.degrees(self._logged(int(j))):.2f})")
            for j, motor in zip(moving, self._motors, strict=True)
        ]
        return "\n".join(["time", *lines]), "\n".join([f"{self.time:.1f} s", *seen])

    def _logged(self, joint: int) -> float:
        sample = round(self.time / self._step) * len(self._angle) // (self._steps + 1)
        return float(self._angle[min(sample, len(self._angle) - 1), joint])

    def _take_over(self) -> None:
        self.data.qpos[:] = self._angle[0]
        self.data.qpos[self._simulation.record.joints] = self._run.position[0]
        self.data.time = self.time
        mujoco.mj_forward(self.model, self.data)


def play(
    player: Player,
    viewer: Viewer,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Show a player in real time until the window is closed; the viewer's reset starts it again.

    Raises:
        RunError: the simulation diverged.
    """
    begun = clock()
    while viewer.is_running():
        frame = clock()
        begun += max(0.0, frame - begun - player.time - LATE) if player.time < player.duration else 0.0
        player.advance(frame - begun)
        viewer.set_texts((None, None, *player.words()))
        viewer.sync()
        if player.data.time < player.time:
            player.restart()
            begun = clock()
        sleep(max(0.0, FRAME - (clock() - frame)))


def open_window(player: Player) -> Any:
    """Open MuJoCo's viewer on a player's arm.

    Raises:
        RunError: this machine cannot show a window.
    """
    _refuse_without_display()
    try:
        return mujoco.viewer.launch_passive(player.model, player.data, show_left_ui=False)
    except RuntimeError as error:  # macOS wants its own launcher
        raise RunError(str(error), cure="start it as `mjpython -m hydroid.cli.app view ...`") from None


def animation(player: Player, camera: str = "corner") -> bytes:
    """Render a player's record to its end as an animated GIF.

    Raises:
        RunError: the simulation diverged, or this machine cannot render.
    """
    from PIL import Image  # comes with matplotlib

    try:
        renderer = mujoco.Renderer(player.model, height=SIZE[1], width=SIZE[0])
    except (mujoco.FatalError, ImportError, RuntimeError) as error:
        raise _cannot_render(error) from None
    frames: list[Image.Image] = []
    for moment in np.arange(0.0, player.duration + GIF_FRAME, GIF_FRAME):
        player.advance(moment)
        renderer.update_scene(player.data, camera)
        frames.append(Image.fromarray(renderer.render()).quantize(128))
    renderer.close()
    buffer = io.BytesIO()
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=round(1e3 * GIF_FRAME), loop=0
    )
    return buffer.getvalue()

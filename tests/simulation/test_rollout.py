"""The compiled rollout in a process that is not its own: callbacks of MuJoCo, Numba's
cache."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import mujoco
import pytest

from hydroid.hydraulics import kernel
from hydroid.plant import batch
from hydroid.settings import linkage
from hydroid.simulation import (
    gravity,
    openings,
    quasi_static,
    rollout,
    settled,
    steady,
)
from hydroid.simulation.rollout import SteppedArm

ARM = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"


def test_a_users_own_passive_callback_stays_whoever_makes_an_arm_meanwhile():
    model = mujoco.MjModel.from_xml_string(ARM)
    calls: list[int] = []

    def own(m: mujoco.MjModel, d: mujoco.MjData) -> None:
        calls.append(1)

    mujoco.set_mjcb_passive(own)
    try:
        with ThreadPoolExecutor(4) as pool:
            arms = list(pool.map(lambda _: SteppedArm(model), range(40)))
        assert mujoco.get_mjcb_passive() is own
        mujoco.mj_step(model, arms[0].data)
        assert calls
    finally:
        mujoco.set_mjcb_passive(None)


def names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from names(constant)


def inlined(function: FunctionType, seen: set[FunctionType]) -> Iterator[Path]:
    """Files of hydroid that a compiled function takes code in from, its own among
    them."""
    if function in seen:
        return
    seen.add(function)
    yield Path(function.__code__.co_filename)
    for name in names(function.__code__):
        used: Any = function.__globals__.get(name)
        of_a_module = isinstance(used, ModuleType) and used.__name__.startswith(
            "hydroid"
        )
        assert not of_a_module, (
            f"{function.__name__} calls functions of {name}: follow them here"
        )
        # what is compiled by itself is taken in, too
        used = getattr(used, "py_func", used)
        if isinstance(used, FunctionType) and used.__module__.startswith("hydroid"):
            yield from inlined(used, seen)


@pytest.mark.parametrize(
    ("compiled", "more"),
    [
        (rollout.roll, []),
        (quasi_static.roll_quasi_static, [rollout.write_sample, gravity.hold]),
        (openings._open, []),  # pyright: ignore[reportPrivateUsage]
        (steady._steady, []),  # pyright: ignore[reportPrivateUsage]
        (
            batch._roll_some,  # pyright: ignore[reportPrivateUsage]
            [rollout.write_sample, quasi_static.share_pump, gravity.hold],
        ),
        (settled._settle, [steady.balanced_speed]),  # pyright: ignore[reportPrivateUsage]
    ],
)
def test_numbas_cache_is_keyed_by_every_file_that_a_function_takes_code_in_from(
    compiled, more
):
    function = compiled.py_func
    own = Path(function.__code__.co_filename)
    keyed = {*Path(kernel.__file__).parent.glob("*.py"), Path(linkage.__file__), own}
    keyed |= {Path(other.__code__.co_filename) for other in more}
    assert set(inlined(function, set())) <= keyed
    assert kernel.source_key(*more) in function.__defaults__


def test_the_key_changes_with_a_files_text(tmp_path: Path):
    file = tmp_path / "one.py"
    keys = set[int]()
    function = FunctionType(compile("", str(file), "exec"), {})
    for text in ("a = 1\n", "a = 2\n"):
        file.write_text(text)
        keys.add(kernel.source_key(function))
    assert len(keys | {kernel.SOURCE}) == 3

"""The compiled rollout in a process that is not its own: callbacks of MuJoCo, Numba's
cache."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import mujoco
import pytest

from hydroid.hydraulics import kernel
from hydroid.plant import batch
from hydroid.simulation import lone, openings, rollout, settled
from hydroid.simulation.laws import LAWS
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
    for cell in function.__closure__ or ():
        yield from inlined(cell.cell_contents, seen)


def fixed(compiled: Any) -> Any:
    """Return a function whose key is the kernel's, which is made again."""
    assert kernel.source_key() in compiled.py_func.__defaults__
    return compiled


MADE = {
    "push": lambda: fixed(openings._push),  # pyright: ignore[reportPrivateUsage]
    "open": lambda: fixed(openings._open),  # pyright: ignore[reportPrivateUsage]
}
"""what makes each compiled function, by name; not from a cache, so that its key is made
anew"""
for rung, law in LAWS.items():
    MADE[f"rollout of {rung.name}"] = partial(rollout.compiled.__wrapped__, law.roll)
    of_batch = batch._compiled.__wrapped__  # pyright: ignore[reportPrivateUsage]
    MADE[f"batch of {rung.name}"] = partial(of_batch, law.roll)
    if law.rod is not None:
        settle = settled._compiled.__wrapped__  # pyright: ignore[reportPrivateUsage]
        MADE[f"settled {rung.name}"] = partial(settle, law.rod, law.reaches)
    if law.lone is not None:
        of_one = lone._compiled.__wrapped__  # pyright: ignore[reportPrivateUsage]
        MADE[f"lone {rung.name}"] = partial(of_one, law.lone)


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_numbas_cache_is_keyed_by_every_file_that_a_function_takes_code_in_from(
    make, monkeypatch: pytest.MonkeyPatch
):
    keyed = set[Path]()
    read = Path.read_bytes

    def watched(file: Path) -> bytes:
        keyed.add(file)
        return read(file)

    monkeypatch.setattr(Path, "read_bytes", watched)
    function = make().py_func
    own = Path(function.__code__.co_filename)  # numba itself looks at this one
    assert len(keyed) > 10
    assert set(inlined(function, set())) <= keyed | {own}


def test_a_law_that_calls_through_a_module_is_refused():
    def rod(c, w, supply):
        return kernel.eliminate(c, w, supply)

    with pytest.raises(TypeError, match="rod: import what it uses of kernel"):
        kernel.source_key(rod)


def test_the_key_changes_with_a_files_text(tmp_path: Path):
    file = tmp_path / "one.py"
    keys = set[int]()
    function = FunctionType(compile("", str(file), "exec"), {"__name__": "one"})
    for text in ("a = 1\n", "a = 2\n"):
        file.write_text(text)
        keys.add(kernel.source_key(function))
    assert len(keys | {kernel.SOURCE}) == 3

"""Entries under `parameters` that stand for several -> one entry each: for each joint or
link, for each group of logs, and for each factor of a valve's curve."""

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import count
from typing import Any

from hydroid.files import Plain
from hydroid.quantity_table import CURVE, MECHANICAL
from hydroid.settings.arm import Arm
from hydroid.settings.load import each_once
from hydroid.settings.log import OTHER
from hydroid.words import distinct

MOST = 10_000
"""parameters of all groups"""
CURVES = {"curve": "", "curve_a": "_a", "curve_b": "_b"}
"""quantities that stand for the factors of a valve's curve, and what the names of these
end with"""
CURVE_BOUNDS = (0.003, 300.0)
"""of a factor: the first part of a valve that jumps open is some hundred times as steep
as the last"""
CURVE_SD = 0.3
"""scatter of the logarithm of neighbouring factors that one expects (ours)"""
GROUP = "group"
"""what `per` says of a parameter that has an effect in each group"""


def expanded(parameters: Mapping[str, Any], compared: Any, arm: Arm | None) -> Plain:
    """Return the settings of parameters, as YAML gives them,
    one entry for each joint or link of `each`.

    `compared` are the joints that `each: true` means; of masses it means all links.
    With one joint a mechanical parameter serves all joints, because those that are
    driven but not compared need it too.

    Raises ValueError: a parameter with `joints` or `link` and `each`.
    """
    result: Plain = {}
    for name, entry in parameters.items():
        each = None
        if isinstance(entry, dict):
            each = entry.get("each")
        if not each:
            _add(result, name, entry)
        elif entry.get("quantity") == "mass":
            _add_links(result, name, entry, arm)
        else:
            _add_joints(result, name, entry, compared, arm)
    return result


def _add(result: Plain, name: str, entry: Any) -> None:
    """Add an entry that needs no expansion; it changes one that `each` has made under
    its name."""
    if isinstance(entry, dict):
        entry = result.get(name, {}) | entry
    result[name] = entry


def _add_links(result: Plain, name: str, entry: Plain, arm: Arm | None) -> None:
    """Add a mass for each link of `each`."""
    if entry.get("link") is not None:
        raise ValueError(
            f"parameters.{name}: give link or each: links that have their own, not both"
        )
    links: Any = entry["each"]
    if links is True:
        links = None
        # without an arm that can be read its own fault is said
        if arm:
            links = arm.link_names
    if not _are_all(links, str):
        # refused as any other wrong value
        result[name] = entry
        return
    shared = _without_each(entry)
    taken = set[str]()
    for link in links:
        own_name = _name_at(name, link, taken)
        stated = result.get(own_name, {})
        result[own_name] = shared | {"link": link} | stated


def _add_joints(
    result: Plain, name: str, entry: Plain, compared: Any, arm: Arm | None
) -> None:
    """Add a parameter for each joint of `each`."""
    if entry.get("joints") is not None:
        what = "joints that share it or each: joints that have their own, not both"
        raise ValueError(f"parameters.{name}: give {what}")
    all_compared = entry["each"] is True
    joints: Any = entry["each"]
    if all_compared:
        joints = compared
    if not _are_all(joints, int | str):
        # refused as any other wrong value
        result[name] = entry
        return
    names = arm.joint_names if arm else ()
    _refuse(joints, "outputs" if all_compared else f"parameters.{name}.each", names)
    numbers = {label: number for number, label in enumerate(names, 1)}
    joints = [numbers.get(joint, joint) for joint in joints]
    shared = _without_each(entry)
    if len(joints) == 1:
        # joints that are driven but not compared need a mechanical parameter, too
        everywhere = all_compared and entry.get("quantity") in MECHANICAL
        if not everywhere:
            shared["joints"] = joints
        result[name] = shared
        return
    labels = dict(enumerate(names, 1))
    taken = set[str]()
    for joint in joints:
        own_name = _name_at(name, labels.get(joint, joint), taken)
        # an entry of that name changes what `each` says of this joint alone
        stated = result.get(own_name, {})
        result[own_name] = shared | {"joints": [joint]} | stated


def _are_all(values: Any, kind: Any) -> bool:
    return isinstance(values, list | tuple) and all(
        isinstance(value, kind) for value in values
    )


def _without_each(entry: Plain) -> Plain:
    return {setting: value for setting, value in entry.items() if setting != "each"}


def _name_at(name: str, label: Any, taken: set[str]) -> str:
    """Return the name of a parameter at a joint or link; --set splits names at dots,
    so it has none."""
    return distinct(re.sub(r"\W", "_", f"{name}_{label}"), taken)


def _refuse(joints: Any, where: str, names: Sequence[str]) -> None:
    """Raise ValueError where a joint occurs twice, or joints are more than there
    are."""
    try:
        each_once(joints, names)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    if names and len(joints) > len(names):
        raise ValueError(f"{where}: {len(joints)} joints, but the arm has {len(names)}")


def by_group(parameters: Mapping[str, Any], groups: Collection[str]) -> Plain:
    """Return the settings of parameters, one entry for each group of `per:
    group` and for other logs.

    Raises ValueError: there are no groups.
    """
    result: Plain = {}
    for name, entry in parameters.items():
        if not isinstance(entry, dict) or entry.get("per") != GROUP:
            _add(result, name, entry)
            continue
        if not groups or GROUP in groups:
            what = (
                "per: group needs log.groups: {name: pattern}, none of them named group"
            )
            raise ValueError(f"parameters.{name}: {what}")
        for group in (*groups, OTHER):
            if len(result) >= MOST:
                raise ValueError(f"parameters.{name}: more than {MOST} parameters")
            effect = f"{name}_{group}"
            result[effect] = entry | {"per": group} | result.get(effect, {})
    return result


def with_curves(parameters: Mapping[str, Any], priors: Any) -> tuple[Plain, Any]:
    """Return the settings of parameters and priors with the factors, and the
    smoothness, of valves' curves.

    A parameter `curve_a`, `curve_b` or `curve` stands for the factors NAME_1, NAME_2,
    ... of the valve's curve of one direction or both, and for a prior NAME by which
    they are alike (`PriorSettings.smooth`). Raises ValueError: a start that is no list
    of as many numbers.
    """
    result: Plain = {}
    smooth: Plain = {}
    for name, entry in parameters.items():
        if not _is_curve(entry):
            _add(result, name, entry)
            continue
        factors = _factors(name, entry)
        for factor, settings in factors.items():
            result[factor] = settings | result.get(factor, {})
        if entry.get("fixed") is None:
            sd = entry.get("sd", CURVE_SD)
            smooth[name] = {"smooth": [*factors], "sd": sd}
    if not smooth or not isinstance(priors, dict | None):
        return result, priors
    return result, smooth | (priors or {})


def _is_curve(entry: Any) -> bool:
    return isinstance(entry, dict) and str(entry.get("quantity")) in CURVES


def _factors(name: str, entry: Plain) -> dict[str, Plain]:
    """Return the settings of a curve's factors by their names.

    Raises ValueError: an effect per group, or a start that is no list of as many
    numbers.
    """
    if entry.get("per") is not None:
        raise ValueError(f"parameters.{name}: a curve has no effect per group")
    starts = entry.get("start", [1.0] * len(CURVE))
    if not isinstance(starts, list | tuple) or len(starts) != len(CURVE):
        what = f"start: a curve has a list of {len(CURVE)} factors"
        raise ValueError(f"parameters.{name}: {what}, of which 1 is the power law")
    side = CURVES[str(entry["quantity"])]
    shared = {"bounds": CURVE_BOUNDS} | entry
    # it is the scatter of neighbours, and no factor has one of its own
    shared.pop("sd", None)
    factors = dict[str, Plain]()
    for part, quantity, start in zip(count(1), CURVE, starts, strict=False):
        own_settings = {"quantity": f"{quantity}{side}", "start": start}
        factors[f"{name}_{part}"] = shared | own_settings
    return factors

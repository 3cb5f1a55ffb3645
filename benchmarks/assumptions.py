"""Do the tests of assumptions name a planted error, and are they silent where nothing is wrong?

    python benchmarks/assumptions.py [--arms 20] [--first 0]

Each arm has two or three joints against gravity, of random lengths, masses, axes and valves, and half of them
have a pump whose pressure falls with flow. Three logs of a minute, 0.05 deg of noise. The same logs are
tested with the arm as it is, and with the axis of one joint turned round, a sign error. It is named where
that joint is among those that are doubted, and first where it is the first of them.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from common import noisy, options, row, table, true_log

import hydroid
from hydroid.advice.assumptions import doubts
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

PERIOD, SECONDS, LOGS = 0.05, 60.0, 3
BODY = """<body name="j{joint}" pos="{place} 0 0"><joint name="j{joint}" axis="0 {axis} 0" range="-50 50"/>
<geom type="capsule" fromto="0 0 0 {length} 0 {bow}" size="0.08" mass="{mass}"/>"""
MODEL = (
    '<mujoco model="arm"><worldbody><body pos="0 0 2" euler="0 {tilt} 0">{bodies}</body></worldbody></mujoco>'
)
SIDES = {"open": ("opening", {"within": 4}), "dead": ("dead_band", {"sd": 12, "bounds": [5, 65]}),
         "power": ("opening_exponent", {"within": 3})}  # fmt: skip
SIDED = {"dead_band": (15, 45), "opening_exponent": (1, 2), "notch_2": (0.8, 1.25), "notch_3": (0.8, 1.25),
         "plunger_damping": (50, 300), "pilot_lag": (0, 0.1)}  # fmt: skip
"""ends between which the truth of a side is drawn"""
FREE: dict[str, Any] = {
    **{f"{n}_{s}": {"quantity": f"{q}_{s}", "each": True} | p for n, (q, p) in SIDES.items() for s in "ab"},
    "delay": {"quantity": "delay", "each": True, "bounds": [0, 1], "start": 0.1},
    "lag": {"quantity": "plunger_damping", "each": True, "within": 10},
    "slope": {"quantity": "lever_slope", "each": True, "nominal": 0, "sd": 0.2},
    "bend": {"quantity": "lever_bend", "each": True, "nominal": 0, "sd": 0.2},
    "M": {"quantity": "mass", "each": True, "within": 2},
}
SEARCH = {"starts": 1, "horizons": [], "iterations": 15}
PUMP = {"flow": {"quantity": "pump_flow", "within": 2}, "droop": {"quantity": "pump_droop", "within": 3}}


class RandomArm:
    """An arm, its valves and its pump, drawn from a seed."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 1])
        self.joints = int(rng.integers(2, 4))
        self.droops = bool(rng.random() < 0.5)
        first = slice(self.joints)
        self.length = np.array([4.0, 2.0, 1.2])[first] * rng.uniform(0.7, 1.4, self.joints)
        self.mass = np.array([600.0, 300.0, 200.0])[first] * rng.uniform(0.7, 1.5, self.joints)
        self.axis, self.tilt = rng.choice([-1, 1], self.joints), rng.uniform(-40, 10)
        self.bow = rng.uniform(-0.2, 0.2, self.joints)
        reach = np.cumsum(self.length)
        # of the links from each joint on, each in its middle [N·m]
        middle = reach - self.length / 2
        beyond = np.triu(middle - (reach - self.length)[:, None])
        weight = 9.81 * (self.mass * beyond).sum(axis=1)
        self.size = weight / (rng.uniform(0.25, 0.6, self.joints) * 2e7)  # m³/rad
        self.opening = self.size * rng.uniform(0.25, 0.7, self.joints) / (0.7 * np.sqrt(2 / 860 * 1e7))  # m²

    def settings(self, folder: Path, parameters: dict[str, Any], wrong: int | None = None) -> FitSettings:
        """Write the arm, the axis of joint `wrong` (from 1) turned round, and read settings of a fit."""
        bodies = ""
        for j in range(self.joints):
            place, axis = self.length[j - 1] if j else 0.0, self.axis[j] * (-1 if j + 1 == wrong else 1)
            sizes = {"length": self.length[j], "bow": self.bow[j], "mass": self.mass[j]}
            bodies += BODY.format(joint=j + 1, place=place, axis=axis, **sizes)
        (folder / "arm.xml").write_text(MODEL.format(bodies=bodies + "</body>" * self.joints, tilt=self.tilt))
        pairs = zip((1e6 * self.size).tolist(), (1e6 * self.opening).tolist(), strict=True)
        sizes = {
            f"j{j}": {"kind": "rotary", "displacement": size, "max_opening": opening}
            for j, (size, opening) in enumerate(pairs, 1)
        }
        (folder / "arm.yaml").write_text(yaml.safe_dump({"model": "arm.xml", "actuators": sizes}))
        flow = 2.8 * self.opening.sum() * 0.7 * np.sqrt(2 / 860 * 1e7) * 6e4
        known = {"supply_pressure": 200, "onset": 0, "slot_width": 1.7, "plunger_damping": 200, "substeps": 4}
        known |= {"dead_band": 30, "opening_exponent": 1.4}
        document = {
            "stage": "hyd",
            "arm": "arm.yaml",
            "outputs": list(range(1, self.joints + 1)),
            "free_start": False,
            "log": {"period_s": PERIOD},
            "simulation": {"model": "quasi-static"},
            "hydraulics": known | ({"pump_flow": float(flow), "pump_droop": 60} if self.droops else {}),
            "parameters": parameters | (PUMP if self.droops else {}),
            "objective": {"norm": 2, "segments": 4},
            "search": {"algorithm": "multistart", "multistart": SEARCH},
            "refinement": {"iterations": 25, "gain_tolerance": 0.001},
        }
        (folder / "fit.yaml").write_text(yaml.safe_dump(document))
        return hydroid.load_settings(folder / "fit.yaml")

    def logs(self, folder: Path, seed: int) -> list[Log]:
        """Simulate logs with terms that the fit does not have."""
        rng, truth = np.random.default_rng([seed, 5]), dict[str, float]()
        for j in range(1, self.joints + 1):
            for side in "ab":
                truth |= {f"{name}_{side}_{j}": rng.uniform(*ends) for name, ends in SIDED.items()}
            truth[f"delay_{j}"] = rng.uniform(0.02, 0.2)
            truth |= {f"lever_{shape}_{j}": rng.normal(0, 0.15) for shape in ("slope", "bend")}
        fixed = {n: {"quantity": n[:-2], "joints": [int(n[-1])], "fixed": float(v)} for n, v in truth.items()}
        for j, nominal in enumerate(self.mass):
            mass = float(nominal * np.exp(rng.normal(0, 0.25)))
            fixed[f"M_j{j + 1}"] = {"quantity": "mass", "link": f"j{j + 1}", "fixed": mass}
        settings = self.settings(folder, fixed)
        settings = settings.changed(
            {"parameters": {n: p for n, p in settings.parameters.items() if p.fixed is not None}}
        )
        joints = list(range(1, self.joints + 1))
        logs = list[Log]()
        for i in range(LOGS):
            pose = rng.uniform(-0.4, 0.4, self.joints)
            log = true_log(settings, {}, joints, SECONDS, 100 * seed + i, pose)
            logs.append(noisy(log, rng, 0.05))
        return logs


def doubted(settings: FitSettings, logs: list[Log]) -> tuple[list[int], str]:
    """Return the joints that are doubted, and a text with the evidence."""
    found = doubts(settings, logs)
    return [*found], ", ".join(f"{joint} ({evidence:.1f})" for joint, evidence in found.items())


if __name__ == "__main__":
    given, counts = options(__doc__, arms=20, first=0), np.zeros(3, int)
    table("arm | turned round | doubted, arm as it is | doubted, one turned (evidence)")
    for seed in range(given.first, given.arms):
        drawn = RandomArm(seed)
        wrong = int(np.random.default_rng([seed, 9]).integers(drawn.joints)) + 1
        with tempfile.TemporaryDirectory() as folder:
            logs = drawn.logs(Path(folder), seed)
            right, right_text = doubted(drawn.settings(Path(folder), FREE), logs)
            turned, turned_text = doubted(drawn.settings(Path(folder), FREE, wrong), logs)
        counts += [wrong in turned, turned[:1] == [wrong], bool(right)]
        row(seed, wrong, right_text, turned_text)
    print(f"\nNamed {counts[0]}, first {counts[1]} of {given.arms - given.first}; false alarms {counts[2]}.")

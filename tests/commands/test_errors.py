"""What the user can correct is one line and exit status 2, and nothing is
half-written."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOG = ROOT / "examples" / "logs" / "rig_shoulder_1.csv"
FILES = {
    "broken.csv": "time_s,u1_pct\n0,1\n0.01,x\n",
    "p.yaml": "K: 1.0\nD: 1.0\nS: 1.0\nM1: 1\nM2: 1\nM3: 1\nM4: 1\nM5: 1\n",
    "one.yaml": "K: 1.0\nD: 1.0\nS: 1.0\nM1: 1\nM2: 1\nM3: 1\nM4: 1\nM5: 1\nM6: 1\n",
    "zero.yaml": "K: 0\nD: 1.0\nS: 1.0\nM1: 1\nM2: 1\nM3: 1\nM4: 1\nM5: 1\nM6: 1\n",
    "bad.yaml": "F1: 500\n",
    "d.yaml": "D: 80.0\n",
    "hyd.yaml": "stage: hyd\nestimate: {}\n",
    "two.yaml": "parameters: {}\nsearhc: 1\noutput: 2\n",
}
WRONG = [
    ("fit-mech nowhere.csv", "log", "nowhere.csv"),
    (
        "fit-mech",
        "usage",
        "hydroid: missing argument 'LOG'; see hydroid fit-mech --help",
    ),
    ("fit-mech {log} --config nonsense", "settings", "nonsense"),
    ("fit-mech {log} --set search.seed=x", "settings", "--set search.seed"),
    (
        "fit-mech {log} --algorithm pso",
        "settings",
        "hydroid: --algorithm: must be 'ga', 'nsga2'",
    ),
    (
        "fit-mech {log} --budget soon",
        "settings",
        "--budget: 'soon' is no time; write it as 90s, 5min or 2h",
    ),
    ("fit-mech {log} --out .", "run", "holds no run"),
    (
        "fit-mech {log} --set outputs=[9]",
        "log",
        "no joint 9; the arm has joints 1 to 7",
    ),
    ("fit-mech {log} --config fit-hyd", "settings", "use hydroid fit-hyd"),
    ("fit-mech {log} --sed 1", "usage", "--sed"),
    ("fit-hyd {log} --mech nowhere", "settings", "nowhere"),
    (
        "fit-hyd {log} --set log.command=null",
        "log",
        "no log drives a joint that is compared (shoulder)",
    ),
    (
        "fit-hyd {log} --set parameters.D.start=null",
        "settings",
        "give the run of stage 1 with --mech RUN",
    ),
    ("fit-hyd {log} --mech d.yaml", "settings", "M6"),
    (
        "fit-hyd {log} --mech hyd.yaml",
        "settings",
        "hyd.yaml: is a fit of stage 2, but --mech takes one of",
    ),
    (
        "fit-mech {log} --config two.yaml",
        "settings",
        "did you mean 'search'?; also line 3: unknown setting",
    ),
    (
        "fit-mech {root}/README.md",
        "log",
        "holds no table of numbers; give the path of a log",
    ),
    ("validate {log}", "usage", "--fit"),
    ("validate {log} --fit nowhere", "settings", "nowhere"),
    ("validate {log} --fit {root}/README.md", "settings", "README.md"),
    ("analyse {log} --profile Z", "settings", "no free parameter 'Z' to profile"),
    (
        "analyse {log} --fit zero.yaml",
        "settings",
        "parameter K is 0; it is on a log scale: state a value above 0",
    ),
    ("analyse", "settings", "no log is given"),
    ("simulate {log} --fit no.yaml", "settings", "no.yaml"),
    ("simulate {log} --fit p.yaml --out {log}", "settings", "overwrite"),
    ("follow {log} --fit one.yaml", "settings", "a fit of stage 1 has no valves"),
    ("follow {log} --fit no.yaml", "settings", "no.yaml"),
    ("follow {log} --fit one.yaml --out {log}", "settings", "overwrite"),
    (
        "export one.yaml --to simulink",
        "settings",
        "'simulink' is no kind of export; choose parameters, ",
    ),
    ("export one.yaml --to table", "settings", "a gain gives torques, not speeds"),
    ("export one.yaml --to urdf", "settings", "name it: --robot robot.urdf"),
    ("export one.yaml --to parameters", "run", "holds no covariance"),
    ("export one.yaml", "usage", "--to"),
    ("suggest --fit bad.yaml", "settings", "bad.yaml"),
    ("design --fit nowhere", "settings", "nowhere"),
    ("report .", "run", "."),
    ("report nowhere --merge", "run", "no finished run is there"),
    ("study nowhere.yaml", "settings", "nowhere.yaml"),
    ("view --pose asleep", "settings", "no pose 'asleep'"),
    ("view --arm both", "settings", "needs a log"),
    (
        "simulate {log} --fit one.yaml --arm middle",
        "settings",
        "'middle' is no arm of a pair",
    ),
    ("view --collisions", "settings", "needs a log"),
    ("view {log} -o a.avi", "settings", "is no film or picture"),
    ("view {log} -o a.mp4 --span now", "settings", "'now' is not a span"),
    ("view . -o a.mp4", "log", "cannot be read"),
    ("convert {log} --out {log}", "settings", "would overwrite the log"),
    ("init mine --arm none.urdf", "settings", "no such file"),
    ("simulate {log} --fit {long}", "settings", "cannot be read (File name too long)"),
    ("fit-mech {log} --out {long}", "run", "cannot be written (File name too long)"),
    ("convert {log} --out {long}", "run", "cannot be written (File name too long)"),
    ("init {long} --log {log}", "run", "cannot be used (File name too long)"),
    ("report {long}", "run", "cannot be read as a run (File name too long)"),
    ("study {long}", "settings", "cannot be read (File name too long)"),
    ("nonsense", "usage", "nonsense"),
]
"""a command, the kind of its error, and what it says"""


@pytest.mark.parametrize(
    ("command", "kind", "says"), WRONG, ids=[command for command, *_ in WRONG]
)
def test_what_the_user_can_correct_is_one_line_and_exit_2(
    hydroid_cli, tmp_path, command, kind, says
):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    words = command.format(log=LOG, root=ROOT, long="x" * 300).split()
    plain = hydroid_cli(*words, code=2)
    assert says in plain.err
    asides = ("note:", "compiling", "left out:")
    lines = [line for line in plain.err.splitlines() if line.startswith("hydroid: ")]
    assert len([line for line in lines if not any(a in line for a in asides)]) == 1
    error = json.loads(hydroid_cli(*words, "--json", code=2).out)["error"]
    assert set(error) == {"kind", "what", "where", "hint"}
    assert error["kind"] == kind
    # nothing half-written
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)

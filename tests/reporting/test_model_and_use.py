"""The page says what the model of a fit contains, and how to use it."""

from dataclasses import replace

import pytest
from arms import CRANE, write_arm
from made_models import EARLY, EARLY_SETTINGS, made_model
from recovery import settings_of
from report_fits import make_fit, make_problem, make_record

import hydroid
from hydroid.estimate import CurveEstimate, NamedEstimate
from hydroid.quantity_table import ROWS
from hydroid.reporting.model_report import (
    COMMAND_ALONE,
    EFFECTS,
    FRICTION,
    IN,
    OIL,
    OUT,
    PUMP,
    REJECTED,
    SHARED,
    Contained,
    contained,
    model_section,
)
from hydroid.reporting.predictions import fit_page
from hydroid.reporting.use_report import positive_command, use_section
from hydroid.run.record import FinishedRun
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import Columns, JointColumns

PROBLEM = make_problem()
RECORD = make_record(PROBLEM, make_fit(PROBLEM))


def run_with(
    settings: FitSettings, begun: FitSettings | None = None, **summary
) -> FinishedRun:
    """A run of these settings, whose results are another's: they are not asked for."""
    changed = RECORD.summary.changed(summary)
    return replace(RECORD, settings=settings, begun=begun, summary=changed)


def hydraulic(
    model: str = "dynamic", outputs: tuple[int, ...] = (2,), **hydraulics
) -> FitSettings:
    changes = {"simulation.model": model, "outputs": outputs}
    return made_model(EARLY, changes, hydraulics=EARLY_SETTINGS | hydraulics).settings


def by_name(run: FinishedRun) -> dict[str, Contained]:
    return {one.name: one for one in contained(run)}


def test_every_quantity_is_of_one_effect():
    """So a quantity that is added must say which effect it is."""
    named = [name for effect in EFFECTS for name in (*effect.decides, *effect.shapes)]
    assert sorted(named) == sorted(row.name for row in ROWS)


def test_the_rung_decides_on_oil_and_inertia():
    rich = by_name(run_with(hydraulic("dynamic")))
    poor = by_name(run_with(hydraulic("quasi-static")))
    for name in (OIL.name, "inertia of the links"):
        assert rich[name].state == IN
        assert poor[name].state == OUT
    assert "the dynamic model has it" in poor["inertia of the links"].how
    ringing = run_with(hydraulic("quasi-static", oil_frequency=3.0))
    assert by_name(ringing)[OIL.name].state == IN


def test_what_is_estimated_held_and_off_is_told_apart():
    settings = hydraulic(outputs=(2, 3), leakage=0.02)
    effects = by_name(run_with(settings))
    assert effects["leakage of the valves"].how == "held at 0.02 mm²"
    assert effects["springs at the joints"].state == OUT
    # the parameter of the friction is the shoulder's alone
    assert effects[FRICTION.name].state == IN
    assert effects[FRICTION.name].how == "estimated: shoulder; off: elbow"
    assert "dry friction: shoulder" in model_section(run_with(settings)).answer


def test_joints_share_a_pump_only_where_it_has_a_limit():
    limited = by_name(run_with(hydraulic(outputs=(2, 3), pump_flow=5.0)))
    endless = by_name(run_with(hydraulic(outputs=(2, 3))))
    assert limited[PUMP.name] == Contained(PUMP.name, IN, "held at 5 L/min")
    assert limited[SHARED].state == IN
    assert endless[PUMP.name].state == OUT
    assert endless[PUMP.name].how.startswith("the pump gives any flow")
    assert endless[SHARED].state == OUT
    # one joint shares it with none
    assert SHARED not in by_name(run_with(hydraulic(pump_flow=5.0)))


TERMS = {
    "open": {"quantity": "opening", "nominal": 0.3, "within": 2},
    "bend": {"quantity": "curve", "joints": [2], "term": "curve_shoulder"},
    "flow": {"quantity": "pump_flow", "bounds": [1, 9], "term": "pump"},
}


def dropped(**summary) -> dict[str, Contained]:
    """What a fit contains that dropped all its terms."""
    begun = settings_of(TERMS).changed({"outputs": (2, 3)})
    run = run_with(begun.of_estimate("refined"), begun, final="refined", **summary)
    return by_name(run)


def test_a_term_that_was_dropped_says_what_it_gained():
    tried = NamedEstimate(values={}, gained=(-1.25, 2.5))
    effects = dropped(
        estimates={"refined+pump": tried}, tried={"curve_shoulder": (2.0, 4.0)}
    )
    assert effects[PUMP.name] == Contained(
        PUMP.name, REJECTED, "gain -1.2 ± 2.5, not clear"
    )
    bends = effects["bends in the valve's curve"]
    assert bends.state == REJECTED
    assert bends.how == "shoulder: gain 2 ± 4, not clear"
    assert effects[SHARED].state == OUT
    # a term that the final model cannot have was not rejected
    begun = settings_of(
        {"ring": {"quantity": "oil_frequency", "fixed": 3.0, "term": "oil"}}
    )
    run = run_with(begun.of_estimate("dynamic"), begun, final="dynamic")
    assert by_name(run)[OIL.name] == Contained(OIL.name, IN, "held")
    effects = dropped(tried={"curve_shoulder": None})
    assert "promised too little" in effects["bends in the valve's curve"].how
    # older runs do not say
    assert "what it gained is not stored" in dropped()[PUMP.name].how


def test_joints_whose_speed_follows_the_command_alone_are_named():
    choices = {
        f"by_command_{j}": {
            "quantity": "by_command",
            "joints": [j],
            "fixed": 1,
            "term": f"by_command_{j}",
        }
        for j in (2, 3)
    }
    begun = settings_of({"flow": TERMS["flow"] | {"term": None}} | choices)
    begun = begun.changed({"outputs": (2, 3), "simulation.model": "quasi-static"})
    begun = begun.changed({"hydraulics.compensation": 0.5})
    final = "refined+by_command_3"
    tried = {"by_command_2": (2.0, 4.0), "by_command_3": (50.0, 9.0)}
    settings = begun.of_estimate(final)
    effects = by_name(run_with(settings, begun, final=final, tried=tried))
    alone = effects[COMMAND_ALONE.name]
    assert alone.state == IN
    assert alone.how == (
        "elbow: load and pump do not predict it better; "
        "tested and rejected: shoulder: gain 2 ± 4, not clear"
    )
    assert effects[SHARED].how.endswith("it does not slow elbow")
    assert effects["load compensation of the valves"].how.endswith("off: elbow")
    effects = by_name(run_with(begun.of_estimate("refined"), begun, final="refined"))
    assert effects[COMMAND_ALONE.name].state == REJECTED
    plain = by_name(run_with(hydraulic("quasi-static")))
    assert plain[COMMAND_ALONE.name].state == OUT


def test_a_fit_of_stage_1_lacks_all_hydraulics_in_one_row():
    effects = contained(RECORD)
    (lacked,) = [one for one in effects if "hydraulics" in one.name]
    assert lacked.state == OUT
    assert not {OIL.name, PUMP.name} & {one.name for one in effects}
    assert by_name(RECORD)["torque in proportion to the command"].how == "estimated"
    assert model_section(RECORD).answer == "dry friction: no; hydraulics: one gain"


def test_every_state_has_a_table_and_none_is_empty():
    section = model_section(RECORD)
    assert [table.title for table in section.tables.values()] == [
        "In the model",
        "Not in the model",
    ]
    assert all(table.rows for table in section.tables.values())


def curve(joint: int, value: tuple[float, float]) -> CurveEstimate:
    limits = ((None, None), (None, None))
    what = {"label": "speed", "unit": "deg/s", "along": "command [%]"}
    return CurveEstimate(
        joint=joint, at=(-50.0, 50.0), value=value, interval=limits, **what
    )


def test_a_positive_command_turns_a_joint_as_the_fit_says():
    step = curve(2, (0.0, 1.0)).changed({"moves": "lowering"})
    curves = {"shoulder_speed": curve(2, (9.0, -8.0)), "shoulder_step_positive": step}
    run = run_with(PROBLEM.settings, curves=curves)
    assert positive_command(run, 2) == "lowering, angle falls"
    rising = {"shoulder_speed": curve(2, (-9.0, 8.0))}
    assert (
        positive_command(run_with(PROBLEM.settings, curves=rising), 2) == "angle rises"
    )
    # a fit that does not know the speeds says nothing
    assert positive_command(run_with(PROBLEM.settings, curves={}), 2) == ""


def test_columns_and_signs_are_those_of_the_logs():
    lever = Columns(column=("lever_V",), scale=-10, offset=5)
    joints = {2: JointColumns(command=lever)}
    settings = PROBLEM.settings.changed({"log.joints": joints})
    run = run_with(settings, joints=(2,))
    ((joint, command, _, angle, ends),) = use_section(run).tables["units"].rows
    assert (joint, angle, ends) == ("shoulder", "q2_deg: angle in deg", "-30 to 90 deg")
    assert command == "lever_V: command [%] = -10 · cell + 5"


def test_a_telescope_is_in_metres_and_extends(tmp_path):
    arm = write_arm(tmp_path, CRANE)
    settings = PROBLEM.settings.changed({"arm": arm, "outputs": (2,), "parameters": {}})
    columns = {2: JointColumns(angle=Columns(column=("x",), unit="mm"))}
    settings = settings.changed({"log.joints": columns})
    step = curve(2, (0.0, 1.0)).changed({"moves": "extending"})
    curves = {"telescope_speed": curve(2, (-9.0, 8.0)), "telescope_step_positive": step}
    run = run_with(settings, curves=curves, joints=(2,))
    ((joint, _, moves, angle, ends),) = use_section(run).tables["units"].rows
    assert (joint, moves) == ("telescope", "extending, position rises")
    assert (angle, ends) == ("x: position in mm", "0 to 3 m")


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_the_commands_are_those_of_the_program_and_name_the_run(stage: str):
    settings = hydraulic() if stage == "hyd" else PROBLEM.settings
    run = replace(run_with(settings), folder="my runs/a")
    *steps, python = use_section(run).steps
    commands = [str(step.numbers["command"]).split() for step in steps]
    # stage 1 has no valves, so no commands along a path
    expected = (
        ["simulate", "follow", "export"] if stage == "hyd" else ["simulate", "export"]
    )
    assert [words[1] for words in commands] == expected
    for step, words in zip(steps, commands, strict=True):
        assert callable(getattr(hydroid, words[1]))
        assert "'my runs/a'" in str(step.numbers["command"])
    lines = str(python.numbers["command"])
    compile(lines, "page", "exec")
    assert "hydroid.load_plant('my runs/a')" in lines


def test_the_files_are_those_that_a_run_of_this_stage_has():
    files = dict(use_section(RECORD).tables["files"].rows)
    assert "model/fitted.xml" in files
    assert not {"model/actuators.yaml", "validations/"} & files.keys()
    of_hydraulics = dict(use_section(run_with(hydraulic())).tables["files"].rows)
    assert {"model/actuators.yaml", "model/mechanics.xml"} <= of_hydraulics.keys()


def test_sections_name_each_other_by_titles_that_the_page_has():
    page = fit_page(RECORD)
    titles = [section.title for section in page.sections]
    folded = [section.title for section in page.sections if section.folded]
    assert folded[-1] == "How to use it"
    for section in page.sections:
        notes = [table.note for table in section.tables.values()]
        for text in (section.text, *section.points, *notes):
            for quoted in text.split("“")[1:]:
                name = quoted.partition("”")[0]
                assert any(title.startswith(name) for title in titles), name

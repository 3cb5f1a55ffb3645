"""The report of one actuator: its curves at rest, from the command to the joint's torque."""

from functools import partial

from hydroid.report.joint_actuator import JointActuator
from hydroid.report.page import Page, Plot, Section
from hydroid.report.plots.actuator_curves import overview, single

_OVERVIEW = "Numbers in brackets are the article's equations."
_CURVES = {
    "calibration": "Voltage of each side against the command.",
    "current": "Coil current of each side against the command.",
    "force": "Solenoid force and spring against the stroke; dots: where the plunger rests at each current.",
    "spool": "Spool displacement at rest against the command.",
    "opening": "Valve opening against the spool displacement.",
    "flow": "Flow from the pump against the spool displacement for several pressure drops.",
    "pressure_flow": "Flow from the pump into chamber A against its pressure.",
    "torque": "Largest static torque against the joint's angle.",
}


def actuator_page(actuator: JointActuator) -> Page:
    """Return the page of an actuator: all curves as one figure and each as its own."""
    everything = Plot("actuator", _OVERVIEW, partial(overview, actuator))
    single_ones = tuple(Plot(name, text, partial(single, actuator, name)) for name, text in _CURVES.items())
    sections = Section("All curves", plots=(everything,)), Section("One by one", plots=single_ones)
    lead = "What its parameters mean at rest, from the command to the torque at the joint."
    return Page("actuator", f"Actuator of {actuator.title.lower()}", lead, sections)

"""Controllers: the Agent protocol, PD, PID and LQG, trained policies in numpy (paper sections III, IV.C)."""

from flapgym.control.agent import Agent, OpenLoop
from flapgym.control.agent_files import (
    AGENT_NAMES,
    AGENT_SETS,
    FIELD_AGENT_NAMES,
    FIELD_AGENT_SETS,
    agent_design,
    load_agent,
    made_for,
    save_agent,
)
from flapgym.control.blade_controller import BladeController
from flapgym.control.closed_loop import Stability, closed_loop, growth_per_turn, stability, stationary_rms
from flapgym.control.field_lqg import field_design, field_lqg
from flapgym.control.individual_pitch import (
    INDIVIDUAL_PITCH,
    INDIVIDUAL_PITCH_2P,
    IndividualPitch,
    individual_pitch_agent,
    pitch_margin,
)
from flapgym.control.lqg import DesignModel, Weights, design_model, lqg_agent, synthesise, white_wind
from flapgym.control.mpc import PredictiveController
from flapgym.control.pd import PDGains, pd_agent
from flapgym.control.pid import PIDGains, multiblade_pid_agent, pid_agent
from flapgym.control.policy import Policy
from flapgym.control.preview import LidarLQG
from flapgym.control.rotor_controller import RotorController
from flapgym.control.scheduled import ScheduledAgent, scheduled_agent

__all__ = [
    "AGENT_NAMES",
    "AGENT_SETS",
    "FIELD_AGENT_NAMES",
    "FIELD_AGENT_SETS",
    "INDIVIDUAL_PITCH",
    "INDIVIDUAL_PITCH_2P",
    "Agent",
    "BladeController",
    "DesignModel",
    "IndividualPitch",
    "LidarLQG",
    "OpenLoop",
    "PDGains",
    "PIDGains",
    "Policy",
    "PredictiveController",
    "RotorController",
    "ScheduledAgent",
    "Stability",
    "Weights",
    "agent_design",
    "closed_loop",
    "design_model",
    "field_design",
    "field_lqg",
    "growth_per_turn",
    "individual_pitch_agent",
    "load_agent",
    "lqg_agent",
    "made_for",
    "multiblade_pid_agent",
    "pd_agent",
    "pid_agent",
    "pitch_margin",
    "save_agent",
    "scheduled_agent",
    "stability",
    "stationary_rms",
    "synthesise",
    "white_wind",
]

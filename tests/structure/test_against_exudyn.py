"""The beam against the geometrically exact beam of the independent program exudyn."""

import exudyn
import exudyn.utilities as exu
import numpy as np
import pytest
import scipy.linalg

from flapgym.structure import solve_equilibrium
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.body import linearise
from flapgym.structure.inertia import section_mass
from tests.structure.beams import bend_45_degrees


def exudyn_beam(beam: Beam, tip_force: np.ndarray | None = None):
    """The same beam in exudyn, clamped at its first node; returns system and tip node."""
    system = exudyn.SystemContainer().AddSystem()
    ground = system.AddObject(exu.ObjectGround())
    nodes = [
        system.AddNode(exu.NodeRigidBodyEP(referenceCoordinates=[*x, *exu.RotationMatrix2EulerParameters(r)]))
        for x, r in zip(beam.reference.position, beam.reference.orientation, strict=True)
    ]
    lengths = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)
    for element, length in enumerate(lengths):
        section = exudyn.BeamSection()
        section.stiffnessMatrix = beam.stiffness[element]
        section.massPerLength = float(beam.mass[element, 0, 0])
        section.inertia = beam.mass[element, 3:, 3:]
        system.AddObject(
            exu.ObjectBeamGeometricallyExact(
                nodeNumbers=nodes[element : element + 2], length=length, sectionData=section
            )
        )
    fixed = system.AddMarker(exu.MarkerBodyRigid(bodyNumber=ground, localPosition=[0.0, 0.0, 0.0]))
    root = system.AddMarker(exu.MarkerNodeRigid(nodeNumber=nodes[0]))
    system.AddObject(
        exu.GenericJoint(
            markerNumbers=[fixed, root],
            constrainedAxes=[1] * 6,
            rotationMarker1=beam.reference.orientation[0].T,
        )
    )
    if tip_force is not None:
        tip = system.AddMarker(exu.MarkerNodeRigid(nodeNumber=nodes[-1]))
        system.AddLoad(exu.LoadForceVector(markerNumber=tip, loadVector=tip_force))
    system.Assemble()
    return system, nodes[-1]


def straight_beam(elements: int) -> Beam:
    """Straight beam along x."""
    position = np.zeros((elements + 1, 3))
    position[:, 0] = np.linspace(0.0, 2.0, elements + 1)
    stiffness = np.diag([1e4, 1e4, 1e4, 3.0, 2.0, 1.0])
    mass = section_mass(1.0, np.zeros(3), np.diag([3e-3, 1e-3, 2e-3]))
    return Beam(
        Configuration(position, np.broadcast_to(np.eye(3), (elements + 1, 3, 3))),
        np.broadcast_to(stiffness, (elements, 6, 6)),
        np.broadcast_to(mass, (elements, 6, 6)),
    )


def test_natural_frequencies_are_those_of_exudyn() -> None:
    beam = straight_beam(16)
    system, _ = exudyn_beam(beam)
    theirs, _ = system.ComputeODE2Eigenvalues(numberOfEigenvalues=12, convert2Frequencies=True)
    body = linearise(beam, beam.reference, 0.0)
    ours = np.sqrt(scipy.linalg.eigh(body.stiffness, body.mass, eigvals_only=True)) / (2.0 * np.pi)
    np.testing.assert_allclose(ours[:10], np.sort(theirs)[-12:][:10], rtol=1e-7)


def test_large_deflection_is_that_of_exudyn() -> None:
    beam, force = bend_45_degrees(32), np.array([0.0, 0.0, 600.0])
    system, tip = exudyn_beam(beam, force)
    settings = exudyn.SimulationSettings()
    settings.staticSolver.numberOfLoadSteps = 6
    settings.staticSolver.newton.relativeTolerance = 1e-8
    settings.staticSolver.newton.absoluteTolerance = 1e-7
    settings.solution.file.write = False
    system.SolveStatic(settings)
    theirs = system.GetNodeOutput(tip, exudyn.OutputVariableType.Position)
    load = np.zeros((33, 6))
    load[-1, :3] = force
    ours = solve_equilibrium(beam, load=load, load_steps=12).position[-1]
    assert np.linalg.norm(ours - theirs) / 100.0 == pytest.approx(0.0, abs=1e-4)

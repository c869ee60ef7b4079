"""A train as an Exudyn model: masses are Mass1D, elements are CoordinateSpringDamper, memories are ODE1 nodes.

Exudyn 1.13 (Gerstmayr 2023, Multibody System Dynamics, doi 10.1007/s11044-023-09937-1). The laws of force and the lift
are symbolic user functions, which Exudyn evaluates in C++. The law of an element with a memory is a Python function,
because symbols cannot read a node. The solver is Exudyn's explicit DOPRI5 with automatic step size. It does not locate
switchings, but shortens its steps there until the error is below the tolerance.
"""

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from camopt.verifier.outside.filed import GROUND, FiledCam, FiledElement, FiledTrain
from camopt.verifier.outside.forces import NEVER_PULLS, at_rest, compression, elastic, force, lift, on_rows

exu: Any = import_module("exudyn")  # its stubs name types that its functions do not have
items: Any = import_module("exudyn.itemInterface")
advanced: Any = import_module("exudyn.advancedUtilities")
LONGEST_STEPS = 720
"""Fewest steps per revolution: no step is longer than 1/720 of a revolution."""
FIRST_STEP = 1e-8
"""Length [s] of the first step."""
SHORTEST_STEP = 1e-30
"""Lower limit of the step [s], too small to be reached: Exudyn would reject a step of this length for ever."""
LENGTH = 1e-3
"""Length [m] and velocity [m/s] whose relative tolerance is the absolute tolerance of the solver."""
Kind = exu.OutputVariableType
FiledState = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Positions [m], velocities [m/s] and memories [m] at -180 deg."""


@dataclass(frozen=True)
class FiledMotion:
    """One revolution at the solver's own steps: angle (k) [rad], x (k, n) [m], v (k, n) [m/s], z (k, r) [m]."""

    angle: np.ndarray
    x: np.ndarray
    v: np.ndarray
    z: np.ndarray

    @property
    def end(self) -> FiledState:
        """The state at the end of the revolution."""
        return self.x[-1], self.v[-1], self.z[-1]


def pick(condition, value, other):
    """Exudyn's IfThenElse; numbers are converted to constants of its expression."""
    real = exu.symbolic.Real
    return exu.symbolic.IfThenElse(condition, *(q if isinstance(q, real) else real(float(q)) for q in (value, other)))


class ExudynModel:
    """A train under a cam at one cam speed [rad/s], with the relative tolerance of the solver and a contact law."""

    def __init__(self, train: FiledTrain, cam: FiledCam, cam_speed: float, tolerance: float, law: str = NEVER_PULLS):
        exu.SetWriteToConsole(False)
        self.train, self.cam, self.speed, self.law, self.tolerance = train, cam, cam_speed, law, tolerance
        self.mbs = exu.SystemContainer().AddSystem()
        self._kept: list = []  # holds references to the symbolic functions, since Exudyn holds none
        zero = {"referenceCoordinates": [0.0], "initialCoordinates": [0.0]}
        masses = [items.Node1D(initialVelocities=[0.0], **zero) for _ in train.mass]
        self.nodes = [self.mbs.AddNode(mass) for mass in masses]
        for node, mass in zip(self.nodes, train.mass, strict=True):
            self.mbs.AddObject(items.Mass1D(nodeNumber=node, physicsMass=mass))
        ground = self.mbs.AddNode(items.NodePointGround())
        markers = [items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0) for node in (*self.nodes, ground)]
        self.markers = [self.mbs.AddMarker(marker) for marker in markers]  # the index -1 is the ground
        self.memory = [e for e in train.elements if e.has_memory]
        lengths = [items.NodeGenericODE1(numberOfODE1Coordinates=1, **zero) for _ in self.memory]
        self.memory_nodes = [self.mbs.AddNode(length) for length in lengths]
        self._add_elements()
        self._add_loads()
        recorded = [
            (self.nodes, Kind.Coordinates),
            (self.nodes, Kind.Coordinates_t),
            (self.memory_nodes, Kind.Coordinates),
        ]
        self.sensors = [[self._sensor(node, kind) for node in nodes] for nodes, kind in recorded]
        self.mbs.Assemble()

    def rest(self) -> FiledState:
        """The state at rest on the base circle, with oil and friction relaxed."""
        x = at_rest(self.train)
        z = np.array([float(compression(e, x)) for e in self.memory])
        return x, np.zeros_like(x), z

    def revolve(self, state: FiledState) -> FiledMotion:
        """One revolution from a state at -180 deg."""
        period, data, initial = 2 * np.pi / self.speed, self.mbs.systemData, exu.ConfigurationType.Initial
        data.SetODE2Coordinates(state[0], initial)
        data.SetODE2Coordinates_t(state[1], initial)
        if self.memory:
            data.SetODE1Coordinates(state[2], initial)
        settings = exu.SimulationSettings()
        run = settings.timeIntegration
        run.startTime, run.endTime, run.numberOfSteps = 0.0, period, LONGEST_STEPS
        run.automaticStepSize, run.initialStepSize, run.minimumStepSize = True, FIRST_STEP, SHORTEST_STEP
        run.relativeTolerance, run.absoluteTolerance = self.tolerance, self.tolerance * LENGTH
        run.verboseMode = 0
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = 0.0
        self.mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.DOPRI5)
        time = self.mbs.GetSensorStoredData(self.sensors[0][0])[:, 0]
        x, v, z = (
            np.array([self.mbs.GetSensorStoredData(s)[:, 1] for s in sensors]).reshape(-1, len(time)).T
            for sensors in self.sensors
        )
        return FiledMotion(time * self.speed - np.pi, x, v, z)

    def _sensor(self, node, kind):
        return self.mbs.AddSensor(
            items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False)
        )

    def _symbolic(self, function, name: str, item: str):
        user_function = advanced.CreateSymbolicUserFunction(self.mbs, function, name, itemTypeName=item)
        self._kept.append(user_function)
        return user_function

    def _add_elements(self) -> None:
        memory = iter(self.memory_nodes)
        for e in self.train.elements:
            user = self._with_memory(e, next(memory)) if e.has_memory else self._of_spring(e)
            ends = [self.markers[e.b], self.markers[e.a]]  # Exudyn's displacement is second minus first
            self.mbs.AddObject(items.CoordinateSpringDamper(markerNumbers=ends, springForceUserFunction=user))

    def _of_spring(self, e: FiledElement):
        """The force of an element without memory, as a symbolic function of Exudyn."""
        bare = replace(e, gap=0.0)

        def spring(mbs, t, itemNumber, displacement, velocity, stiffness, damping, offset):
            d, rate = displacement - e.gap, velocity
            if e.driven:
                height, slope = lift(self.cam, t * self.speed - np.pi, pick)
                d, rate = d + height, rate + slope * self.speed
            return force(bare, d, rate, pick, self.law)

        return self._symbolic(spring, "springForceUserFunction", "ObjectConnectorCoordinateSpringDamper")

    def _with_memory(self, e: FiledElement, node):
        """The force of oil or friction as a Python function; also adds the equation of its memory to the model."""
        mbs = self.mbs

        def of_mass(end: int, kind) -> float:
            return 0.0 if end == GROUND else float(mbs.GetNodeOutput(self.nodes[end], kind))

        def flow(mbs, t, itemNumber, q):
            d = of_mass(e.a, Kind.Coordinates) - of_mass(e.b, Kind.Coordinates) - q[0]
            rate = of_mass(e.a, Kind.Coordinates_t) - of_mass(e.b, Kind.Coordinates_t)
            if e.law == "oil":  # a lengthening column refills by the open valve; a compressed one leaks
                return [min(rate, 0.0)] if d <= 0.0 else [max(0.0, e.stiffness * (d - e.travel)) / e.leak]
            slides = e.stiffness * abs(d) >= e.slip and d * rate > 0.0
            return [rate if slides else 0.0]

        def spring(mbs, t, itemNumber, displacement, velocity, stiffness, damping, offset):
            d = displacement - float(mbs.GetNodeOutput(node, Kind.Coordinates))
            return float(elastic(e, d, lambda condition, value, other: value if condition else other))

        mbs.AddObject(items.ObjectGenericODE1(nodeNumbers=[node], rhsUserFunction=flow))
        return spring

    def _add_loads(self) -> None:
        """Add damping to ground, constant forces, and forces given over the cam angle."""
        for i, (drag, load) in enumerate(zip(self.train.drag, self.train.load, strict=True)):
            if drag:
                ends = [self.markers[GROUND], self.markers[i]]
                self.mbs.AddObject(items.CoordinateSpringDamper(markerNumbers=ends, damping=drag))
            if load:
                self.mbs.AddLoad(items.LoadCoordinate(markerNumber=self.markers[i], load=load))
        for i, rows in self.train.forcing:
            user = self._symbolic(self._by_angle(rows), "loadUserFunction", "LoadCoordinate")
            self.mbs.AddLoad(items.LoadCoordinate(markerNumber=self.markers[i], load=0.0, loadUserFunction=user))

    def _by_angle(self, rows):
        def force_at(mbs, t, load):
            return on_rows(t * self.speed - np.pi, rows, pick)

        return force_at

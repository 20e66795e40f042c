"""Simulated CiA 402 drives and CiA 401 inputs and outputs for the virtual bus, stepped or in real time."""

from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import LostSync, Parameters
from drives.bench.simulated.plant import PlantParameters
from drives.bench.simulated.rig import Rig, rig

__all__ = ["IoNode", "LostSync", "Parameters", "PlantParameters", "Rig", "SimulatedDrive", "rig"]

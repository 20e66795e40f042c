"""Simulated CiA 402 drives and CiA 401 inputs and outputs for the virtual bus, stepped or in real time."""

from drives.simulated.drive import SimulatedDrive
from drives.simulated.io_node import IoNode
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.plant import PlantParameters
from drives.simulated.rig import Rig, rig

__all__ = ["IoNode", "LostSync", "Parameters", "PlantParameters", "Rig", "SimulatedDrive", "rig"]

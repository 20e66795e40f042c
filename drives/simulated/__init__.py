"""Simulated CiA 402 servo drives for the virtual bus, stepped or in real time."""

from drives.simulated.drive import SimulatedDrive
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.plant import PlantParameters
from drives.simulated.rig import Rig, rig

__all__ = ["LostSync", "Parameters", "PlantParameters", "Rig", "SimulatedDrive", "rig"]

"""The wind along the shaft: turbulence, gusts and recordings; over the disk fields, steady inflow and boxes."""

from flapgym.wind.box import WindBox, mann_box
from flapgym.wind.box_field import BoxFile
from flapgym.wind.box_files import read_mann, read_netcdf, read_turbsim
from flapgym.wind.disk import Disk
from flapgym.wind.field import disk_turbulence
from flapgym.wind.field_filter import EffectiveField, blade_filter, component_filter, effective_field
from flapgym.wind.gusts import Gust, gust_components, gust_of
from flapgym.wind.inflow import Inflow
from flapgym.wind.lidar import Lidar
from flapgym.wind.realisation import realise
from flapgym.wind.shaping_filter import von_karman_filter
from flapgym.wind.spectrum import von_karman_spectrum
from flapgym.wind.turbulence import Kaimal, VonKarman, turbulence_of
from flapgym.wind.wind import Wind

__all__ = [
    "BoxFile",
    "Disk",
    "EffectiveField",
    "Gust",
    "Inflow",
    "Kaimal",
    "Lidar",
    "VonKarman",
    "Wind",
    "WindBox",
    "blade_filter",
    "component_filter",
    "disk_turbulence",
    "effective_field",
    "gust_components",
    "gust_of",
    "mann_box",
    "read_mann",
    "read_netcdf",
    "read_turbsim",
    "realise",
    "turbulence_of",
    "von_karman_filter",
    "von_karman_spectrum",
]

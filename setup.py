"""Build rules of the ament_python package; every executable is listed in `EXECUTABLES`.

An install into a prefix of ROS (`setup.cfg`, colcon) has each of them in lib/rf_pointing, where
`ros2 run` finds them.  Any other one, as `pip install`, puts the one command `rf-pointing` on the
PATH: their names are too common for it.
"""

import os
import sys
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "rf_pointing"
EXECUTABLES = {
    "nodes": [
        "antenna_servo",
        "bias_calibrator",
        "conscan_tracker",
        "ephemeris_publisher",
        "target_designate",
        "monopulse_tracker",
        "operator_page",
        "pointing_controller",
        "radio_control",
        "rf_receiver",
        "rotctld_server",
        "signal_receiver",
        "signal_source",
        "simulation_clock",
        "station_alarms",
        "station_description",
        "station_executive",
        "station_process",
    ],
    "commands": [
        "budget",
        "calibrate",
        "check_clock",
        "check_drive",
        "check_receiver",
        "check_station",
        "fetch_elements",
        "fetch_schedule",
        "fit_bias_model",
        "identify_antenna",
        "launch",
        "link_budget",
        "new_station",
        "orbit_covariance",
        "orbit_from_passes",
        "plan_calibration",
        "plan_passes",
        "replay",
        "report",
        "scan",
        "simulate",
        "station",
        "track",
        "tune",
    ],
    "array_sensors.nodes": [
        "array_receiver",
        "array_tracker",
        "doa_attitude",
        "doa_source",
        "interferometer_source",
        "interferometer_tracker",
        "tripulse_attitude",
        "tripulse_receiver",
        "tripulse_source",
    ],
    "papers": ["reproduce"],
}
"""Module `main` of each executable, by the package it is in."""
LIBRARIES = [
    "aiohttp>=3.9",
    "astropy-iers-data",
    "control>=0.10",
    "icalendar>=6.0",
    "Jinja2>=3.1",
    "matplotlib>=3.6",
    "numpy>=1.26",
    "pyerfa>=2.0.1",
    "pyserial>=3.5",
    "PyYAML>=6.0",
    "requests>=2.31",
    "rosbags>=0.10",
    "scipy>=1.11",
    "sgp4>=2.23",
]
"""What `pip install .` brings: the core without ROS.  requirements/ pins the versions that are
tested; the oldest are those of Ubuntu 24.04."""

EVERY = [f"{name} = {PACKAGE}.{room}.{name}:main" for room, names in EXECUTABLES.items() for name in names]
# One small module starts each: it answers what needs no libraries.
STARTED = [f"{name} = {PACKAGE}.__main__:start" for names in EXECUTABLES.values() for name in names]
# colcon and bloom call these two; pip makes a wheel.
INTO_ROS = bool({"develop", "install"} & set(sys.argv))
PREFIXES = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
if INTO_ROS and not any(Path(prefix, "share", f"{PACKAGE}_msgs").is_dir() for prefix in PREFIXES):
    sys.exit(
        f"{PACKAGE} needs its messages, which colcon does not search for below it: "
        f"colcon build --base-paths src/{PACKAGE} src/{PACKAGE}/msg_defs"
    )

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Ground-station antenna pointing: servo, RF trackers, ephemeris and calibration as a ROS 2 graph.",
    license="Apache-2.0",
    maintainer="rf_pointing maintainers",
    maintainer_email="maintainers@rf-pointing.example",
    packages=[*find_packages(include=[PACKAGE, f"{PACKAGE}.*"]), f"{PACKAGE}.config"],
    # In the package as well as in share/: Python finds it where there is no ament.
    package_dir={f"{PACKAGE}.config": "config"},
    package_data={
        f"{PACKAGE}.controllers": ["*.json"],
        f"{PACKAGE}.web": ["page/*"],
        f"{PACKAGE}.operations": ["tables/*"],
        f"{PACKAGE}.report": ["templates/*", "messages/*.msg"],
        f"{PACKAGE}.config": ["stations/*", "array_sensors/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.*"))),
        *(
            (f"share/{PACKAGE}/config/{folder}", sorted(glob(f"config/{folder}/*")))
            for folder in ("array_sensors", "sros2", "stations", "systemd", "viewers")
        ),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
    ],
    python_requires=">=3.11",
    install_requires=LIBRARIES,
    extras_require={
        "sweep": ["dask", "distributed"],
        "zmq": ["pyzmq>=25"],
        "tables": ["pandas>=2.1", "pyarrow>=14"],
        # `colcon test` runs pytest where this extra names it.
        "test": ["pytest>=8", "pytest-timeout", "hypothesis"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": STARTED if INTO_ROS else [f"rf-pointing = {PACKAGE}.__main__:main"],
        f"{PACKAGE}.executables": EVERY,
        f"{PACKAGE}.launch_files": [
            f"{name} = {PACKAGE}.array_sensors.nodes.launching:{name.upper()}"
            for name in ("doa", "interferometer", "tripulse")
        ],
        f"{PACKAGE}.reports": [f"array_sensors = {PACKAGE}.array_sensors.report.page:report_array_sensors"],
    },
)

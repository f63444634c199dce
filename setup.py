"""Build rules of the ament_python package; every executable is listed in `EXECUTABLES`."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "rf_pointing"
EXECUTABLES = [
    "antenna_servo",
    "bias_calibrator",
    "calibrate",
    "conscan_tracker",
    "doa_attitude",
    "doa_source",
    "ephemeris_publisher",
    "fit_bias_model",
    "identify_antenna",
    "interferometer_source",
    "interferometer_tracker",
    "monopulse_tracker",
    "plan_calibration",
    "plan_passes",
    "pointing_controller",
    "report",
    "reproduce",
    "rf_receiver",
    "simulation_clock",
    "track",
    "tripulse_attitude",
    "tripulse_receiver",
    "tripulse_source",
]

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Ground-station antenna pointing: servo, RF trackers, ephemeris and calibration as a ROS 2 graph.",
    license="Apache-2.0",
    maintainer="rf_pointing maintainers",
    maintainer_email="maintainers@rf-pointing.example",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={f"{PACKAGE}.controllers": ["*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.*"))),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
    ],
    python_requires=">=3.11",
    install_requires=["setuptools"],
    extras_require={"fast": ["numba"], "sweep": ["dask", "distributed"]},
    zip_safe=False,
    entry_points={"console_scripts": [f"{name} = {PACKAGE}.nodes.{name}:main" for name in EXECUTABLES]},
)

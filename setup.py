"""Packaging of ldcs_ros, for pip and for colcon (ament_python); the version stands in package.xml."""

from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "ldcs_ros"
SHARE = f"share/{NAME}"
manifest = ElementTree.parse("package.xml").getroot()

setup(
    name=NAME,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    license="Apache-2.0",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    python_requires=">=3.10",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Environment :: Console",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        *(f"Programming Language :: Python :: 3.{minor}" for minor in range(10, 15)),
        "Topic :: Scientific/Engineering",
        "Typing :: Typed",
    ],
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    # msg_defs in the package is a link to the interface package beside it: one source, readable without ROS.
    package_data={
        NAME: [
            "py.typed",
            "config/*.*",
            "scenes/*.yaml",
            "viewing/panel/*.*",
            "rig/rigs/*.yaml",
            "msg_defs/msg/*.msg",
            "msg_defs/srv/*.srv",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", sorted(glob(f"{NAME}/launch/*.py"))),
        (f"{SHARE}/config", sorted(glob(f"{NAME}/config/*.*"))),
    ],
    # The tested versions stand in requirements/*.lock; rclpy comes from a distribution or from ros.lock.
    install_requires=[
        "lz4",
        "matplotlib",
        "mcap",
        "mcap-ros2-support",
        "numba",
        "numpy",
        "pillow",
        "pyyaml",
        "rosbags",
        "scipy>=1.15",
        "threadpoolctl",
        "tqdm",
        "zstandard",
    ],
    extras_require={
        # The wheels of ROS 2 that the nodes run on (Linux x86-64); a sourced distribution has them, too.
        "ros": [
            "ros-rclpy",
            "ros-rmw-fastrtps-cpp",
            "ros-diagnostic-msgs",
            "ros-geometry-msgs",
            "ros-lifecycle-msgs",
            "ros-rcl-interfaces",
            "ros-rosgraph-msgs",
            "ros-sensor-msgs",
            "ros-std-msgs",
            "ros-std-srvs",
            "ros-visualization-msgs",
        ],
        # What the bridge needs for valve islands (Modbus TCP) and serial lines.
        "rig": ["pymodbus>=3.16", "pyserial"],
        # What `ldcs view` shows bags and running twins with.
        "view": ["rerun-sdk>=0.39"],
        # What `ldcs study` and `ldcs sweep` need with --scheduler, to use more than one machine.
        "cluster": ["distributed"],
        # What `to_pandas`, `to_xarray`, Parquet and netCDF need.
        "data": ["pandas", "pyarrow", "xarray"],
        # What the environments for reinforcement learning are made of.
        "rl": ["gymnasium>=1.0"],
        # What `simulation.linearize().to_control()` returns.
        "control": ["control"],
        # setuptools: what an editable install without build isolation needs; colcon asks for less than 80.
        "dev": ["hypothesis", "mypy", "pytest", "pytest-timeout", "pytest-xdist", "ruff", "setuptools<80", "typos"],
    },
    entry_points={
        "console_scripts": [
            "ldcs = ldcs_ros.cli.main:main",
            # Names that clash with no other program, for an installation by pip.
            "ldcs-bridge = ldcs_ros.ros.__main__:bridge",
            "ldcs-live-view = ldcs_ros.ros.live_view:main",
            "ldcs-mock-rig = ldcs_ros.ros.__main__:mock_rig",
            "ldcs-sim = ldcs_ros.ros.__main__:sim",
            # Names of `ros2 run ldcs_ros`.
            "bridge = ldcs_ros.ros.__main__:bridge",
            "live_view = ldcs_ros.ros.live_view:main",
            "mock_rig = ldcs_ros.ros.__main__:mock_rig",
            "sim = ldcs_ros.ros.__main__:sim",
        ],
    },
    zip_safe=False,
)

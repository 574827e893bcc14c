# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

from setuptools import find_packages, setup

NAME = "skydiver_utc"
NODES = ("plant_node", "reference_node", "estimator_node", "controller_node", "recorder_node", "player_node")


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """Every file below `folder`, for share/skydiver_utc with its subfolders kept."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    return [(f"share/{NAME}/{path.parent.as_posix()}", [path.as_posix()]) for path in files]


setup(
    name=NAME,
    version="0.1.0",
    description="A virtual skydiver in free fall, flown by the Unscented Transform Controller",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        *(f"Programming Language :: Python :: 3.{minor}" for minor in range(10, 14)),
        "Topic :: Scientific/Engineering",
        "Typing :: Typed",
    ],
    maintainer="skydiver_utc maintainers",
    maintainer_email="maintainers@skydiver-utc.example",
    license="Apache-2.0",
    python_requires=">=3.10",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "view/report.*"]},
    install_requires=[
        "click>=8.1.6",
        "cmaes>=0.10",
        "daqp>=0.7",
        "lz4>=4.3",
        "matplotlib>=3.6.3",
        "mcap>=1.5",
        "numba>=0.62",
        "numpy>=1.26",
        "pydantic>=2.6",
        "pyyaml>=6.0.1",
        "rich>=13.7",
        "rosbags>=0.11.6",
        "scipy>=1.11.1",
        "viser>=1.1.1,<2",
        "zstandard>=0.21",
    ],
    extras_require={
        # A ROS 2 installation brings its own; without one these are the same rclpy and messages as wheels.
        "ros": ["ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"],
        # Studies on a Dask cluster, samplers of sensitivity, and tables as Parquet.
        "studies": ["distributed>=2024.5", "pyarrow>=15", "SALib>=1.5"],
        "test": [
            "click>=8.2",
            "filterpy>=1.4.5",
            "hypothesis>=6.98",
            "ipykernel>=6.29",
            "mcap-ros2-support>=0.5",
            "nbclient>=0.10",
            "pin>=3.0",
            "playwright>=1.49",
            "pytest>=9",
            "pytest-xdist>=3.4",
            "yeadon>=2.0.1",
        ],
        "docs": [
            "myst-parser>=4",
            "pydata-sphinx-theme>=0.16",
            "sphinx>=8.1",
            "sphinx-click>=6",
            "sphinx-design>=0.6",
            "sphinx-gallery>=0.18",
        ],
        # The tool chains of `make bench`; casadi alone is a wheel of 93 MB.
        "bench": ["casadi>=3.6", "do-mpc>=5", "osqp>=1"],
        "dev": ["mypy>=1.11", "ruff>=0.9", "scipy-stubs", "types-PyYAML"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"lib/{NAME}", [f"ros2_run/{node}" for node in NODES]),
        *shared("config"),
        *shared("launch"),
    ],
    entry_points={
        "console_scripts": [
            f"skydiver-utc = {NAME}.cli.main:main",
            *(f"{node} = {NAME}.nodes.process:{node}" for node in NODES),
        ],
    },
)

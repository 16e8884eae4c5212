"""The packages of a wheel: setuptools finds none under the names that `pyproject.toml` gives to folders."""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup

project = tomllib.loads(Path(__file__).with_name("pyproject.toml").read_text("utf-8"))
packages = ["touchstone"]
for package, folder in project["tool"]["setuptools"]["package-dir"].items():
    packages += [package, *(f"{package}.{inner}" for inner in find_packages(folder))]

setup(packages=packages)

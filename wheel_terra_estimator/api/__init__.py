# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The Python interface: models to curves, drives to estimates, tables to diagnoses, and pictures.

What stands here keeps its name, units and meaning within a major version; everything else of the
package is free to move. SI units and radians throughout (degrees only in names that end in
``_deg``); frames, signs and the definition of slip are those of ``docs/nomenclature.md``. pandas is
optional: where it is missing, ``as_frame=False`` gives the same columns as arrays.

Examples
--------
>>> from wheel_terra_estimator.api import Model, Soil, Wheel
>>> wheel = Wheel(radius=0.13, width=0.16, lug_height=0.01, lug_count=24)
>>> curve = Model(wheel, Soil.load('dlr_mss')).curve(slip=[0.1, 0.3, 0.5], normal_load=80.0)
>>> bool((curve.drawbar_pull[1:] > curve.drawbar_pull[:-1]).all())
True
"""

from wheel_terra_estimator import __version__
from wheel_terra_estimator.api.drives import estimate, simulate, smooth, taught
from wheel_terra_estimator.api.models import Curve, Model
from wheel_terra_estimator.api.pictures import plot_curve, plot_diagnosis, plot_estimates
from wheel_terra_estimator.api.soils import Soil
from wheel_terra_estimator.api.tables import corrected_model, diagnose
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.errors import ConfigurationWarning, UserError
from wheel_terra_estimator.estimation.taught import Taught
from wheel_terra_estimator.simulation.drive import SimulatedDrive
from wheel_terra_estimator.simulation.truth import TruthTable
from wheel_terra_estimator.terramechanics.wheel import Wheel

__all__ = [
    'ConfigurationWarning',
    'Curve',
    'Diagnosis',
    'Model',
    'SimulatedDrive',
    'Soil',
    'Taught',
    'TruthTable',
    'UserError',
    'Wheel',
    '__version__',
    'corrected_model',
    'diagnose',
    'estimate',
    'plot_curve',
    'plot_diagnosis',
    'plot_estimates',
    'simulate',
    'smooth',
    'taught',
]

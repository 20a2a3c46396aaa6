# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rival contact laws on a drive: how likely its readings were to the filter with each."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.replay import events
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import ConfigurationWarning, UserError
from wheel_terra_estimator.estimation.filter.likelihood import Likelihood
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.terramechanics.contact_law import LAWS


@dataclass(frozen=True)
class DriveLaw:
    """A law, the ln likelihood of the readings under it, and how many there were."""

    name: str
    log_likelihood: float
    readings: int


def rank_laws(bag: Bag, configuration: Configuration, remaps: Mapping[str, str]) -> list[DriveLaw]:
    """Replay a drive with each law; the one to which the readings were likeliest comes first.

    Raises UserError if no reference velocity was fused: without it each law makes the slip that
    suits it.
    """
    found = []
    for law in LAWS:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', ConfigurationWarning)  # effects that a law has not
            with_law = configuration.replace({'rover.contact_law': law})
        likelihood = Likelihood()
        pipeline = Pipeline(with_law, estimator=WheelSoilEstimator(with_law, likelihood=likelihood))
        reader = MeasurementReader(bag, remaps, with_law)
        for _ in events(reader.messages(), pipeline, threading.Event()):
            pass
        if 'nis_reference' not in pipeline.core.health():
            raise UserError(
                f'{bag.path}: no reference velocity (--remap reference_odom:=TOPIC); without it '
                'each law makes a slip that suits the torques, and the wrong one may come first'
            )
        found.append(DriveLaw(law, *likelihood.state))
    return sorted(found, key=lambda law: -law.log_likelihood)


def as_text(laws: list[DriveLaw]) -> str:
    """Return the ranking as a Markdown table."""
    lines = ['| law | ln likelihood | readings |', '|---|---|---|']
    for law in laws:
        behind = law.log_likelihood - laws[0].log_likelihood
        lines.append(f'| {law.name} | {behind:.1f} | {law.readings} |')
    return '\n'.join(lines)

# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stuck warning: raised by any sign of entrapment, cleared when none has been there for a while."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.judgement.stuck.forecast import WheelForecast
from wheel_terra_estimator.estimation.judgement.stuck.settings import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.signs import (
    SIGNS,
    Sign,
    SignTuning,
    in_words,
)
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    Observed,
    RoverMotion,
    Situation,
    SituationObserver,
)
from wheel_terra_estimator.estimation.scalars import NAN

_TIME_ROUNDING = 1e-9  # [s]
_SETTINGS, _TUNING = StuckSettings(), SignTuning()


class StuckAssessment(NamedTuple):
    """Result of one update; tuples have one entry per wheel."""

    stuck: bool = False
    reason: str = ''
    wheels: tuple[WheelForecast, ...] = ()
    stalled: tuple[bool, ...] = ()
    direction: int = 0  # of the rims that led to it: 1, -1; 0 none, both or unknown
    confirmed: bool = False
    """Whether something says so that no wrong sign or unit of the wheels' readings makes up."""


class StuckState(NamedTuple):
    """What the monitor remembers."""

    observed: Observed
    since: tuple[float, ...]  # when each sign came [s], nan = it is not there
    stuck: bool = False
    reason: str = ''
    clear_since: float = NAN  # [s]
    direction: int = 0


class StuckMonitor(Component[StuckState]):
    """Stuck warning of one rover.

    Parameters
    ----------
    settings : StuckSettings
        The parameters.
    signs : sequence of Sign
        What raises the warning.
    """

    def __init__(
        self,
        settings: StuckSettings = _SETTINGS,
        signs: Sequence[Sign] = SIGNS,
        tuning: SignTuning = _TUNING,
    ) -> None:
        self._observer = SituationObserver(settings)
        super().__init__(StuckState(self._observer.state, (NAN,) * len(signs)))
        self._settings, self._signs, self._tuning = settings, tuple(signs), tuning

    def update(self, time: float, motion: RoverMotion) -> StuckAssessment:
        """Judge the motion of the rover at a time [s]."""
        self._observer.restore(self.state.observed)
        situation = self._observer.update(time, motion)
        since, raised = self._signs_at(time, situation)
        old = self.state
        stuck, reason, direction, clear_since = old.stuck, old.reason, old.direction, NAN
        if raised:
            if not stuck:
                reason = in_words(raised[0], situation, self._tuning)
                stuck, direction = True, situation.led_by
        elif stuck:
            clear_since = self._clear_since(time, situation, since)
            if time - clear_since >= self._settings.clear_time:
                stuck, reason, direction, clear_since = False, '', 0, NAN
        self.state = StuckState(situation.observed, since, stuck, reason, clear_since, direction)
        wheels = situation.outlook.wheels
        return StuckAssessment(
            stuck, reason, wheels, situation.stalled, direction, stuck and situation.confirmed
        )

    def _signs_at(self, time: float, situation: Situation) -> tuple[tuple[float, ...], list[Sign]]:
        """Return since when each sign is there, and the signs that have been for long enough."""
        since, raised = [], []
        for sign, before in zip(self._signs, self.state.since, strict=True):
            if not sign.present(situation, self._tuning):
                since.append(NAN)
                continue
            begun = time if isnan(before) else before
            since.append(begun)
            held = time - begun >= sign.hold - _TIME_ROUNDING
            if held and (sign.while_stopping or not situation.stopping):
                raised.append(sign)
        return tuple(since), raised

    def _clear_since(self, time: float, situation: Situation, since: tuple[float, ...]) -> float:
        """Return since when the rover seems to be free [s], nan = it does not.

        A sign that is there counts, whether or not it has been for long enough to raise a warning.
        """
        slipping = not situation.typical_magnitude < self._settings.clear_slip
        if slipping or not all(isnan(begun) for begun in since):
            return NAN
        return time if isnan(self.state.clear_since) else self.state.clear_since

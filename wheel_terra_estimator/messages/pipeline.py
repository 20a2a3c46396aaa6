# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages in, estimate sets out: what the node and the replay both are.

They differ in nothing but who brings the messages and where the sets go.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from wheel_terra_estimator.checks.watched_estimator import WatchedEstimator
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.timing.input_log import Estimator
from wheel_terra_estimator.messages.convert import InputConverter, input_layout
from wheel_terra_estimator.messages.diagnostics import NODE, Diagnostics

FAULT_MEMORY = 5_000_000_000
"""How long a refused message is shown as a fault [ns of stamps]."""

_REPEATED = '_stamp_repeated'  # likewise, behind the topic
_REJECTED = '_rejected: '  # between topic and reason in the keys of the core's counters


class Pipeline:
    """The estimator core with a converter before it.

    Parameters
    ----------
    configuration : Configuration
        Rover, soil, sensors, filter.
    node_name : str
        Name of the node with its namespace, for diagnostics.
    estimator : Estimator, optional
        See `EstimatorCore`.

    Attributes
    ----------
    received : Counter
        Messages heard, by input topic.
    transport_faults, transport_values : dict, callable
        What whoever brings the messages has to say for itself in diagnostics: faults in words, and
        a function that returns key-values.
    on_measurement : callable or None
        Gets each measurement before the core does.
    diagnostics : Diagnostics
        Says what ``/diagnostics`` is to say, and when.
    """

    def __init__(
        self,
        configuration: Configuration,
        node_name: str = NODE,
        estimator: Estimator | None = None,
    ) -> None:
        self.configuration = configuration
        self.names = configuration.wheels.names
        self.converter = InputConverter(input_layout(configuration))
        self.core = EstimatorCore(configuration, estimator, watched_by=WatchedEstimator)
        self.received: Counter[str] = Counter()
        self.diagnostics = Diagnostics(self.names, self.counters, self._faults, node_name)
        self.transport_faults: dict[str, str] = {}
        self.transport_values: Callable[[], dict[str, Any]] = dict
        self.on_measurement: Callable[[Measurement], object] | None = None
        self._published = 0
        self._refused: dict[tuple[str, str], tuple[int, int]] = {}  # -> count, stamp

    def hear(self, topic: str, message: Any) -> list[EstimateSet]:
        """Take a message of an input topic and return the sets that it completed."""
        self.received[topic] += 1
        measurement = self.converter.convert(topic, message)
        if measurement is None:
            return []
        if self.on_measurement is not None:
            self.on_measurement(measurement)
        return self._out(self.core.add(measurement))

    def settle(self) -> None:
        """Do beforehand what the next set would wait for; changes no number."""
        self.core.settle()

    def refuse(self, topic: str, reason: str) -> None:
        """Count a message of an input topic that could not even be unpacked."""
        self.received[topic] += 1
        self.converter.rejected[topic, reason] += 1

    def flush(self) -> list[EstimateSet]:
        """Return the sets that were held back for late inputs; the recording is over."""
        return self._out(self.core.flush())

    def reset(self) -> None:
        """Forget the state, keep the parameters."""
        self.core.reset()

    def retune(self, configuration: Configuration) -> None:
        """Go on with other tuning; wheels, sensors and soil must be the same."""
        self.configuration = configuration
        self.core.retune(configuration)

    @property
    def rejected(self) -> Counter[tuple[str, str]]:
        """Messages that could not be used, by (input topic, reason in words)."""
        found = Counter(self.converter.rejected)
        for key, count in self.core.health().items():
            topic, mark, reason = key.partition(_REJECTED)
            if mark:
                found[topic, reason] += count
            elif key.endswith(_REPEATED):
                found[key.removesuffix(_REPEATED), 'stamp repeated, merged'] += count
        return found

    def counters(self) -> dict[str, Any]:
        """Return what happened so far, for diagnostics and summaries."""
        result: dict[str, Any] = {'sets_published': self._published}
        result.update((f'{topic}_received', count) for topic, count in self.received.items())
        for (topic, reason), count in self.converter.rejected.items():
            result[f'{topic}{_REJECTED}{reason}'] = count
        result.update(
            (f'{topic}_last_reason', reason) for topic, reason in self._last_reasons().items()
        )
        result.update(self.transport_values())
        result.update(self.core.health())
        return result

    def _out(self, sets: list[EstimateSet]) -> list[EstimateSet]:
        self._published += len(sets)
        return sets

    def _last_reasons(self) -> dict[str, str]:
        """Return input topic -> why something of it was last rejected."""
        found = {
            topic: reason
            for (topic, reason), _ in sorted(self._refused.items(), key=lambda item: item[1][1])
        }
        return found | self.core.last_reasons

    def _faults(self, stamp: int) -> dict[str, str]:
        """Return the messages that were refused of late, in words."""
        for key, count in self.converter.rejected.items():
            if count != self._refused.get(key, (0, 0))[0]:
                self._refused[key] = count, stamp
        refused = {
            topic: f'{self.converter.in_words(topic, reason)} ({count} messages)'
            for (topic, reason), (count, since) in self._refused.items()
            if 0 <= stamp - since < FAULT_MEMORY
        }
        return {**refused, **self.transport_faults}

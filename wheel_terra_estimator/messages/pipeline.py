# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages in, estimate sets out: what the node and the replay both are.

They differ only in the source of the messages and the destination of the sets.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from wheel_terra_estimator.checks.input_judge import InputJudge
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.timing.input_checks import REMEDIES
from wheel_terra_estimator.estimation.timing.input_log import Estimator
from wheel_terra_estimator.messages.convert import InputConverter
from wheel_terra_estimator.messages.diagnostics import NODE, Diagnostics

RESET = 'reset'  # line of an arrival log for a call of ``~/reset``
TUNE = 'set'  # begin of one for parameters that are changed, which follow in JSON


class Pipeline:
    """The estimator core with a converter before it.

    ``node_name``: name of the node with its namespace, for diagnostics. ``estimator``: see
    `EstimatorCore`.
    """

    def __init__(
        self,
        configuration: Configuration,
        node_name: str = NODE,
        estimator: Estimator | None = None,
    ) -> None:
        self.configuration = configuration
        self.names = configuration.wheels.names
        self.converter = InputConverter(configuration)
        self.core = EstimatorCore(configuration, estimator, judged_by=InputJudge)
        self.received: Counter[str] = Counter()  # messages received, by input topic
        self.diagnostics = Diagnostics(self.names, self.counters, self._faults, node_name)
        # ``transport_faults``, ``transport_values``: return what whoever brings the messages has to
        # say in diagnostics: faults since it was last asked (subject and words), and key-values
        self.transport_faults: Callable[[], Iterable[tuple[str, str]]] = tuple
        self.transport_values: Callable[[], dict[str, Any]] = dict
        # Gets each measurement before the core does
        self.on_measurement: Callable[[Measurement], object] | None = None
        self._published = 0
        self._refused: Counter[tuple[str, str]] = Counter()  # as reported
        self._reasons: dict[str, str] = {}  # of the last refusal, by topic

    def hear(self, topic: str, message: Any) -> list[EstimateSet]:
        """Take a message of an input topic and return the sets that it completed."""
        self.received[topic] += 1
        measurement = self.converter.convert(topic, message)
        if measurement is None:
            return []
        if self.on_measurement is not None:
            self.on_measurement(measurement)
        sets = self.core.add(measurement)
        self._published += len(sets)
        return sets

    def refuse(self, topic: str, reason: str) -> None:
        """Count a message of an input topic that could not even be unpacked."""
        self.received[topic] += 1
        self.converter.rejected[topic, reason] += 1

    def flush(self) -> list[EstimateSet]:
        """Return the sets that were held back for late inputs; the recording is over."""
        sets = self.core.flush()
        self._published += len(sets)
        return sets

    def reset(self) -> None:
        """Forget the state, keep the parameters; inputs are waited for as at a start."""
        self.core.reset()
        self.diagnostics.begin_anew()

    def retune(self, configuration: Configuration) -> None:
        """Continue with other tuning; wheels, sensors and soil must be the same."""
        self.configuration = configuration
        self.core.retune(configuration)

    @property
    def rejected(self) -> Counter[tuple[str, str]]:
        """Messages that could not be used, by (input topic, reason in words)."""
        repeated = {(t, 'stamp repeated, merged'): n for t, n in self.core.repeated.items()}
        return self.converter.rejected + self.core.rejected + Counter(repeated)

    def counters(self) -> dict[str, Any]:
        """Return what happened so far, for diagnostics and summaries."""
        result: dict[str, Any] = {'sets_published': self._published}
        result.update((f'{topic}_received', count) for topic, count in self.received.items())
        for (topic, reason), count in self.converter.rejected.items():
            result[f'{topic}_rejected: {reason}'] = count
        result.update((f'{topic}_last_reason', why) for topic, why in self._reasons.items())
        result.update(self.transport_values())
        result.update(self.core.health())
        return result

    def _faults(self) -> list[tuple[str, str]]:
        """Return messages on inputs lost and rejected since the last call."""
        found = list(self.transport_faults())
        rejected = self.converter.rejected + self.core.rejected
        for (topic, reason), count in rejected.items():
            if count != self._refused[topic, reason]:
                remedy = f' -> {REMEDIES[reason]}' if reason in REMEDIES else ''
                words = f'{self.converter.in_words(topic, reason)} ({count} so far){remedy}'
                self._reasons[topic] = words
                found.append((topic, words))
        self._refused = rejected
        return found

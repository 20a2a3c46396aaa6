# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A recording as a stream of typed measurements."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from wheel_terra_estimator.bags.salvage import limits
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.bags.topic_choice import (
    NO_INPUTS,
    WHEEL_RATES,
    as_options,
    choose_topics,
    other_references,
    other_rovers,
)
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import nearest
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.messages.convert import (
    DAMAGED,
    INPUT_TYPES,
    InputConverter,
    names_in_words,
)
from wheel_terra_estimator.messages.unpack import DamagedMessageError, Message, unpack


def in_one_line(topics: Iterable[tuple[str, str]]) -> str:
    """Return names and types of the topics of a bag; those of estimates together, as such."""
    there = list(topics)
    estimates = [name for name, _ in there if name.startswith(NO_INPUTS[0])]
    words = [f'{name} ({kind})' for name, kind in there if name not in estimates]
    if estimates:
        words.append(
            f'{len(estimates)} topics of estimates ({NO_INPUTS[0]}...), which are not inputs'
        )
    return ', '.join(words)


class MeasurementReader:
    """Reads the input topics of the estimator out of an open bag; no other topic is unpacked.

    ``remaps``: estimator's topic to the bag's, see `parse_remaps`. Raises UserError where the wheel
    odometry, or a topic that was remapped, is not there or has another type; no wheel of the
    configuration is in the bag.
    """

    def __init__(self, bag: Bag, remaps: Mapping[str, str], configuration: Configuration) -> None:
        self.bag = bag
        self.converter = InputConverter(configuration)
        # Estimator's topic to the bag's, for the topics that are there
        self.topics: dict[str, str] = {}
        # Topics that the estimator could use and that are not in the bag
        self.absent: list[str] = []
        for name in self.converter.topics:
            self._find(name, remaps)
        # Messages that could not be used, by (estimator's topic, reason)
        self.rejected: Counter[tuple[str, str]] = self.converter.rejected
        if self.converter.wheel_odometry == 'joint_states':
            self._check_wheel_names()

    @property
    def notes(self) -> list[str]:
        """Topics that the bag lacks, and the consequence."""
        notes = [f'not in the bag: {", ".join(self.absent)}'] if self.absent else []
        if 'reference_odom' in self.absent:
            notes.append(
                'without a reference velocity slip can be wrong, beyond its stated deviation'
            )
            notes += [others] if (others := other_references(self.bag)) else []
        return notes

    @property
    def message_count(self) -> int:
        """Number of messages on the used topics."""
        return sum(self.bag.topics[topic].message_count for topic in self.topics.values())

    def measurements(self) -> Iterator[Measurement]:
        """Yield the measurements in the order of log times."""
        for _, name, message in self.messages():
            measurement = self.converter.convert(name, message)
            if measurement is not None:
                yield measurement

    def messages(self) -> Iterator[tuple[int, str, Message]]:
        """Yield (log time [ns], estimator's topic, message); what cannot be unpacked is counted."""
        names: dict[str, list[str]] = {}
        for name, topic in self.topics.items():
            names.setdefault(topic, []).append(name)
        for log_time, topic, data in self.bag.messages(tuple(names)):
            for name in names[topic]:
                message = self.unpack(data, name)
                if message is not None:
                    yield log_time, name, message

    def unpack(self, data: bytes, name: str) -> Message | None:
        """Return the message in CDR bytes of an input topic; None, counted, if it is damaged."""
        if len(data) > limits.MESSAGE:
            self.rejected[name, f'above {limits.in_words(limits.MESSAGE)}'] += 1
            return None
        try:
            return unpack(INPUT_TYPES[name], data)
        except DamagedMessageError:
            self.rejected[name, DAMAGED] += 1
            return None

    def _find(self, name: str, remaps: Mapping[str, str]) -> None:
        """Find an input topic in the bag."""
        topic = remaps.get(name, f'/{name}')
        found = self.bag.topics.get(topic)
        required = name == self.converter.wheel_odometry
        if found is None or not found.message_count:
            if not required and name not in remaps:
                self.absent.append(name)
                return
            state = 'is empty' if found else 'is not in the bag'
            raise UserError(f'{self.bag.path}: topic {topic} {state}; {self._advice(name)}')
        if found.type != INPUT_TYPES[name]:
            raise UserError(
                f'{self.bag.path}: topic {topic} has type {found.type}, {name} needs '
                f'{INPUT_TYPES[name]}; {self._advice(name)}'
            )
        self.topics[name] = topic

    def _advice(self, name: str) -> str:
        """Return a message on the topics of the bag and how to use them."""
        there, chosen = self.bag.topics.values(), choose_topics(self.bag, {})
        remedy = f'name the right one with --remap {name}:={chosen.get(name, "/TOPIC")}'
        if name == 'reference_odom' and name not in chosen:
            remedy = other_references(self.bag) or remedy
        elif name == 'joint_states' and name not in chosen:
            if 'odom' in chosen:
                remedy = f'use -p wheel_odometry:=odom --remap odom:={chosen["odom"]}'
        elif name == 'joint_states' and chosen[name] != WHEEL_RATES:
            ways = [as_options(chosen), *other_rovers(self.bag, chosen)]
            remedy = f'choose with {"; or, of another rover, with ".join(ways)}'
        return f'there are: {in_one_line((t.name, t.type) for t in there)}; {remedy}'

    def _check_wheel_names(self) -> None:
        """Make sure that some joint message holds a wheel, before anything is written."""
        heard: dict[str, None] = {}
        wanted = self.converter.wheels.names
        for _, _, data in self.bag.messages((self.topics['joint_states'],)):
            message = self.unpack(data, 'joint_states')
            if message is not None:
                if not set(wanted).isdisjoint(message.names):
                    self.rejected.clear()  # they are counted when they are read
                    return
                heard.update(dict.fromkeys(message.names))
        topic = self.topics['joint_states']
        if not heard:
            raise UserError(
                f'{self.bag.path}: no message on {topic} can be read and names a joint; copy the '
                'bag again, or record that topic again'
            )
        raise UserError(
            f'{self.bag.path}: no wheel of wheels.names ({", ".join(wanted)}) is on '
            f'{topic}, which holds {names_in_words(heard)}; '
            'set -p wheels.names:=[...] to the names in the bag, front to rear, left before right'
        )


def check_remaps(bag: Bag, remaps: Mapping[str, str]) -> None:
    """Raise UserError where a topic that was named is not in the bag, or has another type."""
    for name, topic in remaps.items():
        found = bag.topics.get(topic)
        if found is None or found.type != INPUT_TYPES[name]:
            raise UserError(
                f'{bag.path}: --remap {name}:={topic}: no such topic of {INPUT_TYPES[name]}; there '
                f'are: {in_one_line((t.name, t.type) for t in bag.topics.values())}'
            )


def parse_remaps(texts: Iterable[str]) -> dict[str, str]:
    """Return {estimator's topic: bag's topic} of ``FROM:=TO`` texts.

    Raises UserError for a text of another form, or a topic that the estimator does not listen to.
    """
    remaps = {}
    for text in texts:
        name, sign, topic = text.partition(':=')
        name, topic = name.strip().lstrip('/'), topic.strip()
        if not sign or not topic:
            raise UserError(f"--remap {text}: give FROM:=TO, the estimator's topic, then the bag's")
        if name not in INPUT_TYPES:
            near = nearest(name, INPUT_TYPES)
            raise UserError(
                f'--remap {text}: the estimator does not listen to {name}'
                + (f' (nearest: {near})' if near else '')
                + f'; its topics are {", ".join(INPUT_TYPES)}'
            )
        remaps[name] = topic if topic.startswith('/') else f'/{topic}'
    return remaps

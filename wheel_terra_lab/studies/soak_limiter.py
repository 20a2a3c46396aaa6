# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimator and traction limiter for minutes or hours, with a rover that digs itself in.

::

    python -m wheel_terra_lab.studies.soak_limiter --minutes 60 --seed 1

The rover drives as the limiter lets it. Again and again the ground gives way, the operator drives
on, and while ``~/stuck`` stands nodes are restarted or held up, clocks step and inputs fall silent.
What the limiter sends out is held against the invariants of docs/limiter.md, each time with the
command that it belongs to. On a machine that starves this program, too, nothing is judged while it
is late itself; the report tells the share. The exit status is 1 where an invariant was broken, a
node ended, or inputs were lost without a word of the estimator.
"""

from __future__ import annotations

import argparse
import math
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, Int8
from std_srvs.srv import Trigger

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.studies.live_rover import NODE, Process, Rover, serve

RATES = {'joint_states': 20.0, 'imu/data': 20.0, 'sinkage': 5.0, 'reference_odom': 2.0}
COMMAND_PERIOD = 0.05  # [s]
SPEED = 0.1  # [m/s] that is commanded
CREEP, STALE = 0.3, 0.3  # scales of the limiter
STEP = 0.2 * 0.5  # [m/s] that may be added by one message
SETTLED = 1.0  # [s] after which limiter and monitor know the same
ON_TIME = 0.2  # [s] between two looks of the monitor at most
REACHED = 10  # messages of one command after which the ramp is behind
LOST, SILENT = 'lost', 'no message for'  # what the estimator says of its inputs
PATIENCE = 600.0  # [s] for what must come sooner or later, however little processor time there is
FAULTS = (
    'none',
    'estimator restarted',
    'estimator killed',
    'estimator held up',
    'limiter restarted',
    'limiter killed',
    'limiter held up',
    'both restarted',
    'inputs silent',
    'inputs dropped',
    'clock back',
    'clock ahead',
)


class DrivenRover(Rover):
    """A rover that does what comes out of the limiter, an operator, and a monitor."""

    def __init__(self, names: Any, radius: float, send: Callable[..., None]) -> None:
        super().__init__(names, RATES, send)
        self._radius = radius
        self.pit = 0  # direction in which the wheels dig, 0 = firm ground
        self.wanted = 0.0
        self.turn = 0.0
        self._sent, self._sent_at, self._moved_at = 0.0, 0.0, time.monotonic()
        self._command_due = 0.0
        self._depth = 0.01  # [m]
        self.stuck, self.direction, self.changed_at = False, 0, 0.0
        self.interlock = ''
        self._sent_for, self._same = (0.0, 0.0), 0  # the command of the last, and of how many
        self._looked_at = self._late_at = time.monotonic()
        self.heard_of: Counter[str] = Counter()  # words of the estimator on losses
        self.released_at = time.monotonic()  # infinite: the answer has not come
        self.broken: Counter[str] = Counter()
        self._suspected: list[tuple[float, str]] = []  # broken unless ~/stuck just changed
        self.outs = self.judged = 0
        self.risen, self.risen_at = 0, 0.0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._commands = self.create_publisher(TwistStamped, 'cmd_vel_in', 1)
        self.create_subscription(TwistStamped, 'cmd_vel_out', self._on_out, 100)
        self.create_subscription(Bool, f'{NODE}/stuck', self._on_stuck, latched)
        self.create_subscription(Int8, f'{NODE}/stuck_direction', self._on_direction, latched)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_limiter, 100)

    def publish_due(self) -> float:
        """Send what is due of sensors and operator; return when the next message is."""
        now = time.monotonic()
        if now - self._looked_at > ON_TIME:
            self._late_at = now
        self._looked_at = now
        while self._suspected and now - self._suspected[0][0] > SETTLED:
            at, words = self._suspected.pop(0)
            self.broken[words] += self.changed_at < at - SETTLED
        if now >= self._command_due:
            self._command_due = now + COMMAND_PERIOD
            message = TwistStamped()
            message.twist.linear.x, message.twist.angular.z = self.wanted, self.turn
            message.header.frame_id = f'{now} {self.wanted} {self.turn}'  # for the monitor
            self._commands.publish(message)
        return min(super().publish_due(), self._command_due)

    def steer(self, wanted: float, turn: float = 0.0) -> None:
        """Command something else from now on."""
        self.wanted, self.turn = wanted, turn

    def _message(self, topic: str, stamp: int) -> Any:
        message = super()._message(topic, stamp)
        now = time.monotonic()
        speed = self._sent if now - self._sent_at < 0.5 else 0.0  # the base has a timeout
        digs = self.pit * speed > 0.0
        travel, self._moved_at = speed * (now - self._moved_at), now
        if self.pit:
            deeper = 0.5 if digs else -0.2
            self._depth = min(max(self._depth + deeper * abs(travel), 0.01), 0.9 * self._radius)
        if topic == 'joint_states':
            count = len(self.names)
            noise = [part - 3.0 for part in message.effort]
            message.velocity = [speed / self._radius + 0.01 * part * bool(speed) for part in noise]
            message.effort = [float('nan')] * count
        elif topic == 'sinkage':
            message.position = [part - 0.02 + self._depth for part in message.position]
        elif topic == 'reference_odom':
            message.twist.twist.linear.x = (0.02 if digs else 0.9) * speed
        return message

    def _on_out(self, message: TwistStamped) -> None:
        now, before, silent = time.monotonic(), self._sent, time.monotonic() - self._sent_at
        out, turn = message.twist.linear.x, message.twist.angular.z
        commanded_at, wanted, wanted_turn = map(float, message.header.frame_id.split())
        again = (wanted, wanted_turn) == self._sent_for and silent < SETTLED
        self._sent, self._sent_at, self._sent_for = out, now, (wanted, wanted_turn)
        self._same = self._same + 1 if again else 0
        self.outs += 1
        if now - self._late_at < 2.0 * SETTLED:
            return
        self.judged += 1
        known = self.stuck and self.direction and commanded_at - self.changed_at > SETTLED
        released = self.risen_at < self.released_at > now - 10.0 - SETTLED
        if known and not released:
            if out * self.direction > 0.0:
                self._suspected.append((now, 'passed in the direction that led in'))
            if self._same > REACHED and wanted * self.direction < 0.0:
                share = out / wanted
                if abs(share - CREEP) > 1e-6:
                    self._suspected.append((now, f'the way out was open by {share:.2f}'))
            if self._same > REACHED and wanted == 0.0 and abs(turn - CREEP * wanted_turn) > 1e-6:
                self._suspected.append((now, 'no turning on the spot'))
        if abs(out) > abs(before if before * out > 0.0 else 0.0) + STEP + 1e-9:
            self.broken['an increase without the ramp'] += 1
        unheard = now - self.heard_at > 2.0 * SETTLED
        if unheard and not self.stuck and abs(out) > STALE * SPEED + 1e-9:
            self.broken['more than the stale share without estimates'] += 1

    def _on_stuck(self, message: Bool) -> None:
        if message.data != self.stuck:
            self.stuck, self.changed_at = message.data, time.monotonic()
            self.risen += message.data
            self.risen_at = self.changed_at

    def _on_direction(self, message: Int8) -> None:
        if message.data != self.direction:
            self.direction, self.changed_at = message.data, time.monotonic()

    def _on_limiter(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == 'traction_limiter: limiter':
                self.interlock = {v.key: v.value for v in status.values}['interlock']
            elif status.name.endswith(': estimator'):
                self.heard_of.update(words for words in (LOST, SILENT) if words in status.message)


class Soak:
    """One run; the nodes' files lie in `folder`."""

    def __init__(self, folder: Path) -> None:
        configuration = reader.load(['generic_six_wheel'])
        parameters = folder / 'rover.yaml'
        configuration.write(parameters)
        files = {'estimator': f'soil_file:={folder / "soil.yaml"}'}
        files['limiter'] = f'state_file:={folder / "limiter.json"}'
        self._commands = {
            'estimator': ['--params-file', str(parameters), '-p', files['estimator']],
            'limiter': ['-p', files['limiter']],
        }
        self._modules = {'estimator': 'estimator_node', 'limiter': 'traction_limiter_node'}
        self._dropped = 0.0
        radius = float(configuration.wheels.radius[0])
        self.rover = DrivenRover(configuration.wheels.names, radius, self._send)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.rover)
        self._nodes = {name: self._started(name) for name in self._modules}
        self._clients = {
            name: self.rover.create_client(Trigger, name)
            for name in ('traction_limiter/release', f'{NODE}/reset')
        }
        self.times: Counter[str] = Counter()
        self.ends: Counter[str] = Counter()
        self.problems: list[str] = []

    def run(self, seconds: float) -> None:
        """Dig in, do something bad, get out; again and again."""
        self._until(lambda: self.rover.sets > 20, PATIENCE)
        end = time.monotonic() + seconds
        while time.monotonic() < end and not self.problems:
            self._dig_in(random.choice((1, -1)))
            for _ in range(random.choice((1, 2))):
                self._fault(random.choice(FAULTS))
                self._wander(random.uniform(3.0, 8.0))
            self._get_out()
        for name, node in self._nodes.items():
            if node.end(signal.SIGINT):
                self.problems.append(f'the {name} ended with another status than 0')
        self.problems += [f'{words} ({n} times)' for words, n in self.rover.broken.items() if n]

    def _dig_in(self, direction: int) -> None:
        self.rover.steer(direction * SPEED)
        self._serve(random.uniform(3.0, 6.0))
        self.rover.pit = direction
        closed = self._until(lambda: self.rover.interlock in ('stopped', 'stuck'), 40.0)
        self.times['stopped in time' if closed else 'dug in untold'] += 1
        if random.random() < 0.6:  # an operator who will not hear of it
            for _ in range(8):
                self._call('traction_limiter/release')
                if self._until(lambda: self.rover.interlock == 'stuck', 9.0):
                    self.times['dug in, released'] += 1
                    break

    def _wander(self, seconds: float) -> None:
        """Command this and that."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            choices = ((SPEED, 0.0), (-SPEED, 0.0), (0.0, 0.2), (0.0, 0.0), (SPEED, 0.2))
            self.rover.steer(*random.choice(choices))
            self._serve(random.uniform(0.3, 4.0))

    def _fault(self, fault: str) -> None:
        self.times[fault] += 1
        told, lost = Counter(self.rover.heard_of), self._lost()
        first = fault.partition(' ')[0]
        if fault.endswith(('restarted', 'killed')):
            for name in self._nodes if first == 'both' else (first,):
                if fault.endswith('killed'):
                    self._nodes[name].end(signal.SIGKILL)
                    self._serve(random.uniform(0.0, 4.0))
                elif self._nodes[name].end(random.choice((signal.SIGINT, signal.SIGTERM))):
                    self.problems.append(f'the {name} ended with another status than 0')
                self._nodes[name] = self._started(name)
            outs = self.rover.outs
            self._until(
                lambda: self.rover.outs > outs and time.monotonic() - self.rover.heard_at < 0.5,
                PATIENCE,
            )
            self.rover.changed_at = time.monotonic()
        elif fault.endswith('held up'):
            self._nodes[first].signal(signal.SIGSTOP)
            self._serve(random.uniform(1.5, 4.0))
            self._nodes[first].signal(signal.SIGCONT)
        elif fault.startswith('inputs'):
            self._dropped = 1.0 if fault == 'inputs silent' else 0.4
            self._serve(random.uniform(2.0, 4.0))
            self._dropped = 0.0
        elif fault.startswith('clock'):
            self.rover.shift += round(random.choice((1.5, 30.0)) * 1e9) * (
                -1 if fault == 'clock back' else 1
            )
        self._serve(2.0)

        def untold(word: str) -> bool:
            return not self._until(lambda: self.rover.heard_of[word] > told[word], PATIENCE)

        if fault == 'inputs silent' and untold(SILENT):
            self.problems.append('inputs fell silent without a word')
        if self._lost() > lost and untold(LOST):
            self.problems.append(f'{fault}: {self._lost() - lost} messages lost without a word')
        for name, node in self._nodes.items():
            if not node.runs():
                self.problems.append(f'the {name} ended by itself at: {fault}')

    def _lost(self) -> int:
        """Return the messages that the estimator has not received, of its present process."""
        return sum(int(n) for key, n in self.rover.values.items() if key.endswith('_lost'))

    def _get_out(self) -> None:
        """Back out, or release, or reset; then firm ground."""
        led = self.rover.pit
        how = random.choice(('motion', 'motion', 'release', 'reset'))
        if how != 'motion':
            self._call('traction_limiter/release' if how == 'release' else f'{NODE}/reset')
        self.rover.pit = 0
        ahead = -led if how == 'motion' else random.choice((led, -led))
        self.rover.steer(ahead * SPEED)
        free = self._until(lambda: not self.rover.stuck and self.rover.interlock == 'free', 40.0)
        if not free:  # driven out forward, a stop needs the operator
            self._call('traction_limiter/release')
            free = self._until(lambda: self.rover.interlock == 'free', 30.0)
            how = f'{how}, then release'
        if not free and self._call(f'{NODE}/reset'):
            free = self._until(lambda: self.rover.interlock == 'free', PATIENCE)
            how = f'{how}, then reset'
        self.ends[how] += 1
        if not free:
            self.problems.append(f'no way out by {how}')

    def _call(self, service: str) -> bool:
        client = self._clients[service]
        if not self._until(client.service_is_ready, PATIENCE):
            self.problems.append(f'{service} is not there')
            return False
        self.rover.released_at = math.inf
        future = client.call_async(Trigger.Request())
        if not self._until(future.done, PATIENCE):
            self.problems.append(f'{service} does not answer')
            return False
        self.rover.released_at = time.monotonic()
        return bool(future.result().success)

    def _started(self, name: str) -> Process:
        module = f'wheel_terra_estimator.ros.{self._modules[name]}'
        return Process(['-m', module, '--ros-args', *self._commands[name]])

    def _send(self, topic: str, message: Any, publish: Callable[[Any], None]) -> None:
        if random.random() >= self._dropped:
            publish(message)

    def _until(self, condition: Callable[[], bool], seconds: float) -> bool:
        return serve(self.rover, self._executor, seconds, condition)

    def _serve(self, seconds: float) -> None:
        serve(self.rover, self._executor, seconds)

    def report(self) -> str:
        """Return what happened."""
        lines = [f'{words:22} {n:5}' for words, n in sorted(self.times.items())]
        lines += [f'got out by {how}: {n}' for how, n in sorted(self.ends.items())]
        lines.append(
            f'{self.rover.outs} commands went out, {self.rover.judged} judged; '
            f'{self.rover.sets} sets, ~/stuck rose {self.rover.risen} times'
        )
        lines += [f'PROBLEM: {problem}' for problem in self.problems]
        return '\n'.join(lines)


def main() -> int:
    """Run the soak and print what happened."""
    parser = argparse.ArgumentParser(description='Estimator and limiter under random faults.')
    parser.add_argument('--minutes', type=float, default=2.0)
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    rclpy.init(args=[])
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(Path(folder))
        try:
            soak.run(60.0 * arguments.minutes)
        finally:
            print(soak.report(), flush=True)
            soak.rover.destroy_node()
            rclpy.try_shutdown()
    return 1 if soak.problems else 0


if __name__ == '__main__':
    sys.exit(main())

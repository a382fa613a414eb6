"""The compiled loop: controller, load, three inertias and two springs, with hidden effects inside.

    Jm m'' = Kt i - bm m' - T / N - friction(Fm) - motor effects
    Js s'' = T - (r + A') C - bs s' - friction(Fs) - spindle effects
    (Jf + JL) q'' = C - load - bL q' - jaw effects
    T = kg (m / N - s - u) + cg (m' / N - s')            u twist that hidden effects add
    C = kc (r s + A - q - e) + cc (r s' + A' s' - q')    e elongation, A cable of the pulley
    torque at the jaw's sensor = load + bL q' + JL q''   the finger Jf is in front of it

Velocities are stepped first, positions with the new ones; friction is solved, not smoothed. So
without effects the declared equations of the reference rig hold, but for the finger's inertia and
what the gear's spring does to accelerations.
"""

import math
import sys
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from benchmarks.rigs import hidden
from benchmarks.rigs.hidden import Operator, Place, Variable
from rig.simulation import plant as reference
from rig.simulation.bench import hash_of
from rig.simulation.forms import BANK
from rig.simulation.plant import TICK_S, braking, clip

(
    MOTOR_ANGLE,
    SPINDLE_ANGLE,
    JAW_ANGLE,
    CURRENT,
    PROXIMAL,
    DISTAL,
    COMMAND,
    LOAD,
) = range(8)
LOGGED = 8
"""Columns of a tick: the instant's true values, then the commands that act from it on."""

ACCELERATION_LAG_S = 4e-3
POINTS, MOST = hidden.TABLE_POINTS, hidden.MOST
VARIABLES = len(Variable)


@numba.njit()
def _looked_up(rows: Any, k: int, j: int, x: float) -> float:
    low, high = rows.ranges[k, j, 0], rows.ranges[k, j, 1]
    place = (x - low) / (high - low)
    if rows.ranges[k, j, 2] != 0.0:
        place -= math.floor(place)
    place = min(max(place, 0.0), 1.0) * (POINTS - 1)
    at = min(int(place), POINTS - 2)
    part = place - at
    return float((1.0 - part) * rows.tables[k, j, at] + part * rows.tables[k, j, at + 1])


@numba.njit()
def _slope(rows: Any, k: int, x: float) -> float:
    step = (rows.ranges[k, 0, 1] - rows.ranges[k, 0, 0]) / (POINTS - 1)
    return float((_looked_up(rows, k, 0, x + step) - _looked_up(rows, k, 0, x - step)) / (2 * step))


@numba.njit()
def _operated(rows: Any, k: int, x: float, memory: Any, last: Any, dt: float) -> float:
    """Return an effect's operator on its variable and move its memory by one step."""
    operator, count = rows.kinds[k, 1], rows.kinds[k, 6]
    if operator == Operator.TABLE:
        if rows.kinds[k, 3]:  # similar: the table's width grows with the amplitude
            return _looked_up(rows, k, 0, x / rows.amplitudes[k])
        return _looked_up(rows, k, 0, x)
    moved = x - last[k]
    last[k] = x
    total = 0.0
    if operator == Operator.STOPS:
        for j in range(count):
            reach = rows.reach[k, j]
            memory[k, j] = min(max(memory[k, j] + moved / reach, -1.0), 1.0)
            total += rows.weights[k, j] * memory[k, j]
    elif operator == Operator.RELAYS:
        for j in range(count):
            if x > rows.reach[k, j]:
                memory[k, j] = 1.0
            elif x < rows.reach[k, BANK + j]:
                memory[k, j] = -1.0
            total += rows.weights[k, j] * memory[k, j]
    elif operator == Operator.LAGS:
        for j in range(count):
            memory[k, j] += (1.0 - math.exp(-dt / rows.reach[k, j])) * (x - memory[k, j])
            total += rows.weights[k, j] * memory[k, j]
    else:  # Bouc-Wen: reach, sharpness, share that loads
        z = memory[k, 0]
        way = moved / rows.reach[k, 0]
        share = rows.reach[k, 2]
        side = 1.0 if way * z > 0.0 else -1.0
        z += way * (1.0 - abs(z) ** rows.reach[k, 1] * (share * side + 1.0 - share))
        memory[k, 0] = min(max(z, -1.0), 1.0)
        total = memory[k, 0]
    return total


@numba.njit()
def _effect(rows: Any, k: int, x: Any, memory: Any, last: Any, dt: float) -> float:
    """Return the value that an effect adds at its place, without a friction's sign."""
    value = _operated(rows, k, x[rows.kinds[k, 4]], memory, last, dt)
    if rows.kinds[k, 5] != Variable.ONE:
        value *= _looked_up(rows, k, 1, x[rows.kinds[k, 5]])
    return float(rows.amplitudes[k] * value)


@numba.njit()
def _signed(level: float, speed: float, width: float) -> float:
    if width > 0.0:
        return level * math.tanh(speed / width)
    return level * (1.0 if speed > 0.0 else -1.0 if speed < 0.0 else 0.0)


@numba.njit()
def _command(c: Any, memory: Any, target: Any, angle: float) -> float:
    """Return the current that the controller asks for, and move its memory by one tick.

    memory: integral, last angle, filtered speed. target: angle, speed, acceleration.
    """
    speed = (angle - memory[1]) / TICK_S
    memory[1] = angle
    memory[2] += c.speed_gain * (speed - memory[2])
    error = target[0] - angle
    if c.cascaded > 0.0:
        wanted = clip(c.outer_rad_s * error + c.forward * target[1], c.speed_limit_rad_s)
        slip = wanted - memory[2]
        asked = c.kd * slip + c.ki * memory[0]
        change = slip
    else:
        asked = c.kp * error + c.kd * (c.forward * target[1] - memory[2]) + c.ki * memory[0]
        change = error
    asked += c.inertia_a_s2_rad * target[2]
    given = clip(asked, c.limit_a)
    if (
        given == asked or change * asked < 0.0
    ):  # the integral stands while the drive is at its limit
        memory[0] += TICK_S * change
    return given


def _build(source: str) -> Callable[..., bool]:
    @numba.njit(cache=True)
    def play(p, c, load, rows, setpoints, levels, jumps, times, out, added):  # type: ignore[no-untyped-def]
        """Play one run; False where it does not stay finite.

        Args: plant, controller, load unit, effects; setpoints (n, 3), levels (n,), jumps (n,);
        times: run's first tick and campaign time there; out (n, LOGGED); added (n, MOST).
        """
        _ = source
        steps = int(p.substeps)
        dt = TICK_S / steps
        current_gain, load_gain = (
            1.0 - math.exp(-dt / p.current_lag),
            1.0 - math.exp(-dt / p.load_lag),
        )
        jaw_inertia = p.finger_inertia + p.load_inertia
        m, s = p.ratio * setpoints[0, 0], setpoints[0, 0]
        q = p.pull * s + p.jaw_zero
        wm, ws, wq = 0.0, 0.0, 0.0
        current, loading = 0.0, 0.0
        control = np.array([0.0, s, 0.0])
        memory, last = np.zeros((MOST, BANK)), np.zeros(MOST)
        first = True
        x = np.zeros(VARIABLES)
        x[Variable.DWELL] = 1.0
        values, signs = np.zeros(MOST), np.zeros(MOST)
        torques, limits, speeds = np.zeros(3), np.zeros(3), np.zeros(3)  # motor, spindle, jaw
        widths = np.array([p.motor_width, p.spindle_width, p.spindle_width])
        slowed = ws
        for tick in range(setpoints.shape[0]):
            count = p.counts_per_turn / (2.0 * math.pi)
            read = (m / p.ratio if c.from_motor > 0.0 else s) * count
            command = _command(c, control, setpoints[tick], math.floor(read + 0.5) / count)
            asked = levels[tick] + load.spring * (q - load.rest)
            x[Variable.RUN_TIME] = (tick - times[0]) * TICK_S
            x[Variable.CAMPAIGN_TIME] = times[1] + x[Variable.RUN_TIME]
            x[Variable.JUMP] = jumps[tick]
            for step in range(steps):
                current += current_gain * (command - current)
                loading += load_gain * (asked - loading)
                x[Variable.MOTOR_ANGLE], x[Variable.MOTOR_SPEED] = m, wm
                x[Variable.SPINDLE_ANGLE], x[Variable.SPINDLE_SPEED] = s, ws
                x[Variable.JAW_ANGLE], x[Variable.JAW_SPEED], x[Variable.CURRENT] = q, wq, current
                x[Variable.MOTOR_WAY], x[Variable.SPINDLE_WAY] = abs(wm), abs(ws)
                twist, twist_rate = m / p.ratio - s, wm / p.ratio - ws
                stretch, stretch_rate = p.pull * s + p.jaw_zero - q, p.pull * ws - wq
                x[Variable.TWIST], x[Variable.STRETCH] = twist, stretch
                if first:
                    for k in range(rows.number):
                        last[k] = x[rows.kinds[k, 4]]
                    first = False
                lever = p.pull
                for k in range(rows.number):
                    place = rows.kinds[k, 0]
                    if place == Place.GEAR:
                        values[k] = _effect(rows, k, x, memory, last, dt)
                        twist -= values[k]
                    elif place == Place.CABLE:
                        values[k] = _effect(rows, k, x, memory, last, dt)
                        stretch -= values[k]
                    elif place == Place.PULLEY:
                        values[k] = _effect(rows, k, x, memory, last, dt)
                        signs[k] = rows.amplitudes[k] * _slope(rows, k, s)
                        stretch += values[k]
                        stretch_rate += signs[k] * ws
                        lever += signs[k]
                T = p.gear_stiffness * twist + p.gear_damping * twist_rate
                C = p.cable_stiffness * stretch + p.cable_damping * stretch_rate
                x[Variable.GEAR_TORQUE], x[Variable.CABLE_TORQUE] = T, C

                constant = p.constant
                torques[:] = 0.0
                limits[0], limits[1], limits[2] = p.motor_friction, p.spindle_friction, 0.0
                speeds[0], speeds[1], speeds[2] = wm, ws, wq
                for k in range(rows.number):
                    place, rubs = rows.kinds[k, 0], rows.kinds[k, 2] != 0
                    if place in (Place.GEAR, Place.CABLE, Place.PULLEY):
                        continue
                    value = _effect(rows, k, x, memory, last, dt)
                    if place == Place.CONSTANT:
                        values[k] = value * p.constant * current
                        constant -= p.constant * value
                        continue
                    body = 0 if place == Place.MOTOR else 1 if place == Place.SPINDLE else 2
                    if rubs:
                        value = max(value, -limits[body])
                        limits[body] += value
                        values[k] = _signed(value, speeds[body], widths[body])
                    else:
                        torques[body] += value
                        values[k] = value

                if step == 0:
                    out[tick, MOTOR_ANGLE], out[tick, SPINDLE_ANGLE] = m, s
                    out[tick, JAW_ANGLE], out[tick, CURRENT] = q, current
                    out[tick, PROXIMAL] = T
                    out[tick, COMMAND], out[tick, LOAD] = command, asked
                    for k in range(rows.number):
                        added[tick, k] = values[k]
                        if rows.kinds[k, 0] == Place.PULLEY:
                            added[tick, MOST + k] = signs[k] * C

                share = dt / p.motor_inertia
                wm += share * (constant * current - p.motor_viscous * wm - T / p.ratio - torques[0])
                wm -= braking(wm, share * limits[0], p.motor_width)
                share = dt / p.spindle_inertia
                before = ws
                ws += share * (T - lever * C - p.spindle_viscous * ws - torques[1])
                ws -= braking(ws, share * limits[1], p.spindle_width)
                slowed += dt / ACCELERATION_LAG_S * ((ws - before) / dt - slowed)
                x[Variable.ACCELERATION] = slowed
                share = dt / jaw_inertia
                before = wq
                wq += share * (C - loading - load.viscous * wq - torques[2])
                wq -= braking(wq, share * limits[2], p.spindle_width)
                if step == 0:
                    turning = p.load_inertia * (wq - before) / dt
                    out[tick, DISTAL] = loading + load.viscous * before + turning
                m += dt * wm
                s += dt * ws
                q += dt * wq
                wear, dwell = abs(ws) / rows.times[1], x[Variable.DWELL]
                x[Variable.DWELL] += dt * ((1.0 - dwell) / rows.times[0] - dwell * wear)
                x[Variable.HEAT] += dt / rows.times[2] * (current**2 - x[Variable.HEAT])
            if not (abs(wm) < 1e5 and abs(ws) < 1e4 and abs(wq) < 1e4):
                return False
        return True

    return play


play = _build(hash_of([reference, hidden, sys.modules[__name__]]))

"""Plain slow twins of the effects' kernels: loops at a millisecond, and convolution sums."""

from __future__ import annotations

import math

import numpy as np

from spa_fo import step_response

MS = 1e-3


def delay(signal, seconds, uneven=0.0):
    """A rise waits longer than a fall by this part, or one value is reached the sooner."""
    late = [round(seconds * (1.0 + side * uneven) / MS) for side in (1.0, -1.0)]
    rises, falls = (np.concatenate([np.zeros(n), signal[: signal.size - n]]) for n in late)
    return np.minimum(rises, falls) if uneven > 0.0 else np.maximum(rises, falls)


def low_pass(signal, time_constant, venting_excess=0.0):
    """Means over each millisecond; a fall may take longer than a rise."""
    out, now = [], 0.0
    for value in signal:
        before = now
        longer = 1.0 + venting_excess if value < now else 1.0
        now += (value - now) * (1.0 - math.exp(-MS / (longer * time_constant)))
        out.append(0.5 * (before + now))
    return np.array(out)


def lag(signal, time_constant_s, second_pole, tail_share, venting_excess=0.0, orifice_share=0.0):
    """One part through two filters, one through one that is four times as late, one an orifice."""
    mean = (1.0 - tail_share) + 4.0 * tail_share
    quick = time_constant_s / mean
    first = low_pass(signal, quick * (1.0 - second_pole), venting_excess)
    first = low_pass(first, quick * second_pole, venting_excess)
    tail = low_pass(signal, 4.0 * quick, venting_excess)
    linear = (1.0 - tail_share) * first + tail_share * tail
    if not orifice_share:
        return linear
    # A rise of 30 kPa takes three times as long as it comes late on the mean.
    filling = 3.0 * time_constant_s * math.sqrt(10.0 / 30.0)
    rooted = orifice(signal, filling, 1.0 + venting_excess)
    return (1.0 - orifice_share) * linear + orifice_share * rooted


def play(signal, width, centre, wait=0.0, vented=0.0, vent_s=0.0, ready=0.0, catch_up=0.0):
    behind, waits, takes = 0.0, False, 0.0
    out, position, told, rises, until, before, rest = [], 0.0, 0.0, False, 0.0, 0.0, 0.0
    first = (1.0 - ready) * wait
    for number, value in enumerate(signal):
        if value != told:
            if (value > told) != rises:
                rises, until, takes, first = not rises, number * MS + first, catch_up * first, wait
                position, behind = position - behind, 0.0
            told = value
        stood, waited = position, waits
        waits = number * MS < until - 1e-9
        if not waits:
            if position < value - width * (1.0 - centre):
                position = value - width * (1.0 - centre)
            if position > value + width * centre:
                position = value + width * centre
        if waited and not waits and takes > 0.0:
            behind = position - stood
        if value <= 0.0 < before:
            rest = (1.0 - vented) * position
        if value <= 0.0 and position > rest:
            position = rest if vent_s == 0.0 else position - (position - rest) * MS / vent_s
        before = value
        out.append(position - behind)
        behind *= math.exp(-MS / max(takes, MS))
    return np.array(out)


def slew(signal, rise, ratio, approach, backpressure=0.0, vent=0.0):
    out, now = [], 0.0
    for value in signal:
        rest = value - now
        rate = rise * max(1.0 - backpressure * now, 0.05)
        if rest < 0.0:
            rate = rise * max(ratio + vent * now, 0.05 * ratio)
        now += MS * rate * math.tanh(rest / approach)
        out.append(now)
    return np.array(out)


def droop(
    signal,
    fraction,
    recovery_s,
    slow_share,
    exponent,
    throttled_share=0.0,
    slower=5.0,
    steady_share=0.0,
    building_s=0.0,
):
    out, before, coming, quick, slow = [], 0.0, 0.0, 0.0, 0.0
    for value in signal:
        asked = 30.0 * (max(value, 0.0) / 30.0) ** exponent
        coming += max(asked - before, 0.0)
        before = asked
        rise = coming * MS / (building_s + MS)
        coming -= rise
        paced = steady_share * fraction * 30.0 + (1.0 - steady_share) * quick
        quick = max(quick - MS * paced / recovery_s, 0.0) + fraction * (1.0 - slow_share) * rise
        slow += fraction * slow_share * rise - MS * slow / (slower * recovery_s)
        given = 1.0 - throttled_share + throttled_share * value / 30.0
        if given * (quick + slow) > max(value, 0.0):
            shrink = max(value, 0.0) / (given * (quick + slow))
            quick, slow = quick * shrink, slow * shrink
        out.append(value - given * (quick + slow))
    return np.array(out)


def leak(signal, rate, makeup, vented_share, renewal, below_share, kept_share, opens):
    out, lost, before = [], 0.0, 0.0
    for value in signal:
        if 0.0 <= value < before:  # a part of what is lost goes out with what is vented
            lost = (1.0 - vented_share) * lost + vented_share * lost * value / before
        if value != before:
            lost -= (1.0 - kept_share) * lost * (1.0 - math.exp(-renewal * abs(value - before)))
        before = value
        above = max(value, 0.0) - lost
        opened = 1.0 + opens * above if above > 0.0 else 1.0
        lost += MS * (rate * opened * above - makeup * lost)
        if lost > max(value, 0.0):  # less than the atmosphere
            lost = max(value, 0.0) + (lost - max(value, 0.0)) * below_share**MS
        out.append(value - lost)
    return np.array(out)


def creep(signal, per_decade, typical_s, decades, step):
    """Ten retarded elements, two a decade from 0.1 s, each after its own exponential."""
    total = np.zeros(signal.size)
    for number in range(10):
        time_constant = 10.0 ** (-1.0 + 0.5 * number)
        away = math.log10(time_constant / typical_s) / decades
        size = 0.5 * per_decade * math.exp(-0.5 * away**2)
        now, own = 0.0, []
        for value in signal:
            now += (size * value - now) * -math.expm1(-step / time_constant)
            own.append(now)
        total += own
    return total


def duhem(angle, width, turn, exponent, begins, lens, span):
    """Lag of the film; what is left of the way falls as r' = -r^n |θ'| / turn, stepped.

    A part of its width is a parabola over the angle, 0 at 0 and at `span`.
    """
    out, state, before = [], begins, 0.0
    for value in angle:
        for part in np.full(200, (value - before) / 200.0):
            way = math.copysign(1.0, part)
            left = 0.5 * abs(way - state)
            left = max(left - left**exponent * abs(part) / turn, 0.0)
            state = way * (1.0 - 2.0 * left) if part else state
        before = value
        wide = 1.0 - lens
        lag = state * wide - begins * wide
        if 0.0 < value < span:
            lag += state * lens * (1.0 - (2.0 * value / span - 1.0) ** 2)
        out.append(value - 0.5 * width * lag)
    return np.array(out)


def curve(angle, knots, errors):
    """Natural cubic spline as a curve's error, as steep beyond its ends as at them."""
    n, h, rise = len(knots), np.diff(knots), np.diff(errors) / np.diff(knots)
    matrix, right = np.eye(n), np.zeros(n)  # of the second derivatives, 0 at the ends
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]
        right[i] = 6.0 * (rise[i] - rise[i - 1])
    bent = np.linalg.solve(matrix, right)

    def error(x):
        if x < knots[0]:
            return errors[0] + (rise[0] - h[0] * bent[1] / 6.0) * (x - knots[0])
        if x > knots[-1]:
            return errors[-1] + (rise[-1] + h[-1] * bent[-2] / 6.0) * (x - knots[-1])
        i = min(int(np.searchsorted(knots, x, side="right")) - 1, n - 2)
        a, b = (knots[i + 1] - x) / h[i], (x - knots[i]) / h[i]
        straight = a * errors[i] + b * errors[i + 1]
        return straight + ((a**3 - a) * bent[i] + (b**3 - b) * bent[i + 1]) * h[i] ** 2 / 6.0

    return angle + np.array([error(x) for x in angle])


class Spring:
    """A moment (rad) that depends on the angle alone."""

    def __init__(self, law):
        self.law = law

    def moment(self, before, after, _):
        return self.law(0.5 * (before + after))

    def accept(self, before, after, _):
        return 0.0


class Wall:
    """A moment (rad) that is as stiff as what is made of the angle and of the load tells."""

    def __init__(self, stiffness, by_load):
        self.stiffness, self.by_load = stiffness, by_load

    def moment(self, before, after, held):
        angle = 0.5 * (before + after)
        return self.stiffness((1.0 - self.by_load) * angle + self.by_load * held) * angle

    def accept(self, before, after, _):
        return 0.0


class Both:
    """Two moments (rad) of the angle and the load alone."""

    def __init__(self, one, other):
        self.parts = one, other

    def moment(self, *felt):
        return sum(part.moment(*felt) for part in self.parts)

    def accept(self, *felt):
        return 0.0


class Friction:
    """Four elastic stops in parallel, one after another sliding: Prandtl and Ishlinskii."""

    def __init__(self, size, turn, tail, outside=0.0, begins=0.0):
        self.size, self.outside, self.begins = size, outside, begins
        self.radius = turn * (np.arange(1, 5) / 4.0) ** tail
        self.state = np.full(4, begins)

    def _moved(self, distance):
        return np.clip(self.state + distance / self.radius, -1.0, 1.0)

    def moment(self, before, after, _):
        inside = (1.0 - self.outside) * self.size
        return inside * (float(np.mean(self._moved(0.5 * (after - before)))) - self.begins)

    def accept(self, before, after, _):
        self.state = self._moved(after - before)
        return self.outside * self.size * (float(np.mean(self.state)) - self.begins)


class Bundle:
    """Levels of strain that stiffen until they have been passed downwards, or passed for long."""

    def __init__(
        self, fraction, loadings, dwell, share, rejoins, span, by_load, blend, by_peak, step
    ):
        self.fraction, self.loadings, self.dwell = fraction, loadings, dwell
        self.share, self.rejoins, self.by_load, self.blend = share, rejoins, by_load, blend
        self.first = span * np.arange(24) / 24.0
        self.width = span / 24.0
        self.step = step
        self.virgin = np.ones(24)
        self.strain = 0.0
        self.by_peak, self.peak, self.fresh = by_peak, 0.0, self.virgin

    def _strain(self, angle, held):
        return (1.0 - self.by_load) * angle + self.by_load * held

    def _passed(self, strain):
        beyond = min(max(strain, 0.0), 0.5 * self.blend)
        return np.clip((strain + beyond - self.first) / self.blend, 0.0, 1.0)

    def moment(self, before, after, held):
        middle = self._strain(0.5 * (before + after), held)
        chains = float(self.virgin @ np.clip(middle - self.first, 0.0, self.width))
        here = np.interp(middle, self.first, self.virgin)
        there = np.interp(max(middle, self.peak), self.first, self.fresh)
        here = (1.0 - self.by_peak) * here + self.by_peak * there
        ahead = here * max(middle, 0.0)
        own = (1.0 - self.rejoins) * chains + self.rejoins * ahead
        whole = float(np.mean(self.virgin)) * middle
        return self.fraction * (self.share * own + (1.0 - self.share) * whole)

    def accept(self, before, after, held):
        was, self.strain = self._passed(self.strain), self._strain(after, held)
        self.peak = max(self.peak, self.strain)
        beyond = self._passed(self.strain)
        self.virgin = self.virgin * np.exp(
            -np.maximum(was - beyond, 0.0) / self.loadings - beyond * self.step / self.dwell
        )
        return 0.0


def loop(load, step, x, law, missed=None):
    """Angle (rad) at the end of equal steps, G in a loop with a further moment.

    A law is told the angle before and after a step, and the one at which the load would be held.

    What is missed of the angle is felt by the moment and added to the angle. The fractional memory
    is a sum over all earlier steps; the moment is iterated to its fixed point. What a law accepts
    may leave a part of the angle that is lost at once.
    """
    static = x[4] / x[3]
    pulse = np.diff(step_response(step * np.arange(load.size + 1), *x))
    out, v, lost = [0.0], np.zeros(load.size), np.zeros(load.size)
    missed = np.concatenate([[0.0], np.zeros(load.size) if missed is None else missed])
    for i in range(load.size):
        free = float(pulse[i:0:-1] @ v[:i])
        angle = out[-1]
        for _ in range(100):
            felt = out[-1] + missed[i], angle + missed[i + 1]
            v[i] = load[i] - law.moment(*felt, static * load[i]) / static
            before, angle = angle, free + pulse[0] * v[i]
            if abs(angle - before) < 1e-12:
                break
        lost[i] = law.accept(out[-1] + missed[i], angle + missed[i + 1], static * load[i])
        out.append(angle)
    return np.array(out[1:]) + missed[1:] - lost


def orifice(signal, filling, ratio):
    """In steps of 10 microseconds; means over each millisecond."""
    out, now, parts = [], 0.0, 100
    for value in signal:
        total = 0.0
        for _ in range(parts):
            lack = value - now
            seconds = filling if lack > 0.0 else filling * ratio
            rate = 2.0 * math.sqrt(10.0 * abs(lack)) / seconds
            now += math.copysign(min(rate * MS / parts, abs(lack)), lack)
            total += now
        out.append(total / parts)
    return np.array(out)


def ringing(signal, fraction, period, damping):
    """Signal and the swing of a second-order system that its rate pushes, in steps of 0.1 ms."""
    rate, parts = 2.0 * math.pi / period, 10
    top = _swing(np.ones(round(period / MS)), rate, damping, parts).max()
    return signal + fraction * _swing(signal, rate, damping, parts) / top


def _swing(signal, rate, damping, parts):
    out, place, speed, before = [], 0.0, 0.0, 0.0
    for value in signal:
        speed += rate * (value - before)
        before = value
        total = 0.0
        for _ in range(parts):
            before_place = place
            speed -= MS / parts * (2.0 * damping * rate * speed + rate * rate * place)
            place += MS / parts * speed
            total += 0.5 * (before_place + place)
        out.append(total / parts)
    return np.array(out)


def oscillator(signal, rate, damping):
    """In steps of 0.1 ms; means over each millisecond."""
    out, place, speed, parts = [], 0.0, 0.0, 10
    for value in signal:
        total = 0.0
        for _ in range(parts):
            speed += MS / parts * (rate * rate * (value - place) - 2.0 * damping * rate * speed)
            place += MS / parts * speed
            total += place
        out.append(total / parts)
    return np.array(out)


def trailing(signal, seconds):
    """Means over each millisecond of a lag with a time constant at each."""
    out, now = [], 0.0
    for value, time in zip(signal, seconds, strict=True):
        keep = math.exp(-MS / time) if time > 0.0 else 0.0
        before = now if time > 0.0 else value
        now = value + (now - value) * keep
        out.append(0.5 * (before + now))
    return np.array(out)


def ratchet(target, building, recovery):
    """Means over each millisecond."""
    out, now = [], 0.0
    for value in target:
        before = now
        now += MS * (max(value - now, 0.0) / building - now / recovery)
        out.append(0.5 * (before + now))
    return np.array(out)


def row_reading(cells, t_s, cell_s=0.02):
    """What rows of a trial read of a signal on cells: the cell that is over, and its slope."""
    over = np.clip(np.floor(t_s / cell_s + 1e-6).astype(int) - 1, 0, cells.size - 1)
    rise = cells[over] - cells[np.maximum(over - 1, 0)]
    goes_on = cells[np.minimum(over + 1, cells.size - 1)] - cells[over]
    slope = np.where(rise * goes_on > 0.0, np.minimum(np.abs(rise), np.abs(goes_on)), 0.0)
    return cells[over] + np.sign(rise) * slope * (t_s / cell_s - over - 0.5)

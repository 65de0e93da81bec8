#include "sampler.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "clock.h"
#include "config.h"
#include "drive.h"

#define RECORDS 16U  // samples that wait to be written; a power of two
#define LEAD_TICKS 4000U  // from the start to the first sample: 2 ms
#define READINGS 3U       // a sample's count is their median

typedef struct {
    uint32_t seq;
    uint16_t centi_kpa;
    uint16_t duty;
} setpoint_t;

static volatile mode_t mode;
static volatile bool running;  // samples are being taken
static volatile bool converting;
static volatile uint32_t next_seq;
static volatile uint32_t heard_us;
static volatile trip_t trip_to_tell;
static volatile bool tripped;

static uint16_t rate;
static uint32_t ticks_left;   // to the next sample, beyond the compare register
static uint16_t remainder;    // of a period's ticks, in parts of the rate
static volatile int16_t held;
static uint8_t over;

static setpoint_t queue[QUEUE];
static volatile uint8_t queue_head, queue_size;

static sample_t records[RECORDS];
static volatile uint8_t record_head, record_tail;
static sample_t current;
static uint8_t conversion;
static uint16_t readings[READINGS];

void sampler_start(void) {
    DIDR0 = _BV(PRESSURE_CHANNEL) | _BV(FLEX_CHANNEL);  // digital inputs would draw current
    ADMUX = _BV(REFS0) | PRESSURE_CHANNEL;
    ADCSRA = _BV(ADEN) | _BV(ADSC) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);  // 125 kHz
    // The first conversion takes twice as long as all others: too long at 1 kHz.
    while (ADCSRA & _BV(ADSC)) continue;
    ADCSRA |= _BV(ADIF) | _BV(ADIE);
}

mode_t sampler_mode(void) { return mode; }

// --- timing ------------------------------------------------------------------------------------

static uint32_t period_ticks(void) {
    uint32_t ticks = TICKS_PER_S / rate;
    remainder += TICKS_PER_S % rate;
    if (remainder >= rate) {
        remainder -= rate;
        ticks++;
    }
    return ticks;
}

// Moves the compare register on; a wait longer than the timer's round takes several steps.
static void step_on(void) {
    uint16_t step = ticks_left > 60000UL ? 30000U : (uint16_t)ticks_left;
    ticks_left -= step;
    OCR1A += step;
}

static void start_ticking(void) {
    remainder = 0;
    ticks_left = 0;
    OCR1A = TCNT1 + LEAD_TICKS;
    TIFR1 = _BV(OCF1A);
    TIMSK1 |= _BV(OCIE1A);
    running = true;
}

static void stop_ticking(void) {
    TIMSK1 &= ~_BV(OCIE1A);
    running = false;
}

// --- one sample --------------------------------------------------------------------------------

// Where several are due, the last one counts.
static void take_due_setpoints(void) {
    setpoint_t *due = 0;
    while (queue_size && queue[queue_head].seq <= next_seq) {
        due = &queue[queue_head];
        queue_head = (queue_head + 1) % QUEUE;
        queue_size--;
    }
    if (!due) return;
    held = due->centi_kpa;
    drive_set(due->duty);
}

ISR(TIMER1_COMPA_vect) {
    if (ticks_left) {
        step_on();
        return;
    }
    uint32_t now = clock_us_atomic();
    ticks_left = period_ticks();
    step_on();
    if (mode == TRIAL) take_due_setpoints();
    uint32_t seq = next_seq++;
    if (converting) return;  // not at any rate that is allowed; seq shows it
    converting = true;
    current.seq = seq;
    current.t_us = now;
    current.held = held;
    conversion = 0;
    ADMUX = _BV(REFS0) | PRESSURE_CHANNEL;
    ADCSRA |= _BV(ADSC);
}

static uint16_t median(void) {
    uint16_t a = readings[0], b = readings[1], c = readings[2];
    uint16_t low = a < b ? a : b, high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

static void vent_now(void) {
    queue_size = 0;
    if (mode == TRIAL) held = 0;
    drive_set(0);
}

static void trip(trip_t why) {
    vent_now();
    tripped = true;
    trip_to_tell = why;
}

static void finish_sample(void) {
    uint8_t next = (record_head + 1) % RECORDS;
    converting = false;
    // A full buffer loses the sample, never the time of the next one.
    if (next != record_tail) {
        records[record_head] = current;
        record_head = next;
    }
    over = current.pressure > OVER_COUNTS ? over + 1 : 0;
    if (over >= OVER_SAMPLES && mode == TRIAL && !tripped) trip(TRIP_PRESSURE);
}

// Each channel is converted four times. The first conversion after a change of channel still holds
// some of the other one's charge, and a valve may just have switched: it is thrown away. Of the
// other three the median is kept, so that a single spike leaves no trace.
ISR(ADC_vect) {
    uint16_t count = ADC;
    uint8_t of_channel = conversion % (READINGS + 1);
    bool first_channel = conversion <= READINGS;
    conversion++;
    if (of_channel) readings[of_channel - 1] = count;
    if (of_channel == READINGS) {
        if (!first_channel) {
            current.flex = median();
            finish_sample();
            return;
        }
        current.pressure = median();
        ADMUX = _BV(REFS0) | FLEX_CHANNEL;
    }
    ADCSRA |= _BV(ADSC);
}

// --- what the protocol asks --------------------------------------------------------------------

void sampler_begin(mode_t new_mode, uint16_t rate_hz) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        next_seq = 0;
        held = 0;
        over = 0;
        queue_size = 0;
        tripped = false;
        trip_to_tell = NO_TRIP;
        rate = rate_hz;
        mode = new_mode;
        if (new_mode == TRIAL) start_ticking();
    }
}

uint32_t sampler_stop(void) {
    uint32_t taken;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        stop_ticking();
        vent_now();
        taken = mode == IDLE ? 0 : next_seq;
        mode = IDLE;
    }
    while (converting) continue;  // less than a millisecond
    return taken;
}

void sampler_hold_angle(int16_t deci_deg) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        held = deci_deg;
        if (!running) start_ticking();
    }
}

void sampler_pause(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { stop_ticking(); }
}

static void enqueue(uint16_t centi_kpa, uint16_t duty, uint32_t seq) {
    setpoint_t *last = &queue[(queue_head + queue_size) % QUEUE];
    last->seq = seq;
    last->centi_kpa = centi_kpa;
    last->duty = duty;
    queue_size++;
}

set_t sampler_set_at(uint16_t centi_kpa, uint32_t seq) {
    uint16_t duty = drive_duty(centi_kpa);
    set_t answer = SET_OK;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        if (tripped) {
            answer = SET_TRIPPED;
        } else if (queue_size && seq < queue[(queue_head + queue_size - 1) % QUEUE].seq) {
            answer = SET_BACKWARD;
        } else if (queue_size == QUEUE) {
            answer = SET_FULL;
        } else {
            enqueue(centi_kpa, duty, seq);
        }
    }
    return answer;
}

set_t sampler_set_now(uint16_t centi_kpa) {
    uint16_t duty = drive_duty(centi_kpa);
    set_t answer = SET_OK;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        if (tripped) {
            answer = SET_TRIPPED;
        } else {
            queue_size = 0;
            enqueue(centi_kpa, duty, 0);
        }
    }
    return answer;
}

void sampler_vent(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        queue_size = 0;
        if (mode == TRIAL) enqueue(0, 0, 0);
    }
}

void sampler_heard(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { heard_us = clock_us_atomic(); }
}

void sampler_watch(void) {
    if (mode != TRIAL || tripped) return;
    if (held == 0 && queue_size == 0) return;
    if (clock_us_atomic() - heard_us > WATCHDOG_MS * 1000UL) trip(TRIP_WATCHDOG);
}

bool sampler_has_sample(void) { return record_head != record_tail; }

sample_t sampler_take(void) {
    sample_t sample;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        sample = records[record_tail];
        record_tail = (record_tail + 1) % RECORDS;
    }
    return sample;
}

bool sampler_has_trip(void) { return trip_to_tell != NO_TRIP; }

trip_t sampler_take_trip(void) {
    trip_t why;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        why = trip_to_tell;
        trip_to_tell = NO_TRIP;
    }
    return why;
}

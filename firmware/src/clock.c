#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "sampler.h"

// Not static: the simulation sets it, to see the clock wrap without waiting for an hour.
volatile uint32_t clock_overflows;  // of 32768 us each

void clock_start(void) {
    TCCR1A = 0;
    TCCR1B = _BV(CS11);  // 16 MHz / 8
    TIMSK1 = _BV(TOIE1);
}

ISR(TIMER1_OVF_vect) {
    clock_overflows++;
    sampler_watch();
}

uint32_t clock_us_atomic(void) {
    uint16_t ticks = TCNT1;
    uint32_t overflows = clock_overflows;
    // An overflow whose interrupt has not run yet; a high count was read before it.
    if ((TIFR1 & _BV(TOV1)) && ticks < 0x8000) overflows++;
    return (overflows << 15) + (ticks >> 1);
}

uint32_t clock_us(void) {
    uint32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = clock_us_atomic(); }
    return now;
}

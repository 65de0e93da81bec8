// Microseconds since the reset, 32 bits: they wrap after 71.6 minutes.
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

#define TICKS_PER_S 2000000UL  // of timer 1, which also times the samples

void clock_start(void);

// With interrupts off, as within one.
uint32_t clock_us_atomic(void);

uint32_t clock_us(void);

#endif

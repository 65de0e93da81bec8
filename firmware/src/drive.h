// The pneumatics: a regulator that follows an analog set-point, and a vent valve open without power.
#ifndef DRIVE_H
#define DRIVE_H

#include <stdint.h>

#define DRIVE_TOP 1023U  // set-point steps

void drive_start(void);

// The set-point that makes this gauge pressure, in hundredths of a kPa.
uint16_t drive_duty(uint16_t centi_kpa);

// Sets the set-point; 0 also opens the vent valve. Callable from interrupts.
void drive_set(uint16_t duty);

#endif

#include "drive.h"

#include <avr/io.h>

#include "config.h"

#define SETPOINT_PIN PH3  // Arduino's pin 6, timer 4's output A
#define VALVE_PIN PH4     // Arduino's pin 7, high: closed

void drive_start(void) {
    PORTH &= ~(_BV(SETPOINT_PIN) | _BV(VALVE_PIN));
    DDRH |= _BV(SETPOINT_PIN) | _BV(VALVE_PIN);
    ICR4 = DRIVE_TOP;
    OCR4A = 0;
    TCCR4B = _BV(WGM43) | _BV(WGM42) | _BV(CS40);  // fast PWM up to ICR4: 15.6 kHz
    TCCR4A = _BV(WGM41);                           // the pin stays with PORTH: low
}

uint16_t drive_duty(uint16_t centi_kpa) {
    return ((uint32_t)centi_kpa * DRIVE_TOP + 50UL * REGULATOR_KPA) / (100UL * REGULATOR_KPA);
}

void drive_set(uint16_t duty) {
    OCR4A = duty;
    if (duty == 0) {
        // Fast PWM at 0 still makes a spike a period: the pin is disconnected instead.
        TCCR4A = _BV(WGM41);
        PORTH &= ~_BV(VALVE_PIN);
    } else {
        TCCR4A = _BV(WGM41) | _BV(COM4A1);
        PORTH |= _BV(VALVE_PIN);
    }
}

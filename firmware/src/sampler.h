// Samples at a fixed rate, by interrupts alone: whatever the rest of the program does, they come in
// time, set-points take effect at theirs, and silence or pressure vents.
#ifndef SAMPLER_H
#define SAMPLER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint32_t seq;
    uint32_t t_us;
    int16_t held;  // commanded pressure (hundredths of a kPa), or the fixture's angle (tenths)
    uint16_t pressure;
    uint16_t flex;
} sample_t;

typedef enum { IDLE, TRIAL, CALIBRATION } mode_t;
typedef enum { NO_TRIP, TRIP_WATCHDOG, TRIP_PRESSURE } trip_t;

void sampler_start(void);

mode_t sampler_mode(void);

// Begins a trial or a calibration with sample 0; a calibration takes none before its first angle.
void sampler_begin(mode_t mode, uint16_t rate_hz);

// Vents and becomes idle; returns the number of samples taken, the last of them complete.
uint32_t sampler_stop(void);

void sampler_hold_angle(int16_t deci_deg);
void sampler_pause(void);

typedef enum { SET_OK, SET_TRIPPED, SET_BACKWARD, SET_FULL } set_t;

// Commands from sample `seq` on.
set_t sampler_set_at(uint16_t centi_kpa, uint32_t seq);

// Commands from the next sample on, and forgets what waits.
set_t sampler_set_now(uint16_t centi_kpa);

// Commands 0 from the next sample on, and forgets what waits.
void sampler_vent(void);

// A whole, undamaged line came from the host.
void sampler_heard(void);

bool sampler_has_sample(void);
sample_t sampler_take(void);

// Why it vented, once.
trip_t sampler_take_trip(void);
bool sampler_has_trip(void);

// For the clock's interrupt, every 32.8 ms.
void sampler_watch(void);

#endif

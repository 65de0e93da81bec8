// What depends on the wiring and on the actuator. Everything else is docs/board_protocol.md.
#ifndef CONFIG_H
#define CONFIG_H

#ifndef BAUD
#define BAUD 500000UL  // 16 MHz divides down to it exactly
#endif

// Analog inputs, Arduino's names A0 and A1 (A0 to A7 will do).
#define PRESSURE_CHANNEL 0
#define FLEX_CHANNEL 1
#define VREF_MV 5000UL  // AVcc: sensors and converter share it

// The pressure sensor is ratiometric: 0.5 V at 0 kPa, 4.5 V at 551.6 kPa.
#define SENSOR_ZERO_MV 500UL
#define SENSOR_SPAN_MV 4000UL
#define SENSOR_SPAN_DECIKPA 5516UL

// The regulator makes this pressure of a full-scale set-point (5 V behind the filter on pin 6).
#define REGULATOR_KPA 100UL

#define LIMIT_KPA 100UL      // set-points above are refused
#define WATCHDOG_MS 500UL    // of silence, then the actuator is vented
#define DEFAULT_RATE_HZ 50U
#define MAX_RATE_HZ 1000U
#define QUEUE 32U            // set-points that may wait

// A measured pressure above 1.2 times the limit, this often running, vents.
#define OVER_SAMPLES 3U
#define SENSOR_MV(decikpa) (SENSOR_ZERO_MV + SENSOR_SPAN_MV * (decikpa) / SENSOR_SPAN_DECIKPA)
#define OVER_COUNTS ((uint16_t)(SENSOR_MV(12UL * LIMIT_KPA) * 1023UL / VREF_MV))

#endif

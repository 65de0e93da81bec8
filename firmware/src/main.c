// The rig's board: samples a pressure and a flex sensor, commands a pressure, vents when in doubt.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "clock.h"
#include "drive.h"
#include "protocol.h"
#include "sampler.h"
#include "uart.h"

int main(void) {
    drive_start();  // first of all: vented
    clock_start();
    uart_start();
    sampler_start();
    sei();
    protocol_greet();
    set_sleep_mode(SLEEP_MODE_IDLE);
    for (;;) {
        protocol_turn();
        // Between the look and the sleep no interrupt may bring work: sei takes effect one
        // instruction late.
        cli();
        if (protocol_has_work()) {
            sei();
        } else {
            sleep_enable();
            sei();
            sleep_cpu();
            sleep_disable();
        }
    }
}

// The serial port: ring buffers filled and emptied by interrupts, so that nobody waits for a byte.
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

bool uart_has_input(void);

// Takes the next byte that came in; there must be one.
uint8_t uart_read(void);

// Queues all of it or, where there is no room, nothing.
bool uart_write(const char *text, uint8_t length);

#endif

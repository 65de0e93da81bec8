// What host and board say to one another: docs/board_protocol.md.
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdbool.h>

// Says what is said after a reset.
void protocol_greet(void);

// Hears what came in, writes the samples that wait, and tells why it vented.
void protocol_turn(void);

// Whether a turn would do something.
bool protocol_has_work(void);

#endif

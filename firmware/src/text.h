// Numbers to text and back, without the library's long division (at 1 kHz it would not keep up).
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stdint.h>

// Each writes at `to` and returns the end of what it wrote.
char *text_put(char *to, const char *text);
char *text_put_whole(char *to, uint32_t value);
// `value` / 10^places, with that many places.
char *text_put_decimal(char *to, int16_t value, uint8_t places);
char *text_put_hex(char *to, uint8_t value);

// One to `digits` digits; false if it is anything else.
bool text_whole(const char *text, uint8_t digits, uint32_t *value);
// One to `digits` digits, perhaps a point and one to `places` more; `value` is scaled by 10^places.
bool text_decimal(const char *text, uint8_t digits, uint8_t places, uint32_t *value);

#endif

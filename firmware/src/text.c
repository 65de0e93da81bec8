#include "text.h"

#include <avr/pgmspace.h>

static const uint32_t POWERS[] PROGMEM = {1000000000, 100000000, 10000000, 1000000, 100000,
                                          10000,      1000,      100,      10};

char *text_put(char *to, const char *text) {
    while (*text) *to++ = *text++;
    return to;
}

char *text_put_whole(char *to, uint32_t value) {
    bool begun = false;
    for (uint8_t i = 0; i < sizeof POWERS / sizeof *POWERS; i++) {
        uint32_t power = pgm_read_dword(&POWERS[i]);
        char digit = '0';
        while (value >= power) {
            value -= power;
            digit++;
        }
        begun = begun || digit != '0';
        if (begun) *to++ = digit;
    }
    *to++ = '0' + (uint8_t)value;
    return to;
}

char *text_put_decimal(char *to, int16_t value, uint8_t places) {
    if (value < 0) {
        *to++ = '-';
        value = -value;
    }
    uint16_t scale = places == 2 ? 100 : 10;
    uint16_t part = (uint16_t)value % scale;
    to = text_put_whole(to, (uint16_t)value / scale);
    *to++ = '.';
    if (places == 2) *to++ = '0' + part / 10;
    *to++ = '0' + part % 10;
    return to;
}

char *text_put_hex(char *to, uint8_t value) {
    static const char DIGITS[] PROGMEM = "0123456789ABCDEF";
    *to++ = pgm_read_byte(&DIGITS[value >> 4]);
    *to++ = pgm_read_byte(&DIGITS[value & 15]);
    return to;
}

// Reads at most `most` digits onto `value`; returns how many.
static uint8_t digits_onto(const char **text, uint8_t most, uint32_t *value) {
    uint8_t count = 0;
    while (count < most && **text >= '0' && **text <= '9') {
        *value = 10 * *value + (uint8_t)(*(*text)++ - '0');
        count++;
    }
    return count;
}

bool text_whole(const char *text, uint8_t digits, uint32_t *value) {
    *value = 0;
    return digits_onto(&text, digits, value) && !*text;
}

bool text_decimal(const char *text, uint8_t digits, uint8_t places, uint32_t *value) {
    *value = 0;
    if (!digits_onto(&text, digits, value)) return false;
    uint8_t behind = 0;
    if (*text == '.') {
        text++;
        behind = digits_onto(&text, places, value);
        if (!behind) return false;
    }
    while (behind++ < places) *value *= 10;
    return !*text;
}

#include "protocol.h"

#include <stdint.h>
#include <string.h>

#include "config.h"
#include "sampler.h"
#include "text.h"
#include "uart.h"

#define LINE 40     // of the host, without its end
#define COMMENT 80  // of the board, without its end
#define DATA 48     // the longest data line has 43 bytes
#define WORDS 3

#define STRING_OF(x) #x
#define STRING(x) STRING_OF(x)
#define NUMBER(macro) STRING(macro)

static const char UNKNOWN[] = "unknown";
static const char STATE[] = "state";
static const char ARGUMENT[] = "argument";
static const char LIMIT[] = "limit";
static const char FULL[] = "full";

static char line[LINE + 2];  // and its CR, or the 0 behind it
static uint8_t length;
static bool too_long;
static mode_t columns;  // which banner was sent last

// --- to the host -------------------------------------------------------------------------------

// Comments wait for room: sampling goes on meanwhile, and the port empties itself.
static void say(char *text, char *end) {
    *end++ = '\n';
    while (!uart_write(text, end - text)) continue;
}

static void comment(const char *first, const char *second) {
    char text[COMMENT + 1];
    char *end = text_put(text, "# ");
    end = text_put(end, first);
    for (; *second && end < text + COMMENT; second++) {
        *end++ = *second >= ' ' && *second <= '~' ? *second : '?';
    }
    say(text, end);
}

static void banner(mode_t mode, uint16_t rate_hz) {
    char text[120];
    char *end = text_put(text, "# spa-rig 1 board=mega2560 adc_bits=10 vref_mv=");
    end = text_put_whole(end, VREF_MV);
    end = text_put(end, " rate_hz=");
    end = text_put_whole(end, rate_hz);
    end = text_put(end, " columns=seq,t_us,");
    end = text_put(end, mode == CALIBRATION ? "angle_deg,flex_adc" : "cmd_kpa,p_adc,flex_adc");
    columns = mode;
    say(text, end);
}

void protocol_greet(void) {
    char text[COMMENT + 1];
    banner(TRIAL, DEFAULT_RATE_HZ);
    char *end = text_put(text, "# ready limit_kpa=");
    end = text_put_whole(end, LIMIT_KPA);
    end = text_put(end, " watchdog_ms=");
    end = text_put_whole(end, WATCHDOG_MS);
    end = text_put(end, " max_rate_hz=");
    end = text_put_whole(end, MAX_RATE_HZ);
    end = text_put(end, " queue=");
    end = text_put_whole(end, QUEUE);
    say(text, end);
}

// A line for which there is no room is left out as a whole; seq shows the loss.
static void write_sample(sample_t sample) {
    char text[DATA];
    char *end = text_put_whole(text, sample.seq);
    *end++ = ',';
    end = text_put_whole(end, sample.t_us);
    *end++ = ',';
    if (columns == CALIBRATION) {
        end = text_put_decimal(end, sample.held, 1);
    } else {
        end = text_put_decimal(end, sample.held, 2);
        *end++ = ',';
        end = text_put_whole(end, sample.pressure);
    }
    *end++ = ',';
    end = text_put_whole(end, sample.flex);
    uint8_t checksum = 0;
    for (char *c = text; c < end; c++) checksum ^= *c;
    *end++ = '*';
    end = text_put_hex(end, checksum);
    *end++ = '\n';
    uart_write(text, end - text);
}

static void write_samples(void) {
    while (sampler_has_sample()) write_sample(sampler_take());
}

static void tell_trip(void) {
    trip_t why = sampler_take_trip();
    if (why == NO_TRIP) return;
    write_samples();
    comment("trip ", why == TRIP_WATCHDOG ? "watchdog" : "pressure");
}

// --- from the host -----------------------------------------------------------------------------

typedef const char *refusal_t;  // why a command cannot be obeyed, or 0

static refusal_t halt(void) {
    char text[COMMENT + 1];
    uint32_t samples = sampler_stop();
    write_samples();
    tell_trip();
    char *end = text_put_whole(text_put(text, "# stopped samples="), samples);
    say(text, end);
    return 0;
}

static refusal_t hello(void) {
    sampler_stop();
    write_samples();
    tell_trip();
    protocol_greet();
    return 0;
}

static refusal_t begin(mode_t mode, const char *rate_text) {
    uint32_t rate = DEFAULT_RATE_HZ;
    if (sampler_mode() != IDLE) return STATE;
    if (rate_text && !text_whole(rate_text, 9, &rate)) return ARGUMENT;
    if (rate < 1 || rate > MAX_RATE_HZ) return ARGUMENT;
    banner(mode, rate);
    sampler_begin(mode, rate);
    return 0;
}

static refusal_t set(const char *kpa_text, const char *seq_text) {
    uint32_t centi_kpa, seq = 0;
    if (sampler_mode() != TRIAL) return STATE;
    if (!text_decimal(kpa_text, 6, 2, &centi_kpa)) return ARGUMENT;
    if (seq_text && !text_whole(seq_text, 9, &seq)) return ARGUMENT;
    if (centi_kpa > 100UL * LIMIT_KPA) return LIMIT;
    switch (seq_text ? sampler_set_at(centi_kpa, seq) : sampler_set_now(centi_kpa)) {
        case SET_TRIPPED: return STATE;
        case SET_BACKWARD: return ARGUMENT;
        case SET_FULL: return FULL;
        default: return 0;
    }
}

static refusal_t angle(const char *text) {
    uint32_t deci_deg;
    bool negative = *text == '-';
    if (sampler_mode() != CALIBRATION) return STATE;
    if (!text_decimal(text + negative, 3, 1, &deci_deg) || deci_deg > 3600) return ARGUMENT;
    sampler_hold_angle(negative ? -(int16_t)deci_deg : (int16_t)deci_deg);
    return 0;
}

static refusal_t pause(void) {
    if (sampler_mode() != CALIBRATION) return STATE;
    sampler_pause();
    return 0;
}

static refusal_t vent(void) {
    sampler_vent();
    return 0;
}

// Cuts `text` at its blanks; returns the number of words, or WORDS + 1 if there are more.
static uint8_t split(char *text, char *words[WORDS]) {
    uint8_t count = 1;
    words[0] = text;
    while ((text = strchr(text, ' '))) {
        if (count == WORDS) return WORDS + 1;
        *text++ = 0;
        words[count++] = text;
    }
    return count;
}

static refusal_t obey(char *text) {
    static const struct {
        const char *word;
        uint8_t fewest, most;  // words
    } COMMANDS[] = {{"ping", 1, 1}, {"hello", 1, 1}, {"vent", 1, 1},  {"stop", 1, 1}, {"run", 1, 2},
                    {"cal", 1, 2},  {"set", 2, 3},   {"angle", 2, 2}, {"pause", 1, 1}};
    enum { PING, HELLO, VENT, STOP, RUN, CAL, SET, ANGLE, PAUSE, COUNT };
    char *words[WORDS] = {0};
    uint8_t count = split(text, words);
    uint8_t which = 0;
    while (which < COUNT && strcmp(words[0], COMMANDS[which].word)) which++;
    if (which == COUNT) return UNKNOWN;
    if (count < COMMANDS[which].fewest || count > COMMANDS[which].most) return ARGUMENT;
    switch (which) {
        case HELLO: return hello();
        case VENT: return vent();
        case STOP: return halt();
        case RUN: return begin(TRIAL, words[1]);
        case CAL: return begin(CALIBRATION, words[1]);
        case SET: return set(words[1], words[2]);
        case ANGLE: return angle(words[1]);
        case PAUSE: return pause();
        default: return 0;
    }
}

static int8_t hex(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    return digit >= 'A' && digit <= 'F' ? digit - 'A' + 10 : -1;
}

// Cuts the checksum off; false if it is missing or wrong.
static bool check(void) {
    if (length < 3 || line[length - 3] != '*') return false;
    int8_t high = hex(line[length - 2]), low = hex(line[length - 1]);
    if (high < 0 || low < 0) return false;
    uint8_t checksum = 0;
    length -= 3;
    for (uint8_t i = 0; i < length; i++) {
        checksum ^= line[i];
        if (!line[i]) line[i] = '?';  // it would end the text
    }
    line[length] = 0;
    return checksum == (uint8_t)(high << 4 | low);
}

static void hear_line(void) {
    if (!too_long && length == 4 && !memcmp(line, "vent", 4)) {
        vent();
        return;
    }
    if (too_long || !check()) {
        comment("damaged command", "");
        return;
    }
    sampler_heard();
    char said[LINE + 1];
    memcpy(said, line, length + 1);  // obeying cuts it up
    refusal_t why = obey(line);
    if (why) {
        char text[COMMENT];
        char *end = text_put(text_put(text, "refused "), why);
        *text_put(end, ": ") = 0;
        comment(text, said);
    }
}

static void hear(uint8_t byte) {
    if (byte == '\n') {
        if (!too_long && length && line[length - 1] == '\r') length--;
        if (length > LINE) too_long = true;
        hear_line();
        length = 0;
        too_long = false;
    } else if (length < sizeof line) {
        line[length++] = byte;
    } else {
        too_long = true;
    }
}

void protocol_turn(void) {
    write_samples();
    tell_trip();
    if (uart_has_input()) hear(uart_read());
}

bool protocol_has_work(void) {
    return uart_has_input() || sampler_has_sample() || sampler_has_trip();
}

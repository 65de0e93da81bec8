// A simulated ATmega2560 with the firmware in it. Its converters see an actuator that follows the
// set-point pin, and its serial port is a pseudo-terminal, or a script.
//
//   simboard firmware.elf [--link PATH] [--speed X] [--actuator COMMAND]
//       prints the port's name, and runs until it is killed. Opening the port resets the board, as
//       on a MEGA.
//   simboard firmware.elf --script FILE [--pins FILE] [--poke ADDRESS=VALUE]
//       runs the script as fast as it can; stdout is what the board sends.
//
// A script has a line for each event, by time (ms of the board's life):
//   100 send 70696e672a3137 0a      bytes, in hex, to the serial port
//   500 over 150                    the sensor sees this pressure (kPa), whatever is commanded
//   600 spike 7 400                 in the 7th tenth of every millisecond it sees this one instead
//   900 end
// --pins writes a line t_ms,setpoint,valve whenever one of the two changes. --poke sets a 32-bit
// variable before the second millisecond (its address by avr-nm): a clock about to wrap.
//
// COMMAND reads messages from its standard input, one a millisecond of the board's life: 'd' and a
// float (drive at so many kPa), 't' and a float (the same, and a trial begins), or 'b' and a float
// (bent in the fixture, degrees), and answers each with two 16-bit counts, pressure and flex.
// Without COMMAND there is a plain lag.

#define _GNU_SOURCE
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <simavr/avr_adc.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { FREQUENCY = 16000000, CYCLES_PER_MS = FREQUENCY / 1000, VREF_MV = 5000, BOOT_MS = 200 };
enum { PORTH = 0x102, TCCR4A = 0xa0, OCR4AL = 0xa8, OCR4AH = 0xa9 };  // data addresses
enum { VALVE = 1 << 4, CONNECTED = 1 << 7 };
static const double FULL_SCALE_KPA = 100.0;  // of set-point 1023

static avr_t *avr;
static avr_irq_t *uart_in;
static bool may_send = true;

static void die(const char *what) {
    fprintf(stderr, "simboard: %s\n", what);
    exit(2);
}

// --- bytes on the wire -------------------------------------------------------------------------

typedef struct {
    uint8_t bytes[1 << 16];
    size_t size;
} buffer_t;

static buffer_t to_host, to_board;

static void append(buffer_t *buffer, const uint8_t *bytes, size_t size) {
    if (buffer->size + size > sizeof buffer->bytes) return;  // nobody reads: lost, as on a wire
    memcpy(buffer->bytes + buffer->size, bytes, size);
    buffer->size += size;
}

static void drop(buffer_t *buffer, size_t size) {
    buffer->size -= size;
    memmove(buffer->bytes, buffer->bytes + size, buffer->size);
}

static void from_uart(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    uint8_t byte = value;
    append(&to_host, &byte, 1);
}

static void uart_ready(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    if (value) may_send = true;
}

static void uart_full(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    if (value) may_send = false;
}

// The person at the fixture hears "angle 30*XX" and bends the sensor.
static double fixture_deg = NAN;
static bool trial_begins;

static void overhear(uint8_t byte) {
    static char line[64];
    static size_t length;
    if (byte != '\n') {
        if (length < sizeof line - 1) line[length++] = byte;
        return;
    }
    line[length] = 0;
    length = 0;
    if (!strncmp(line, "angle ", 6)) fixture_deg = atof(line + 6);
    if (!strncmp(line, "run", 3)) trial_begins = true;
    if (!strncmp(line, "run", 3) || !strncmp(line, "stop", 4)) fixture_deg = NAN;
}

// As many bytes as the wire carries in a tick at 500000 baud.
static void feed_uart(size_t most) {
    size_t sent = 0;
    while (sent < to_board.size && sent < most && may_send) {
        overhear(to_board.bytes[sent]);
        avr_raise_irq(uart_in, to_board.bytes[sent++]);
    }
    drop(&to_board, sent);
}

// --- the actuator ------------------------------------------------------------------------------

static FILE *to_actuator, *from_actuator;
static double over_kpa = NAN, spike_kpa;
static unsigned spike_tenth;

static void start_actuator(const char *command) {
    int down[2], up[2];
    if (pipe(down) || pipe(up)) die("no pipe");
    if (fork() == 0) {
        dup2(down[0], 0);
        dup2(up[1], 1);
        close(down[1]);
        close(up[0]);
        execl("/bin/sh", "sh", "-c", command, NULL);
        _exit(127);
    }
    close(down[0]);
    close(up[1]);
    to_actuator = fdopen(down[1], "w");
    from_actuator = fdopen(up[0], "r");
}

static int counts_of_kpa(double kpa) { return lround((0.5 + 4.0 * kpa / 551.6) / 5.0 * 1023.0); }

// What the sensors read after a millisecond of `kpa`: pressure lags 60 ms, the angle 400 ms.
static void plain_lag(double kpa, int counts[2]) {
    static double pressure, angle;
    pressure += (kpa - pressure) / 60.0;
    angle += (pressure - angle) / 400.0;
    counts[0] = counts_of_kpa(pressure);
    counts[1] = lround(350.0 - 2.0 * (isnan(fixture_deg) ? angle : fixture_deg));
}

static void ask_actuator(double kpa, int counts[2]) {
    float value = isnan(fixture_deg) ? kpa : fixture_deg;
    uint16_t answer[2];
    fputc(!isnan(fixture_deg) ? 'b' : trial_begins ? 't' : 'd', to_actuator);
    trial_begins = false;
    fwrite(&value, sizeof value, 1, to_actuator);
    fflush(to_actuator);
    if (fread(answer, sizeof answer, 1, from_actuator) != 1) die("the actuator's process ended");
    counts[0] = answer[0];
    counts[1] = answer[1];
}

static unsigned setpoint(void) {
    bool connected = avr->data[TCCR4A] & CONNECTED;
    return connected ? avr->data[OCR4AL] | avr->data[OCR4AH] << 8 : 0;
}

static bool valve_closed(void) { return avr->data[PORTH] & VALVE; }

static void set_input(int channel, int counts) {
    // Rounded up: the simulated converter cuts.
    int mv = (counts * VREF_MV + 1022) / 1023;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, channel), mv);
}

static int pressure_counts;

static void run_actuator(void) {
    int counts[2];
    double kpa = valve_closed() ? setpoint() * FULL_SCALE_KPA / 1023.0 : 0.0;
    if (to_actuator) {
        ask_actuator(kpa, counts);
    } else {
        plain_lag(kpa, counts);
    }
    pressure_counts = isnan(over_kpa) ? counts[0] : counts_of_kpa(over_kpa);
    set_input(0, pressure_counts);
    set_input(1, counts[1]);
}

static void tell_pins(FILE *pins, unsigned ms) {
    static unsigned last_setpoint;
    static bool last_valve;
    if (!pins || (setpoint() == last_setpoint && valve_closed() == last_valve)) return;
    last_setpoint = setpoint();
    last_valve = valve_closed();
    fprintf(pins, "%u,%u,%d\n", ms, last_setpoint, last_valve);
}

// --- the board ---------------------------------------------------------------------------------

static void keep_cycles(avr_t *board, avr_cycle_count_t cycles) { (void)board, (void)cycles; }

static void quiet(avr_t *board, const int level, const char *format, va_list arguments) {
    (void)board;
    if (level <= LOG_ERROR) vfprintf(stderr, format, arguments);
}

static avr_cycle_count_t wake_up(avr_t *board, avr_cycle_count_t when, void *unused) {
    (void)board, (void)unused;
    return when + CYCLES_PER_MS / 10;  // a sleeping board must not sleep over a tick
}

static void make_board(const char *elf) {
    elf_firmware_t firmware = {0};
    avr_global_logger_set(quiet);
    if (elf_read_firmware(elf, &firmware)) die("cannot read the firmware");
    avr = avr_make_mcu_by_name("atmega2560");
    if (!avr) die("this simavr knows no atmega2560");
    avr_init(avr);
    firmware.frequency = FREQUENCY;
    avr_load_firmware(avr, &firmware);
    avr->frequency = FREQUENCY;
    avr->vcc = avr->avcc = avr->aref = VREF_MV;
    avr->sleep = keep_cycles;  // this program keeps the time itself
    uint32_t flags = 0;        // by default it prints lines itself, and waits
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_cycle_timer_register(avr, CYCLES_PER_MS / 10, wake_up, NULL);
    uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), from_uart, NULL);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), uart_ready, NULL);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), uart_full, NULL);
}

static void run_until(avr_cycle_count_t cycle) {
    while (avr->cycle < cycle) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) die("the firmware stopped");
    }
}

static void run_ms(unsigned ms, FILE *pins) {
    for (unsigned tenth = 1; tenth <= 10; tenth++) {
        feed_uart(5);
        if (spike_tenth) {
            bool now = tenth == spike_tenth;
            set_input(0, now ? counts_of_kpa(spike_kpa) : pressure_counts);
        }
        run_until((avr_cycle_count_t)ms * CYCLES_PER_MS + tenth * CYCLES_PER_MS / 10);
    }
    run_actuator();
    tell_pins(pins, ms);
}

static void poke(const char *text) {
    unsigned address, value;
    if (sscanf(text, "%x=%u", &address, &value) != 2) die("expected --poke ADDRESS=VALUE");
    for (int i = 0; i < 4; i++) avr->data[(address & 0xffff) + i] = value >> 8 * i;
}

// --- by script ---------------------------------------------------------------------------------

static void send_hex(const char *text) {
    unsigned byte;
    int used;
    while (sscanf(text, " %2x%n", &byte, &used) == 1) {
        uint8_t one = byte;
        append(&to_board, &one, 1);
        text += used;
    }
}

static void run_script(const char *path, FILE *pins, const char *poked) {
    FILE *script = fopen(path, "r");
    char line[8192], word[16];
    unsigned at;
    int used;
    unsigned ms = 0;
    if (!script) die("cannot read the script");
    while (fgets(line, sizeof line, script)) {
        if (sscanf(line, "%u %15s%n", &at, word, &used) != 2) die("expected MS WORD ...");
        for (; ms < at; ms++) {
            if (ms == 1 && poked) poke(poked);
            run_ms(ms, pins);
            fwrite(to_host.bytes, 1, to_host.size, stdout);
            to_host.size = 0;
        }
        if (!strcmp(word, "send")) send_hex(line + used);
        else if (!strcmp(word, "over")) over_kpa = atof(line + used);
        else if (!strcmp(word, "spike")) sscanf(line + used, "%u %lf", &spike_tenth, &spike_kpa);
        else if (strcmp(word, "end")) die("expected send, over, spike or end");
    }
    fclose(script);
}

// --- on a pseudo-terminal ----------------------------------------------------------------------

static double wall_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static int open_port(const char *link_name) {
    int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    struct termios raw;
    if (master < 0 || grantpt(master) || unlockpt(master)) die("no pseudo-terminal");
    int slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    close(slave);
    if (link_name) {
        unlink(link_name);
        if (symlink(ptsname(master), link_name)) die("cannot make the link");
    }
    printf("%s\n", ptsname(master));
    fflush(stdout);
    return master;
}

static bool is_open(int port) {
    struct pollfd look = {.fd = port, .events = 0};
    return poll(&look, 1, 0) >= 0 && !(look.revents & POLLHUP);
}

// What DTR does on a MEGA; the bootloader is left out but for a moment of deafness.
static void reset_board(void) {
    avr_reset(avr);
    avr_cycle_timer_register(avr, CYCLES_PER_MS / 10, wake_up, NULL);
    to_host.size = to_board.size = 0;
    may_send = true;
}

static void serve(const char *link_name, double speed) {
    int port = open_port(link_name);
    double start = wall_s();
    uint8_t bytes[512];
    bool was_open = false;
    unsigned deaf_until = 0;
    for (unsigned ms = 0;; ms++) {
        bool now_open = is_open(port);
        if (now_open && !was_open) deaf_until = ms + BOOT_MS;
        was_open = now_open;
        ssize_t count = now_open ? read(port, bytes, sizeof bytes) : 0;
        if (count > 0 && ms >= deaf_until) append(&to_board, bytes, count);
        if (ms == deaf_until) reset_board();
        run_ms(ms, NULL);
        if (ms < deaf_until || !now_open) to_host.size = 0;
        count = write(port, to_host.bytes, to_host.size);
        if (count > 0) drop(&to_host, count);
        double ahead = ms / 1000.0 / speed - (wall_s() - start);
        if (ahead > 0.002) usleep(ahead * 1e6);
        // A machine that was busy for long does not get the time back in a rush.
        if (ahead < -0.1) start -= ahead;
    }
}

int main(int count, char **arguments) {
    const char *link_name = NULL, *script = NULL, *poked = NULL, *actuator = NULL;
    FILE *pins = NULL;
    double speed = 1.0;
    if (count < 2 || count % 2) die("usage: simboard FIRMWARE.elf [--OPTION VALUE]...");
    for (int i = 2; i < count; i += 2) {
        const char *option = arguments[i], *value = arguments[i + 1];
        if (!strcmp(option, "--link")) link_name = value;
        else if (!strcmp(option, "--script")) script = value;
        else if (!strcmp(option, "--poke")) poked = value;
        else if (!strcmp(option, "--actuator")) actuator = value;
        else if (!strcmp(option, "--speed")) speed = atof(value);
        else if (!strcmp(option, "--pins")) pins = fopen(value, "w");
        else die("unknown option");
    }
    signal(SIGPIPE, SIG_IGN);
    make_board(arguments[1]);
    if (actuator) start_actuator(actuator);
    if (script) run_script(script, pins, poked);
    else serve(link_name, speed);
    if (pins) fclose(pins);
    return 0;
}

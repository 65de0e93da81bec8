#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "config.h"

#define TX_SIZE 1024U  // a power of two; 20 ms at 500000 baud
#define TX_MASK (TX_SIZE - 1U)

static volatile uint8_t rx[256];  // the index wraps by itself
static volatile uint8_t rx_head, rx_tail;
static volatile uint8_t tx[TX_SIZE];
static volatile uint16_t tx_head, tx_tail;

void uart_start(void) {
    UBRR0 = F_CPU / 16UL / BAUD - 1UL;
    UCSR0A = 0;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);  // 8N1
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART0_RX_vect) {
    uint8_t byte = UDR0;
    uint8_t next = rx_head + 1;
    // A full buffer loses the byte; its line then fails its checksum.
    if (next == rx_tail) return;
    rx[rx_head] = byte;
    rx_head = next;
}

ISR(USART0_UDRE_vect) {
    uint16_t tail = tx_tail;
    if (tail == tx_head) {
        UCSR0B &= ~_BV(UDRIE0);
        return;
    }
    UDR0 = tx[tail];
    tx_tail = (tail + 1) & TX_MASK;
}

bool uart_has_input(void) { return rx_head != rx_tail; }

uint8_t uart_read(void) {
    uint8_t byte = rx[rx_tail];
    rx_tail++;
    return byte;
}

bool uart_write(const char *text, uint8_t length) {
    uint16_t tail;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { tail = tx_tail; }
    uint16_t head = tx_head;
    if (((tail - head - 1) & TX_MASK) < length) return false;
    while (length--) {
        tx[head] = *text++;
        head = (head + 1) & TX_MASK;
    }
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        tx_head = head;
        UCSR0B |= _BV(UDRIE0);
    }
    return true;
}

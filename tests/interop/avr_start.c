/* Prints by the serial port of an AVR, and ends simavr when the program ends. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

static int put(char letter, FILE *stream)
{
    (void)stream;
    while (!(UCSR0A & _BV(UDRE0)))
        ;
    UDR0 = (uint8_t)letter;
    return 0;
}

static FILE out = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

__attribute__((constructor)) static void start(void)
{
    UCSR0B = _BV(TXEN0);
    stdout = &out;
}

__attribute__((destructor)) static void stop(void)
{
    cli();
    sleep_enable();
    sleep_cpu();
}

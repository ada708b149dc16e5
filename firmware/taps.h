/* TAPS/1 device core (docs/taps.md): what a board calls, and the five functions that it has. docs/firmware.md says how to port. */
#ifndef TAPS_H
#define TAPS_H

#include <stddef.h>
#include <stdint.h>

#include "board.h" /* TAPS_CHANNELS, TAPS_BITS (of the converter), TAPS_RATES (Hz, whole numbers, by commas) */

#define TAPS_FORMAT (TAPS_BITS <= 16 ? 0 : TAPS_BITS <= 24 ? 1 : 2) /* of DATA: the shortest that holds the bits */
#define TAPS_SCAN_BYTES (TAPS_CHANNELS * (TAPS_FORMAT + 2))
#ifndef TAPS_FRAME_SCANS
#define TAPS_FRAME_SCANS 256 /* in a DATA frame, at most */
#endif
#ifndef TAPS_RING_SCANS
#define TAPS_RING_SCANS 1024 /* kept for a host that is late, and one less */
#endif
#ifndef TAPS_TEXT_BYTES
#define TAPS_TEXT_BYTES 1024 /* of the INFO text, at most */
#endif
#ifndef TAPS_COMMAND_BYTES
#define TAPS_COMMAND_BYTES 256 /* longer commands are dropped */
#endif

/* INFO text: TAPS_INFO_BEGIN, the serial number, TAPS_INFO_CLOCK, ppm or null, TAPS_INFO_CHANNELS, the channels by commas, "]}". */
#define TAPS_TEXT_(...) #__VA_ARGS__
#define TAPS_TEXT(...) TAPS_TEXT_(__VA_ARGS__)
#define TAPS_INFO_BEGIN "{\"proto\":1,\"model\":\"" TAPS_MODEL "\",\"fw\":\"1.0\",\"serial\":\""
#define TAPS_INFO_CLOCK \
  "\",\"adc_bits\":" TAPS_TEXT(TAPS_BITS) ",\"fs_choices\":[" TAPS_TEXT(TAPS_RATES) "],\"clock_ppm\":"
#define TAPS_INFO_CHANNELS ",\"channels\":["
#define TAPS_CHANNEL(i, quantity, sensitivity, date, full_scale, skew)                                           \
  "{\"i\":" #i ",\"quantity\":\"" quantity "\",\"sens_V_per_EU\":" TAPS_TEXT(sensitivity) ",\"sens_date\":\"" date \
  "\",\"fs_V\":" TAPS_TEXT(full_scale) ",\"gain\":1,\"skew_s\":" TAPS_TEXT(skew) "}"

/* Begin: nothing configured, nothing streaming. info: the text of INFO in pieces, ended by NULL; it must stay where it is. */
void taps_init(const char *const info[]);
/* Answer what has come and send what is due; call it over and over. It never waits. */
void taps_poll(void);
/* Take in the next scan, from the main loop or from one interrupt of the same core. codes NULL: the board has missed it.
   Bit k of overload (k < 8): something at the input of codes[k] is beyond its range. */
void taps_scan(const int32_t codes[TAPS_CHANNELS], uint8_t overload);

/* The board. */
size_t board_send(const uint8_t *data, size_t size); /* how many of these bytes were taken; 0: none now. Never waits */
int board_receive(void);                             /* the next byte from the host; -1: none now */
void board_start(uint32_t rate);                     /* taps_scan is called rate times a second from now on */
void board_stop(void);                               /* taps_scan is not called any more when this returns */
int board_button(void);                              /* 1 while the button is down, 0 else */

#endif

/* A board that is called, not run: bytes in, bytes out, scans as they are given. For tests. */
#ifndef TAPS_CHANNELS
#define TAPS_CHANNELS 2
#endif
#ifndef TAPS_BITS
#define TAPS_BITS 16
#endif
#define TAPS_RATES 25600, 51200
#define TAPS_MODEL "TAPS library"

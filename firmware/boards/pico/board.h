/* Raspberry Pi Pico. CONVERTER 12: the RP2040's own converter (GP26 force, GP27 acceleration, one after the other);
   24: an ADS131M02 on SPI0 (both at once). */
#include "sensors.h"

#ifndef CONVERTER
#define CONVERTER 12
#endif
#define TAPS_CHANNELS 2
#define TAPS_BITS CONVERTER
#if CONVERTER == 12
#define TAPS_RATES 25600
#define TAPS_MODEL "Pico"
#define FULL_SCALE_V 1.65
#define SKEW_S 1.953125e-5 /* half the time between two scans */
#else
#define TAPS_RATES 31250
#define TAPS_MODEL "Pico with ADS131M02"
#define FULL_SCALE_V 1.2
#define SKEW_S 0
#endif

/* Blue Pill (STM32F103C8): its two converters sample PA0, force, and PA1, acceleration, at once. */
#include "sensors.h"

#define TAPS_CHANNELS 2
#define TAPS_BITS 12
#define TAPS_RATES 25000 /* divides the 72 MHz of its clock */
#define TAPS_MODEL "Blue Pill"
#define FULL_SCALE_V 1.65

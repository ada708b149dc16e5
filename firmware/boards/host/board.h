#define TAPS_CHANNELS 2
#define TAPS_BITS 16
#define TAPS_RATES 25600
#define TAPS_MODEL "TAPS host"
#define TAPS_SERIAL "HOST-1"

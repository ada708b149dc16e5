/* What is plugged into a board of one's own: V per unit at the converter (after the conditioner's gain and the divider), the
   date of the calibration. Change them here, or by DEFINES="-DFORCE_V_PER_N=1.1e-3 ..." of make. */
#ifndef FORCE_V_PER_N
#define FORCE_V_PER_N 2.25e-3
#endif
#ifndef FORCE_DATE
#define FORCE_DATE ""
#endif
#ifndef RESPONSE_V_PER_M_S2
#define RESPONSE_V_PER_M_S2 1.02e-3
#endif
#ifndef RESPONSE_DATE
#define RESPONSE_DATE ""
#endif

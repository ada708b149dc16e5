/* Registers of the STM32F103 that are used here: RM0008 (STMicroelectronics). */
#ifndef STM32F103_H
#define STM32F103_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define FLASH_ACR REGISTER(0x40022000u) /* PM0075 */
enum { PREFETCH = 1 << 4, TWO_WAITS = 2 };

#define RCC_CR REGISTER(0x40021000u) /* 7.3 */
#define RCC_CFGR REGISTER(0x40021004u)
#define RCC_APB2ENR REGISTER(0x40021018u)
#define RCC_APB1ENR REGISTER(0x4002101Cu)
enum { HSE_ON = 1 << 16, HSE_READY = 1 << 17, PLL_ON = 1 << 24, PLL_READY = 1 << 25 };
enum { HALF_APB1 = 4 << 8, ADC_BY_6 = 2 << 14, PLL_OF_HSE = 1 << 16, PLL_TIMES_9 = 7 << 18, RUN_ON_PLL = 2 };
enum { USE_AFIO = 1 << 0, USE_PORT_A = 1 << 2, USE_PORT_B = 1 << 3, USE_ADC1 = 1 << 9, USE_ADC2 = 1 << 10 };
enum { USE_TIMER3 = 1 << 1, USE_USB = 1 << 23 };

#define PORT_A_LOW REGISTER(0x40010800u) /* 9.2: four bits a pin */
#define PORT_A_HIGH REGISTER(0x40010804u)
#define PORT_A_CLEAR REGISTER(0x40010814u)
#define PORT_B_LOW REGISTER(0x40010C00u)
#define PORT_B_IN REGISTER(0x40010C08u)
#define PORT_B_OUT REGISTER(0x40010C0Cu)
enum { PIN_ANALOG = 0, PIN_OUTPUT = 2, PIN_FLOATING = 4, PIN_PULLED = 8 };

enum { ADC1 = 0x40012400, ADC2 = 0x40012800 }; /* 11.12 */
#define ADC_SR(adc) REGISTER((uint32_t)(adc))
#define ADC_CR1(adc) REGISTER((uint32_t)(adc) + 0x04u)
#define ADC_CR2(adc) REGISTER((uint32_t)(adc) + 0x08u)
#define ADC_SMPR2(adc) REGISTER((uint32_t)(adc) + 0x10u)
#define ADC_SQR3(adc) REGISTER((uint32_t)(adc) + 0x34u)
#define ADC_DR(adc) REGISTER((uint32_t)(adc) + 0x4Cu)
enum { TELL_END = 1 << 5, BOTH_AT_ONCE = 6 << 16 };
enum { ADC_ON = 1, CALIBRATE = 1 << 2, FORGET_CALIBRATION = 1 << 3, FOR_DMA = 1 << 8, BY_TRIGGER = 1 << 20 };
enum { OF_TIMER3 = 4 << 17, OF_SOFTWARE = 7 << 17 };

#define TIMER3_CR1 REGISTER(0x40000400u) /* 15.4 */
#define TIMER3_CR2 REGISTER(0x40000404u)
#define TIMER3_ARR REGISTER(0x4000042Cu)
enum { TIMER_ON = 1, TRIGGER_AT_UPDATE = 2 << 4 };

#define NVIC_ENABLE REGISTER(0xE000E100u)
#define NVIC_DISABLE REGISTER(0xE000E180u)
#define NVIC_CLEAR REGISTER(0xE000E280u)
enum { IRQ_ADC = 18 };
#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_VALUE REGISTER(0xE000E018u)
enum { SYSTICK_LONGEST = 0xFFFFFF };

#define UNIQUE_ID(i) REGISTER(0x1FFFF7E8u + 4u * (i)) /* 30.2 */

#define USB_ENDPOINT(n) REGISTER(0x40005C00u + 4u * (n)) /* 23.5 */
#define USB_CNTR REGISTER(0x40005C40u)
#define USB_ISTR REGISTER(0x40005C44u)
#define USB_DADDR REGISTER(0x40005C4Cu)
#define USB_BTABLE REGISTER(0x40005C50u)
#define USB_MEMORY(at) REGISTER(0x40006000u + 2u * (at)) /* two of its bytes stand every four bytes */
enum { USB_DONE = 1 << 15, USB_BUS_RESET = 1 << 10, USB_ENABLED = 1 << 7, USB_FORCE_RESET = 1 };
enum { RECEIVED = 1 << 15, WAS_SETUP = 1 << 11, WAS_SENT = 1 << 7, KEPT = 0x070F, TOGGLES = 0x4040 };
enum { CONTROL = 1 << 9, BULK = 0 << 9, INTERRUPT = 3 << 9, SENDING = 0x0030, RECEIVING = 0x3000 };
enum { STALLED = 0x1010, NOT_YET = 0x2020, READY = 0x3030, ROOM_FOR_64 = 0x8400 };

#endif

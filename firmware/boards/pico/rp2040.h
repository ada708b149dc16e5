/* Registers of the RP2040 that are used here: RP2040 datasheet (Raspberry Pi Ltd). */
#ifndef RP2040_H
#define RP2040_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SET(address) REGISTER((address) + 0x2000u)   /* alias that sets bits (2.1.2) */
#define CLEAR(address) REGISTER((address) + 0x3000u) /* alias that clears them */

#define RESETS_RESET 0x4000C000u /* 2.14 */
#define RESETS_DONE REGISTER(0x4000C008u)
enum { RESET_ADC = 1 << 0, RESET_IO = 1 << 5, RESET_PADS = 1 << 8, RESET_PLL_SYS = 1 << 12, RESET_PLL_USB = 1 << 13 };
enum { RESET_SPI0 = 1 << 16, RESET_USB = 1 << 24 };

#define XOSC_CTRL 0x40024000u /* 2.16 */
#define XOSC_STATUS REGISTER(0x40024004u)
#define XOSC_STARTUP REGISTER(0x4002400Cu)
#define PLL_SYS 0x40028000u /* 2.18: CS, PWR, FBDIV, PRIM */
#define PLL_USB 0x4002C000u
#define CLK_GPOUT0_CTRL REGISTER(0x40008000u) /* 2.15 */
#define CLK_GPOUT0_DIV REGISTER(0x40008004u)
#define CLK_REF_CTRL REGISTER(0x40008030u)
#define CLK_REF_SELECTED REGISTER(0x40008038u)
#define CLK_SYS_CTRL REGISTER(0x4000803Cu)
#define CLK_SYS_SELECTED REGISTER(0x40008044u)
#define CLK_PERI_CTRL REGISTER(0x40008048u)
#define CLK_USB_CTRL REGISTER(0x40008054u)
#define CLK_ADC_CTRL REGISTER(0x40008060u)
enum { CLOCK_ENABLE = 1 << 11 };

#define GPIO_CTRL(pin) REGISTER(0x40014004u + 8u * (pin)) /* 2.19 */
#define GPIO_INTR(pin) REGISTER(0x400140F0u + (pin) / 8u * 4u)
#define GPIO_INTE(pin) REGISTER(0x40014100u + (pin) / 8u * 4u)
#define PAD(pin) REGISTER(0x4001C004u + 4u * (pin))
enum { PIN_SPI = 1, PIN_SIO = 5, PIN_CLOCK = 8, FALLING = 4 };
enum { PAD_ANALOG = 1 << 7, PAD_PULL_UP = 0x4A, PAD_PLAIN = 0x42 };
#define GPIO_IN REGISTER(0xD0000004u) /* 2.3.1 */
#define GPIO_OUT_SET REGISTER(0xD0000014u)
#define GPIO_OUT_CLEAR REGISTER(0xD0000018u)
#define GPIO_OE_SET REGISTER(0xD0000024u)

#define ADC_CS REGISTER(0x4004C000u) /* 4.9 */
#define ADC_FCS REGISTER(0x4004C008u)
#define ADC_FIFO REGISTER(0x4004C00Cu)
#define ADC_DIV REGISTER(0x4004C010u)
#define ADC_INTE REGISTER(0x4004C018u)
#define SPI0_CR0 REGISTER(0x4003C000u) /* 4.4 */
#define SPI0_CR1 REGISTER(0x4003C004u)
#define SPI0_DR REGISTER(0x4003C008u)
#define SPI0_SR REGISTER(0x4003C00Cu)
#define SPI0_CPSR REGISTER(0x4003C010u)

#define NVIC_ENABLE REGISTER(0xE000E100u)
#define NVIC_DISABLE REGISTER(0xE000E180u)
#define NVIC_CLEAR REGISTER(0xE000E280u)
enum { IRQ_IO = 13, IRQ_ADC = 22 };

#define USB_MEMORY 0x50100000u /* 4.1 */
#define USB_ADDRESS REGISTER(0x50110000u)
#define USB_MAIN_CTRL REGISTER(0x50110040u)
#define USB_SIE_CTRL REGISTER(0x5011004Cu)
#define USB_SIE_STATUS REGISTER(0x50110050u)
#define USB_BUFF_STATUS REGISTER(0x50110058u)
#define USB_STALL_ARM REGISTER(0x50110068u)
#define USB_MUXING REGISTER(0x50110074u)
#define USB_PWR REGISTER(0x50110078u)
#define USB_ENDPOINT(n, is_out) REGISTER(USB_MEMORY + 8u * (n) + 4u * (is_out))          /* n > 0 */
#define USB_BUFFER(n, is_out) REGISTER(USB_MEMORY + 0x80u + 8u * (n) + 4u * (is_out))
#define USB_DATA(n, is_out) ((volatile uint8_t *)(USB_MEMORY + ((n) ? 0x140u + 0x80u * (n) + 0x40u * (is_out) : 0x100u)))
enum { USB_FULL = 1 << 15, USB_DATA1 = 1 << 13, USB_STALL = 1 << 11, USB_AVAILABLE = 1 << 10 };
enum { USB_BUS_RESET = 1 << 19, USB_SETUP = 1 << 17 };

#endif

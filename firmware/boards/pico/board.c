/* Raspberry Pi Pico: USB serial port to the host, foot switch between GP15 and ground. docs/firmware.md has the wiring. */
#include "rp2040.h"
#include "taps.h"
#include "usb_serial.h"

enum { BUTTON_PIN = 15, READY_PIN = 20, CLOCK_PIN = 21, FIRST_SPI_PIN = 16, SELECT_PIN = 17 };

extern uint32_t bss_begin[], bss_end[], stack_end[];
void reset(void);
void scan_ready(void);
static void wait_forever(void) {
  for (;;) continue;
}

/* Stack, reset, 14 exceptions of which none may come, 26 interrupts. */
__attribute__((section(".vectors"), used)) static const struct {
  uint32_t *stack;
  void (*handlers[41])(void);
} vectors = {stack_end,
             {[0] = reset,
              [1] = wait_forever,
              [2] = wait_forever,
              [15 + IRQ_IO] = scan_ready,
              [15 + IRQ_ADC] = scan_ready}};

/* USB. All of it is asked for in the main loop. */

static uint8_t toggle[4][2];
enum { SENDS = 0, RECEIVES = 1 };

static void chip_arm(uint8_t endpoint, uint32_t direction, uint32_t bits) {
  uint32_t pid = toggle[endpoint][direction] ? USB_DATA1 : 0;
  toggle[endpoint][direction] ^= 1;
  USB_BUFFER(endpoint, direction) = bits | pid;
  __asm__ volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop"); /* 4.1.2.5.1: of another clock */
  USB_BUFFER(endpoint, direction) = bits | pid | USB_AVAILABLE;
}

static void chip_send(uint8_t endpoint, const uint8_t *data, size_t size) {
  size_t i;
  for (i = 0; i < size; i++) USB_DATA(endpoint, SENDS)[i] = data[i];
  chip_arm(endpoint, SENDS, USB_FULL | (uint32_t)size);
}

static void chip_expect(uint8_t endpoint) { chip_arm(endpoint, RECEIVES, USB_PACKET); }

static void chip_stall(void) {
  USB_STALL_ARM = 3;
  USB_BUFFER(0, SENDS) = USB_STALL;
  USB_BUFFER(0, RECEIVES) = USB_STALL;
}

static void chip_address(uint8_t address) { USB_ADDRESS = address; }

static void open_endpoint(uint32_t endpoint, uint32_t direction, uint32_t kind) {
  uint32_t offset = 0x140u + 0x80u * endpoint + 0x40u * direction;
  toggle[endpoint][direction] = 0;
  USB_ENDPOINT(endpoint, direction) = 1u << 31 | 1u << 29 | kind << 26 | offset;
}

static void chip_open_endpoints(void) {
  open_endpoint(USB_TO_HOST, SENDS, 2);
  open_endpoint(USB_FROM_HOST, RECEIVES, 2);
  open_endpoint(USB_NOTIFY, SENDS, 3);
}

static void open_usb(void) {
  uint32_t at;
  for (at = 0; at < 4096; at += 4) REGISTER(USB_MEMORY + at) = 0;
  USB_MUXING = 1 | 1 << 3;
  USB_PWR = 1 << 2 | 1 << 3; /* the bus is there */
  USB_MAIN_CTRL = 1;
  USB_SIE_CTRL = 1u << 29 | 1 << 16; /* tell of each packet of endpoint 0; connect */
}

static void poll_usb(void) {
  uint8_t packet[USB_PACKET];
  uint32_t done, endpoint, direction, i, size;
  if (USB_SIE_STATUS & USB_BUS_RESET) {
    USB_SIE_STATUS = USB_BUS_RESET;
    usb_reset();
  }
  if (USB_SIE_STATUS & USB_SETUP) {
    USB_SIE_STATUS = USB_SETUP;
    for (i = 0; i < 8; i++) packet[i] = ((volatile uint8_t *)USB_MEMORY)[i];
    toggle[0][SENDS] = toggle[0][RECEIVES] = 1; /* what follows a request begins with DATA1 */
    usb_setup(packet);
  }
  done = USB_BUFF_STATUS;
  for (endpoint = 0; endpoint < 4; endpoint++) {
    for (direction = 0; direction < 2; direction++) {
      if (!(done >> (2 * endpoint + direction) & 1)) continue;
      USB_BUFF_STATUS = 1u << (2 * endpoint + direction);
      if (direction == SENDS) {
        usb_sent((uint8_t)endpoint);
        continue;
      }
      size = USB_BUFFER(endpoint, RECEIVES) & 0x7F;
      for (i = 0; i < size && i < sizeof packet; i++) packet[i] = USB_DATA(endpoint, RECEIVES)[i];
      usb_received((uint8_t)endpoint, packet, i);
    }
  }
  usb_flush();
}

size_t board_send(const uint8_t *data, size_t size) { return usb_write(data, size); }

int board_receive(void) { return usb_read(); }

int board_button(void) { return !(GPIO_IN >> BUTTON_PIN & 1); }

/* The converters. */

#if CONVERTER == 12

static void wait_for_converter(void) {
  while (!(ADC_CS >> 8 & 1)) continue;
}

static void open_converter(void) {
  PAD(26) = PAD(27) = PAD_ANALOG;
  ADC_CS = 1;
  wait_for_converter();
}

/* Inputs 0 and 1 in turn, 0 first. */
static void begin_turns(void) {
  ADC_CS = 1;
  wait_for_converter();
  while (!(ADC_FCS >> 8 & 1)) (void)ADC_FIFO;
  ADC_FCS = 2u << 24 | 1 << 11 | 1 << 10 | 1; /* tell when two are there; forget what ran over */
  ADC_CS = 3u << 16 | 1 << 3 | 1;
}

void board_start(uint32_t rate) {
  ADC_DIV = 256u * (48000000u / 100u) / (2 * rate / 100u) - 256; /* of one conversion, in 1/256 of the 48 MHz */
  begin_turns();
  ADC_INTE = 1;
  NVIC_ENABLE = 1u << IRQ_ADC;
}

void board_stop(void) {
  NVIC_DISABLE = 1u << IRQ_ADC;
  ADC_INTE = 0;
  ADC_CS = 1;
}

void scan_ready(void) {
  int32_t codes[2];
  if (ADC_FCS >> 11 & 1) { /* it ran over: how much is missing is not known, one scan at least */
    taps_scan(NULL, 0);
    begin_turns();
  }
  while ((ADC_FCS >> 16 & 0xF) >= 2) {
    codes[0] = (int32_t)(ADC_FIFO & 0xFFF) - 2048;
    codes[1] = (int32_t)(ADC_FIFO & 0xFFF) - 2048;
    taps_scan(codes, 0);
  }
}

#else

enum { WORDS = 4, WRITE_CLOCK = 0x6180, CLOCK_FAST = 0x0302 }; /* ADS131M02: both channels, oversampling 128, high resolution */

static volatile uint8_t is_sampling;

/* A frame of four words of 24 bits: status (or a command and its value), both channels, CRC. */
static void exchange(uint32_t command, uint32_t value, int32_t *words) {
  uint32_t sent[WORDS] = {command << 8, value << 8, 0, 0}, i, shift;
  GPIO_OUT_CLEAR = 1u << SELECT_PIN;
  for (i = 0; i < WORDS; i++) {
    uint32_t word = 0;
    for (shift = 24; shift; shift -= 8) {
      SPI0_DR = sent[i] >> (shift - 8) & 0xFF;
      while (!(SPI0_SR >> 2 & 1)) continue;
      word = word << 8 | (SPI0_DR & 0xFF);
    }
    words[i] = (int32_t)(word << 8) >> 8;
  }
  GPIO_OUT_SET = 1u << SELECT_PIN;
}

static void open_converter(void) {
  int32_t words[WORDS];
  uint32_t pin;
  PAD(READY_PIN) = PAD_PULL_UP;
  GPIO_CTRL(READY_PIN) = PIN_SIO;
  CLK_GPOUT0_CTRL = CLOCK_ENABLE | 2 << 5; /* 48 MHz of the USB's PLL ... */
  CLK_GPOUT0_DIV = 6u << 8;                /* ... / 6 = 8 MHz: / (2 x 128) = 31250 scans a second */
  GPIO_CTRL(CLOCK_PIN) = PIN_CLOCK;
  for (pin = FIRST_SPI_PIN; pin < FIRST_SPI_PIN + 4; pin++) GPIO_CTRL(pin) = pin == SELECT_PIN ? PIN_SIO : PIN_SPI;
  GPIO_OUT_SET = GPIO_OE_SET = 1u << SELECT_PIN;
  SPI0_CPSR = 2;
  SPI0_CR0 = 3u << 8 | 1 << 7 | 7; /* 125 MHz / 2 / 4 = 15.6 MHz, mode 1, 8 bits */
  SPI0_CR1 = 2;
  for (pin = 0; pin < 2; pin++) exchange(WRITE_CLOCK, CLOCK_FAST, words); /* the first may fall into its start */
}

void board_start(uint32_t rate) {
  (void)rate; /* there is one */
  is_sampling = 1;
  GPIO_INTR(READY_PIN) = (uint32_t)FALLING << 4 * (READY_PIN % 8);
  GPIO_INTE(READY_PIN) |= (uint32_t)FALLING << 4 * (READY_PIN % 8);
  NVIC_ENABLE = 1u << IRQ_IO;
}

void board_stop(void) {
  NVIC_DISABLE = 1u << IRQ_IO;
  is_sampling = 0;
}

void scan_ready(void) {
  int32_t words[WORDS];
  GPIO_INTR(READY_PIN) = (uint32_t)FALLING << 4 * (READY_PIN % 8);
  exchange(0, 0, words);
  if (is_sampling) taps_scan(words + 1, 0);
}

#endif

/* The start. */

static void open_pll(uint32_t pll, uint32_t times, uint32_t dividers) {
  REGISTER(pll + 4) = 0x2D;
  REGISTER(pll) = 1;
  REGISTER(pll + 8) = times;
  CLEAR(pll + 4) = 1 | 1 << 5;
  while (!(REGISTER(pll) >> 31)) continue;
  REGISTER(pll + 12) = dividers;
  CLEAR(pll + 4) = 1 << 3;
}

/* 12 MHz crystal; 125 MHz for the core and SPI, 48 MHz for USB and the converter. */
static void open_clocks(void) {
  uint32_t used = RESET_ADC | RESET_IO | RESET_PADS | RESET_PLL_SYS | RESET_PLL_USB | RESET_SPI0 | RESET_USB;
  REGISTER(XOSC_CTRL) = 0xAA0;
  XOSC_STARTUP = 47;
  SET(XOSC_CTRL) = 0xFABu << 12;
  while (!(XOSC_STATUS >> 31)) continue;
  CLK_REF_CTRL = 2;
  while (CLK_REF_SELECTED != 1 << 2) continue;
  CLK_SYS_CTRL = 0;
  while (CLK_SYS_SELECTED != 1) continue;
  SET(RESETS_RESET) = RESET_PLL_SYS | RESET_PLL_USB | RESET_USB | RESET_ADC;
  CLEAR(RESETS_RESET) = used & ~(uint32_t)(RESET_USB | RESET_ADC | RESET_SPI0);
  while (~RESETS_DONE & (RESET_PLL_SYS | RESET_PLL_USB | RESET_IO | RESET_PADS)) continue;
  open_pll(PLL_SYS, 125, 6u << 16 | 2u << 12);
  open_pll(PLL_USB, 100, 5u << 16 | 5u << 12);
  CLK_SYS_CTRL = 1;
  while (CLK_SYS_SELECTED != 1 << 1) continue;
  CLK_PERI_CTRL = CLK_USB_CTRL = CLK_ADC_CTRL = CLOCK_ENABLE;
  CLEAR(RESETS_RESET) = used;
  while (~RESETS_DONE & used) continue;
}

void reset(void) {
  static const char *const info[] = {
      TAPS_INFO_BEGIN TAPS_SERIAL TAPS_INFO_CLOCK "30" TAPS_INFO_CHANNELS,
      TAPS_CHANNEL(0, "force", FORCE_V_PER_N, FORCE_DATE, FULL_SCALE_V, 0) ",",
      TAPS_CHANNEL(1, "acceleration", RESPONSE_V_PER_M_S2, RESPONSE_DATE, FULL_SCALE_V, SKEW_S) "]}", NULL};
  uint32_t *word;
  for (word = bss_begin; word < bss_end; word++) *word = 0;
  open_clocks();
  PAD(BUTTON_PIN) = PAD_PULL_UP;
  GPIO_CTRL(BUTTON_PIN) = PIN_SIO;
  open_converter();
  taps_init(info);
  usb_serial_number = TAPS_SERIAL;
  open_usb();
  for (;;) {
    poll_usb();
    taps_poll();
  }
}

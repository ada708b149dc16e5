/* Blue Pill: USB serial port to the host, foot switch between PB5 and ground. docs/firmware.md has the wiring. */
#include "stm32f103.h"
#include "taps.h"
#define USB_VENDOR 0x0483 /* the numbers of the chip's maker */
#define USB_PRODUCT 0x5740
#include "usb_serial.h"

enum { CLOCK = 72000000, BUTTON_PIN = 5, USB_PIN = 12, SAMPLE_28_CYCLES = 3 };

extern uint32_t bss_begin[], bss_end[], stack_end[];
void reset(void);
void scan_ready(void);
static void wait_forever(void) {
  for (;;) continue;
}

/* Stack, reset, 14 exceptions of which none may come, 19 interrupts. */
__attribute__((section(".vectors"), used)) static const struct {
  uint32_t *stack;
  void (*handlers[34])(void);
} vectors = {stack_end, {[0] = reset, [1] = wait_forever, [2] = wait_forever, [15 + IRQ_ADC] = scan_ready}};

/* USB. All of it is asked for in the main loop. */

enum { SENDS = 0, RECEIVES = 4 };

static uint32_t entry(uint32_t endpoint, uint32_t direction) { return 8 * endpoint + direction; }
static uint32_t buffer(uint32_t endpoint, uint32_t direction) { return 64 * (1 + 2 * endpoint) + 16 * direction; }

/* What a write of 1 toggles is brought to a value; both flags stay, the kind and the address are written again. */
static void set_bits(uint32_t endpoint, uint32_t which, uint32_t wanted) {
  uint32_t now = USB_ENDPOINT(endpoint);
  USB_ENDPOINT(endpoint) = (now & KEPT) | RECEIVED | WAS_SENT | ((now ^ wanted) & which);
}

static void open_endpoint(uint32_t endpoint, uint32_t kind, uint32_t state) {
  USB_MEMORY(entry(endpoint, SENDS)) = buffer(endpoint, SENDS);
  USB_MEMORY(entry(endpoint, RECEIVES)) = buffer(endpoint, RECEIVES);
  USB_MEMORY(entry(endpoint, RECEIVES) + 2) = ROOM_FOR_64;
  USB_ENDPOINT(endpoint) = (USB_ENDPOINT(endpoint) & (TOGGLES | SENDING | RECEIVING)) | kind | endpoint;
  set_bits(endpoint, SENDING | RECEIVING, state);
}

static void chip_send(uint8_t endpoint, const uint8_t *data, size_t size) {
  size_t i;
  uint32_t at = buffer(endpoint, SENDS);
  for (i = 0; i < size; i += 2) USB_MEMORY(at + i) = data[i] | (i + 1 < size ? (uint32_t)data[i + 1] << 8 : 0);
  USB_MEMORY(entry(endpoint, SENDS) + 2) = (uint32_t)size;
  set_bits(endpoint, SENDING, READY);
}

static void chip_expect(uint8_t endpoint) { set_bits(endpoint, RECEIVING, READY); }

static void chip_stall(void) { set_bits(0, SENDING | RECEIVING, STALLED); }

static void chip_address(uint8_t address) { USB_DADDR = USB_ENABLED | (uint32_t)address; }

static void chip_open_endpoints(void) {
  open_endpoint(USB_TO_HOST, BULK, NOT_YET & SENDING);
  open_endpoint(USB_FROM_HOST, BULK, NOT_YET & RECEIVING);
  open_endpoint(USB_NOTIFY, INTERRUPT, NOT_YET & SENDING);
}

static void receive(uint32_t endpoint, int was_setup) {
  uint8_t packet[USB_PACKET];
  uint32_t size = USB_MEMORY(entry(endpoint, RECEIVES) + 2) & 0x3FF, i;
  for (i = 0; i < size && i < sizeof packet; i++)
    packet[i] = (uint8_t)(USB_MEMORY(buffer(endpoint, RECEIVES) + (i & ~1u)) >> 8 * (i & 1));
  if (was_setup) {
    usb_setup(packet);
  } else {
    usb_received((uint8_t)endpoint, packet, i);
  }
}

static void poll_usb(void) {
  uint32_t endpoint, state;
  if (USB_ISTR & USB_BUS_RESET) {
    USB_ISTR = ~(uint32_t)USB_BUS_RESET;
    open_endpoint(0, CONTROL, (READY & RECEIVING) | (NOT_YET & SENDING));
    usb_reset();
  }
  while (USB_ISTR & USB_DONE) {
    endpoint = USB_ISTR & 0xF;
    state = USB_ENDPOINT(endpoint);
    USB_ENDPOINT(endpoint) = (state & KEPT) | (~state & (RECEIVED | WAS_SENT)); /* the flags that were seen are cleared */
    if (state & RECEIVED) receive(endpoint, (state & WAS_SETUP) != 0);
    if (state & WAS_SENT) usb_sent((uint8_t)endpoint);
  }
  usb_flush();
}

/* A device that was plugged in all the time is seen as a new one: D+ is low for a while. */
static void open_usb(void) {
  volatile uint32_t wait;
  PORT_A_HIGH = (PORT_A_HIGH & ~(0xFu << 4 * (USB_PIN - 8))) | (uint32_t)PIN_OUTPUT << 4 * (USB_PIN - 8);
  PORT_A_CLEAR = 1u << USB_PIN;
  for (wait = 0; wait < CLOCK / 1000; wait++) continue;
  PORT_A_HIGH = (PORT_A_HIGH & ~(0xFu << 4 * (USB_PIN - 8))) | (uint32_t)PIN_FLOATING << 4 * (USB_PIN - 8);
  USB_CNTR = USB_FORCE_RESET;
  for (wait = 0; wait < CLOCK / 1000000; wait++) continue;
  USB_CNTR = 0;
  USB_ISTR = 0;
  USB_BTABLE = 0;
  USB_DADDR = USB_ENABLED;
}

size_t board_send(const uint8_t *data, size_t size) { return usb_write(data, size); }

int board_receive(void) { return usb_read(); }

int board_button(void) { return !(PORT_B_IN >> BUTTON_PIN & 1); }

/* The converters, both triggered by timer 3. */

static uint32_t period, last; /* of a scan, in ticks of the clock; the tick of the last one */

static void open_converter(uint32_t adc, uint32_t channel, uint32_t trigger) {
  volatile uint32_t wait;
  ADC_SMPR2(adc) = SAMPLE_28_CYCLES << 3 * channel; /* with the conversion 41 cycles of 12 MHz: 3.4 us */
  ADC_SQR3(adc) = channel;
  ADC_CR2(adc) = ADC_ON;
  for (wait = 0; wait < CLOCK / 1000000; wait++) continue;
  ADC_CR2(adc) |= FORGET_CALIBRATION;
  while (ADC_CR2(adc) & FORGET_CALIBRATION) continue;
  ADC_CR2(adc) |= CALIBRATE;
  while (ADC_CR2(adc) & CALIBRATE) continue;
  ADC_CR2(adc) = ADC_ON | BY_TRIGGER | trigger;
}

static void open_converters(void) {
  ADC_CR1(ADC1) = BOTH_AT_ONCE;
  open_converter(ADC1, 0, OF_TIMER3 | FOR_DMA);
  open_converter(ADC2, 1, OF_SOFTWARE);
  TIMER3_CR2 = TRIGGER_AT_UPDATE;
  SYSTICK_RELOAD = SYSTICK_LONGEST;
  SYSTICK_VALUE = 0;
  SYSTICK_CONTROL = 5;
}

void board_start(uint32_t rate) {
  period = CLOCK / rate;
  last = SYSTICK_VALUE;
  (void)ADC_DR(ADC1);
  ADC_CR1(ADC1) |= TELL_END;
  NVIC_CLEAR = 1u << IRQ_ADC;
  NVIC_ENABLE = 1u << IRQ_ADC;
  TIMER3_ARR = period - 1;
  TIMER3_CR1 = TIMER_ON;
}

void board_stop(void) {
  TIMER3_CR1 = 0;
  NVIC_DISABLE = 1u << IRQ_ADC;
  ADC_CR1(ADC1) &= ~(uint32_t)TELL_END;
}

/* The converter does not tell what it wrote over; the time since the last scan does. */
void scan_ready(void) {
  int32_t codes[2];
  uint32_t both = ADC_DR(ADC1), now = SYSTICK_VALUE, passed = (last - now) & SYSTICK_LONGEST;
  last = now;
  for (; passed > period + period / 2; passed -= period) taps_scan(NULL, 0);
  codes[0] = (int32_t)(both & 0xFFF) - 2048;
  codes[1] = (int32_t)(both >> 16 & 0xFFF) - 2048;
  taps_scan(codes, 0);
}

/* The start. */

/* 8 MHz crystal; 72 MHz for the core, 48 MHz for USB, 12 MHz for the converters. */
static void open_clocks(void) {
  FLASH_ACR = PREFETCH | TWO_WAITS;
  RCC_CR |= HSE_ON;
  while (!(RCC_CR & HSE_READY)) continue;
  RCC_CFGR = HALF_APB1 | ADC_BY_6 | PLL_OF_HSE | PLL_TIMES_9;
  RCC_CR |= PLL_ON;
  while (!(RCC_CR & PLL_READY)) continue;
  RCC_CFGR |= RUN_ON_PLL;
  while ((RCC_CFGR >> 2 & 3) != RUN_ON_PLL) continue;
  RCC_APB2ENR = USE_AFIO | USE_PORT_A | USE_PORT_B | USE_ADC1 | USE_ADC2;
  RCC_APB1ENR = USE_TIMER3 | USE_USB;
}

static void open_pins(void) {
  PORT_A_LOW = (PORT_A_LOW & ~0xFFu) | PIN_ANALOG << 4 | PIN_ANALOG;
  PORT_B_LOW = (PORT_B_LOW & ~(0xFu << 4 * BUTTON_PIN)) | (uint32_t)PIN_PULLED << 4 * BUTTON_PIN;
  PORT_B_OUT = 1u << BUTTON_PIN; /* up */
}

/* The number that the chip was made with, in hexadecimal. */
static void write_number(char *text) {
  uint32_t i;
  for (i = 0; i < 24; i++) text[i] = "0123456789ABCDEF"[UNIQUE_ID(i / 8) >> 4 * (7 - i % 8) & 0xF];
}

void reset(void) {
  static char number[25];
  static const char *const info[] = {
      TAPS_INFO_BEGIN, number, TAPS_INFO_CLOCK "50" TAPS_INFO_CHANNELS,
      TAPS_CHANNEL(0, "force", FORCE_V_PER_N, FORCE_DATE, FULL_SCALE_V, 0) ",",
      TAPS_CHANNEL(1, "acceleration", RESPONSE_V_PER_M_S2, RESPONSE_DATE, FULL_SCALE_V, 0) "]}", NULL};
  uint32_t *word;
  for (word = bss_begin; word < bss_end; word++) *word = 0;
  open_clocks();
  open_pins();
  open_converters();
  write_number(number);
  taps_init(info);
  usb_serial_number = number;
  open_usb();
  for (;;) {
    poll_usb();
    taps_poll();
  }
}

/* A serial port on USB (CDC-ACM, USB 2.0 chapter 9 and PSTN 1.2): everything but the registers of the chip, which has three
   functions here and calls the four below. Endpoint 0 control, 1 to the host, 2 from the host, 3 notifications (never sent). */
#ifndef USB_SERIAL_H
#define USB_SERIAL_H

#include <stddef.h>
#include <stdint.h>

enum { USB_TO_HOST = 1, USB_FROM_HOST = 2, USB_NOTIFY = 3, USB_PACKET = 64 };

/* The chip. */
static void chip_send(uint8_t endpoint, const uint8_t *data, size_t size); /* a packet, when the host asks next */
static void chip_expect(uint8_t endpoint);                                 /* room for the next packet from the host */
static void chip_stall(void);                                              /* refuse what endpoint 0 was asked for */
static void chip_address(uint8_t address);
static void chip_open_endpoints(void); /* 1 to 3, their toggles at DATA0 */

#define WORD(value) (uint8_t)((value) & 0xFF), (uint8_t)((value) >> 8)
#ifndef USB_VENDOR
#define USB_VENDOR 0x2E8A /* the numbers of the chip's maker */
#define USB_PRODUCT 0x000A
#endif

static const uint8_t usb_device[18] = {18, 1, WORD(0x0200), 2, 0, 0, USB_PACKET, WORD(USB_VENDOR), WORD(USB_PRODUCT),
                                       WORD(0x0100), 1, 2, 3, 1};
static const uint8_t usb_configuration[67] = {
    9, 2, WORD(67), 2, 1, 0, 0x80, 125,                            /* 250 mA from the bus */
    9, 4, 0, 0, 1, 2, 2, 0, 0,                                     /* control interface: CDC, ACM */
    5, 0x24, 0, WORD(0x0110),                                      /* header */
    5, 0x24, 1, 0, 1,                                              /* no call management */
    4, 0x24, 2, 2,                                                 /* line coding and line state */
    5, 0x24, 6, 0, 1,                                              /* union of both interfaces */
    7, 5, 0x80 | USB_NOTIFY, 3, WORD(8), 16, 9, 4, 1, 0, 2, 10, 0, 0, 0, /* data interface */
    7, 5, 0x80 | USB_TO_HOST, 2, WORD(USB_PACKET), 0, 7, 5, USB_FROM_HOST, 2, WORD(USB_PACKET), 0};

static struct {
  const uint8_t *answer; /* what is left of it */
  uint16_t left;
  uint8_t ends_short, address, is_configured;
  uint8_t staged, is_sending, was_full; /* to the host */
  uint8_t waiting, taken;               /* from the host */
  uint8_t coding[7];                    /* of the line: kept for the host, of no meaning here */
  uint8_t text[2 + 2 * 24];
  uint8_t out[USB_PACKET], in[USB_PACKET];
} usb;

static const char *usb_serial_number; /* 24 letters at most; set before the bus is connected */

static void usb_answer(const uint8_t *data, uint16_t size, uint16_t wanted) {
  uint16_t part;
  usb.ends_short = size < wanted && size % USB_PACKET == 0;
  usb.left = size < wanted ? size : wanted;
  part = usb.left < USB_PACKET ? usb.left : USB_PACKET;
  usb.answer = data + part;
  usb.left = (uint16_t)(usb.left - part);
  chip_send(0, data, part);
}

static void usb_answer_text(uint8_t index, uint16_t wanted) {
  static const char *const texts[] = {"", "lobewatch", "TAPS/1"};
  const char *text = index < 3 ? texts[index] : usb_serial_number;
  uint8_t size = 2;
  if (!index) usb.text[size++] = 0x09, usb.text[size++] = 0x04; /* English */
  for (; *text && size < sizeof usb.text; text++) usb.text[size++] = (uint8_t)*text, usb.text[size++] = 0;
  usb.text[0] = size;
  usb.text[1] = 3;
  usb_answer(usb.text, size, wanted);
}

static void usb_describe(uint8_t kind, uint8_t index, uint16_t wanted) {
  if (kind == 1) {
    usb_answer(usb_device, sizeof usb_device, wanted);
  } else if (kind == 2) {
    usb_answer(usb_configuration, sizeof usb_configuration, wanted);
  } else if (kind == 3 && index <= 3) {
    usb_answer_text(index, wanted);
  } else {
    chip_stall();
  }
}

/* The bus was reset. */
static void usb_reset(void) {
  usb.is_configured = usb.address = 0;
  usb.left = usb.ends_short = 0;
  usb.staged = usb.is_sending = usb.was_full = usb.waiting = usb.taken = 0;
  chip_address(0);
}

/* Eight bytes of a request to endpoint 0. */
static void usb_setup(const uint8_t *packet) {
  static const uint8_t zeros[2] = {0, 0};
  uint16_t request = (uint16_t)(packet[0] << 8 | packet[1]), wanted = (uint16_t)(packet[6] | packet[7] << 8);
  if (request == 0x8006) {
    usb_describe(packet[3], packet[2], wanted);
  } else if (request == 0x0005) {
    usb.address = packet[2]; /* holds once this request is answered */
    chip_send(0, zeros, 0);
  } else if (request == 0x0009) {
    usb.is_configured = packet[2];
    chip_open_endpoints();
    usb.staged = usb.is_sending = usb.was_full = usb.waiting = usb.taken = 0;
    chip_expect(USB_FROM_HOST);
    chip_send(0, zeros, 0);
  } else if (request == 0x8008) {
    usb_answer(&usb.is_configured, 1, wanted);
  } else if ((packet[0] & 0x9F) == 0x80 && packet[1] == 0) {
    usb_answer(zeros, 2, wanted);
  } else if (request == 0xA121) {
    usb_answer(usb.coding, sizeof usb.coding, wanted);
  } else if (request == 0x2120) {
    chip_expect(0); /* the coding follows */
  } else if (!(packet[0] & 0x80) && !wanted) {
    chip_send(0, zeros, 0); /* line state, break, features: as it likes */
  } else {
    chip_stall();
  }
}

/* The host has taken the packet of an endpoint. */
static void usb_sent(uint8_t endpoint) {
  uint16_t part = usb.left < USB_PACKET ? usb.left : USB_PACKET;
  if (endpoint == USB_TO_HOST) usb.is_sending = 0;
  if (endpoint) return;
  if (usb.address) {
    chip_address(usb.address);
    usb.address = 0;
  }
  if (usb.left || usb.ends_short) {
    if (!usb.left) usb.ends_short = 0;
    chip_send(0, usb.answer, part);
    usb.answer += part;
    usb.left = (uint16_t)(usb.left - part);
  } else {
    chip_expect(0); /* the empty packet that ends a request */
  }
}

/* A packet has come. */
static void usb_received(uint8_t endpoint, const uint8_t *data, size_t size) {
  size_t i;
  if (endpoint == USB_FROM_HOST) {
    for (i = 0; i < size && i < sizeof usb.in; i++) usb.in[i] = data[i];
    usb.waiting = (uint8_t)i;
    usb.taken = 0;
    if (!i) chip_expect(USB_FROM_HOST);
  } else if (size) {
    for (i = 0; i < size && i < sizeof usb.coding; i++) usb.coding[i] = data[i];
    chip_send(0, data, 0);
  }
}

/* Hand on what is staged; an empty packet where a full one was the last, for the host waits for a short one. */
static void usb_flush(void) {
  if (!usb.is_configured || usb.is_sending || (!usb.staged && !usb.was_full)) return;
  usb.is_sending = 1;
  usb.was_full = usb.staged == USB_PACKET;
  chip_send(USB_TO_HOST, usb.out, usb.staged);
  usb.staged = 0;
}

static size_t usb_write(const uint8_t *data, size_t size) {
  size_t sent = 0;
  if (usb.staged == USB_PACKET) usb_flush();
  while (sent < size && usb.staged < USB_PACKET) usb.out[usb.staged++] = data[sent++];
  return sent;
}

static int usb_read(void) {
  int byte;
  if (usb.taken == usb.waiting) return -1;
  byte = usb.in[usb.taken++];
  if (usb.taken == usb.waiting) chip_expect(USB_FROM_HOST);
  return byte;
}

#endif

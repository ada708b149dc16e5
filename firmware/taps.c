/* TAPS/1 device core: C99, no allocation, of the library memcpy only. */
#include "taps.h"

#include <string.h>

enum { HELLO = 1, INFO, CONFIG, ACK, NACK, START, STOP, STATUS, EVENT, DATA = 0x10 };
enum { HEADER = 8, DATA_HEADER = 16, CRC = 4, LOST_BEFORE = 1, BUTTON = 1, NO_CHANNEL = 0xFF };
enum { PER_POLL = 64 };            /* bytes looked at before what is due is sent */
enum { CRC_OF_ALL = 0x2144DF1C }; /* of a frame with its CRC */

#define NONE UINT32_MAX
#define DATA_BYTES (DATA_HEADER + TAPS_FRAME_SCANS * TAPS_SCAN_BYTES)
#define BODY_BYTES (DATA_BYTES > TAPS_TEXT_BYTES ? DATA_BYTES : TAPS_TEXT_BYTES)
typedef char frame_is_no_longer_than_8192[HEADER + BODY_BYTES + CRC <= 8192 ? 1 : -1];
typedef char overload_has_a_bit_for_each_channel[TAPS_CHANNELS <= 8 ? 1 : -1];

static const uint32_t rates[] = {TAPS_RATES};
static const char *const *info;

/* The frame that is being sent: encoded block by block as it goes out, so that it needs no second buffer. */
static struct {
  uint16_t size;     /* of the frame; 0: none */
  uint16_t at, left; /* next byte, bytes left of its block */
  uint8_t code;      /* that begins the block; 0: the delimiter */
  uint8_t coded;     /* whether it is sent */
  uint8_t raw[HEADER + BODY_BYTES + CRC];
} out;

/* The command that is being received, decoded as it comes in. */
static struct {
  uint16_t size;
  uint8_t code, left, bad, ready;
  uint8_t raw[TAPS_COMMAND_BYTES];
} in;

/* Scans between the one who takes them (writes head) and the one who sends them (writes tail). */
static struct {
  volatile uint16_t head, tail;
  volatile uint8_t losing; /* it ran over, or a scan was missed: nothing more is taken in until it is empty */
  volatile uint8_t gap;    /* scans were lost before what is in it now ... */
  volatile uint32_t resumed; /* ... which begins with this scan */
  volatile uint32_t taken, overruns;
  volatile uint8_t slots[TAPS_RING_SCANS][TAPS_SCAN_BYTES + 1]; /* the last byte: overload */
} ring;

static struct {
  uint64_t next, sent, limit; /* scan to be sent next, scans sent, scans asked for (0: endless) */
  uint32_t seq, rate, told;   /* told: scans taken when STATUS was sent last */
  uint16_t session, per_frame, peak;
  uint8_t streaming, button;
} now;

static uint8_t *put(uint8_t *to, uint32_t value, int size) {
  for (; size--; value >>= 8) *to++ = (uint8_t)value;
  return to;
}

static uint8_t *put_long(uint8_t *to, uint64_t value) {
  return put(put(to, (uint32_t)value, 4), (uint32_t)(value >> 32), 4);
}

/* CRC-32 of zlib, without its table of 1 kB. */
static uint32_t crc_of(const uint8_t *data, size_t size) {
  uint32_t crc = UINT32_MAX;
  int bit;
  while (size--) {
    crc ^= *data++;
    for (bit = 8; bit--;) crc = crc >> 1 ^ (0xEDB88320 & (0u - (crc & 1)));
  }
  return ~crc;
}

static void begin_block(void) {
  uint16_t size = 0;
  while (size < 254 && out.at + size < out.size && out.raw[out.at + size]) size++;
  out.left = size;
  out.code = (uint8_t)(size + 1);
  out.coded = 0;
}

/* Send what the board takes of the frame, in COBS. */
static void send_on(void) {
  while (out.size) {
    size_t size;
    if (!out.coded && !board_send(&out.code, 1)) return;
    out.coded = 1;
    size = out.left ? board_send(out.raw + out.at, out.left) : 0;
    out.at = (uint16_t)(out.at + size);
    out.left = (uint16_t)(out.left - size);
    if (out.left) return;
    if (!out.code) {
      out.size = 0;
    } else if (out.at == out.size) {
      out.code = out.coded = 0;
    } else {
      out.at = (uint16_t)(out.at + (out.code < 255)); /* the zero that the next code stands for */
      begin_block();
    }
  }
}

/* Make a frame of the body that stands in out.raw already. */
static void send_frame(uint8_t type, uint8_t flags, size_t size) {
  out.raw[0] = type;
  out.raw[1] = flags;
  put(put(out.raw + 2, now.session, 2), now.seq++, 4);
  put(out.raw + HEADER + size, crc_of(out.raw, HEADER + size), CRC);
  out.size = (uint16_t)(HEADER + size + CRC);
  out.at = 0;
  begin_block();
}

/* Add a text to the body; what does not fit is left out. */
static size_t add_text(size_t at, const char *text) {
  while (*text && at < BODY_BYTES) out.raw[HEADER + at++] = (uint8_t)*text++;
  return at;
}

static void send_info(void) {
  size_t size = 0;
  const char *const *piece;
  for (piece = info; *piece; piece++) size = add_text(size, *piece);
  send_frame(INFO, 0, size);
}

static void receive(uint8_t byte) {
  uint8_t is_data = in.left > 0;
  if (!byte) {
    in.ready = !in.bad && !in.left && in.size >= HEADER + CRC && crc_of(in.raw, in.size) == CRC_OF_ALL;
    in.size = in.ready ? in.size : 0;
    in.code = in.left = in.bad = 0;
    return;
  }
  if (is_data) {
    in.left--;
  } else {
    is_data = in.code && in.code < 255; /* the block before stands for a zero at its end */
    in.code = byte;
    in.left = (uint8_t)(byte - 1);
    byte = 0;
  }
  if (is_data && in.size < sizeof in.raw) {
    in.raw[in.size++] = byte;
  } else if (is_data) {
    in.bad = 1;
  }
}

static const char *behind_spaces(const char *text) {
  while (*text == ' ') text++;
  return text;
}

/* The value of a key of the JSON text; an empty text where there is none. */
static const char *value_of(const char *text, const char *key) {
  for (; *text; text++) {
    const char *at = text, *letter = key;
    while (*letter && *at == *letter) at++, letter++;
    at = behind_spaces(at);
    if (!*letter && *at == ':') return behind_spaces(at + 1);
  }
  return text;
}

/* The whole number at the key of the JSON text, maybe written as 25600.0; NONE where there is none. */
static uint32_t number_of(const char *text, const char *key) {
  uint32_t value = 0;
  int digits = 0;
  text = value_of(text, key);
  for (; *text >= '0' && *text <= '9' && digits < 10; digits++) value = value * 10 + (uint32_t)(*text++ - '0');
  if (*text == '.') {
    do text++;
    while (*text == '0');
  }
  text = behind_spaces(text);
  return digits && digits < 10 && (*text == ',' || *text == '}') ? value : NONE;
}

/* Whether a list is [0, 1, 2 ...]: all channels in their order. */
static int has_all_channels(const char *text) {
  int i;
  for (i = 0; i <= 2 * TAPS_CHANNELS; i++) {
    if (*text != (i == 2 * TAPS_CHANNELS ? ']' : i % 2 ? '0' + i / 2 : i ? ',' : '[')) return 0;
    text = behind_spaces(text + 1);
  }
  return 1;
}

/* What of a CONFIG is not taken; NULL where all is. */
static const char *configure(const char *text) {
  static const char fs[] = "\"fs\"", channels[] = "\"channels\"", format[] = "\"format\"",
                    per_frame[] = "\"samples_per_frame\"";
  uint32_t rate = number_of(text, fs), scans = number_of(text, per_frame), i = 0;
  if (now.streaming) return "CONFIG before STOP";
  while (i < sizeof rates / sizeof *rates && rates[i] != rate) i++;
  if (i == sizeof rates / sizeof *rates) return fs;
  if (!has_all_channels(value_of(text, channels))) return channels;
  if (number_of(text, format) != TAPS_FORMAT) return format;
  if (!scans || scans == NONE) return per_frame;
  now.rate = rate;
  now.per_frame = (uint16_t)(scans < TAPS_FRAME_SCANS ? scans : TAPS_FRAME_SCANS);
  return NULL;
}

static void stop(void) {
  if (now.streaming) board_stop();
  now.streaming = 0;
}

/* No scan taken, none sent. */
static void forget_scans(void) {
  stop();
  ring.head = ring.tail = 0;
  ring.losing = ring.gap = 0;
  ring.taken = ring.overruns = 0;
  now.next = now.sent = now.limit = 0;
  now.peak = 0;
}

static const char *start(size_t size) {
  if (size != 8) return "START without u64";
  forget_scans();
  while (size--) now.limit = now.limit << 8 | in.raw[HEADER + size];
  now.told = 0u - now.rate;
  now.session++;
  now.streaming = 1;
  board_start(now.rate);
  return NULL;
}

static void answer_command(void) {
  size_t size = (size_t)in.size - HEADER - CRC;
  const char *refusal = NULL;
  in.raw[HEADER + size] = 0; /* the end of a text, in place of the CRC */
  if (in.raw[0] == CONFIG) {
    refusal = configure((const char *)in.raw + HEADER);
  } else if (in.raw[0] == START) {
    refusal = start(size);
  } else if (in.raw[0] == STOP) {
    stop();
  } else if (in.raw[0] != HELLO) {
    refusal = "command";
  }
  if (in.raw[0] == HELLO) {
    send_info();
  } else {
    memcpy(out.raw + HEADER, in.raw + 4, 4);
    put(out.raw + HEADER + 4, refusal != NULL, 2);
    send_frame(refusal ? NACK : ACK, 0, add_text(6, refusal ? refusal : ""));
  }
  in.size = in.ready = 0;
}

/* Scans taken since START. */
static uint64_t taken(void) { return now.next + (uint32_t)(ring.taken - (uint32_t)now.next); }

static void send_button(void) {
  uint8_t *body = out.raw + HEADER;
  body[0] = BUTTON;
  body[1] = NO_CHANNEL;
  body[2] = now.button;
  put_long(body + 3, taken());
  send_frame(EVENT, 0, 11);
}

static void send_status(void) {
  uint8_t *to = put_long(put_long(out.raw + HEADER, taken()), now.sent);
  now.told = ring.taken;
  to = put(to, 100u * (now.peak + 1u) / TAPS_RING_SCANS, 4);
  to = put(to, ring.overruns, 4);
  put(to, 0x8000, 2); /* no thermometer */
  send_frame(STATUS, 0, 26);
}

/* Scans that wait; where some were lost before them, the count has jumped. */
static uint16_t waiting(uint8_t *flags) {
  uint16_t head = ring.head, tail = ring.tail, size = (uint16_t)(head < tail ? head + TAPS_RING_SCANS - tail : head - tail);
  if (size && ring.gap) { /* which no interrupt sets while something is in the ring */
    *flags = LOST_BEFORE;
    now.next += (uint32_t)(ring.resumed - (uint32_t)now.next);
  }
  if (size > now.peak) now.peak = size;
  return size;
}

static void send_data(uint16_t size, uint8_t flags) {
  uint8_t *body = out.raw + HEADER, *to = body + DATA_HEADER, overload = 0;
  uint16_t i, k, slot = ring.tail;
  for (i = 0; i < size; i++) {
    for (k = 0; k < TAPS_SCAN_BYTES; k++) *to++ = ring.slots[slot][k];
    overload |= ring.slots[slot][k];
    if (++slot == TAPS_RING_SCANS) slot = 0;
  }
  body = put_long(body, now.next);
  body = put(body, size | (uint32_t)TAPS_CHANNELS << 16 | (uint32_t)TAPS_FORMAT << 24, 4);
  put(body, overload, 4);
  ring.gap = 0;
  ring.tail = slot;
  now.next += size;
  now.sent += size;
  send_frame(DATA, flags, (size_t)(to - out.raw) - HEADER);
}

static void stream(void) {
  uint8_t flags = 0, is_last = ring.losing;
  uint16_t size = waiting(&flags);
  uint64_t left = now.limit - now.next;
  if (now.limit && now.next >= now.limit) {
    stop();
    return;
  }
  if (now.limit && size >= left) {
    size = (uint16_t)left;
    is_last = 1;
  }
  if (size > now.per_frame) size = now.per_frame;
  if ((uint32_t)(ring.taken - now.told) >= now.rate / 2) {
    send_status();
  } else if (size && (is_last || size == now.per_frame)) {
    send_data(size, flags);
  }
}

void taps_init(const char *const pieces[]) {
  info = pieces;
  forget_scans();
  out.size = in.size = 0;
  in.code = in.left = in.bad = in.ready = 0;
  now.seq = 0;
  now.session = 0;
  now.button = 0;
  now.rate = rates[0];
  now.per_frame = TAPS_FRAME_SCANS;
}

void taps_poll(void) {
  int byte, count;
  uint8_t pressed = (uint8_t)board_button();
  send_on();
  for (count = 0; count < PER_POLL && !in.ready && (byte = board_receive()) >= 0; count++) receive((uint8_t)byte);
  if (out.size) return;
  if (in.ready) {
    answer_command();
  } else if (pressed != now.button) {
    now.button = pressed;
    send_button();
  } else if (now.streaming) {
    stream();
  }
  send_on();
}

void taps_scan(const int32_t codes[TAPS_CHANNELS], uint8_t overload) {
  uint16_t head = ring.head, after = (uint16_t)(head + 1 < TAPS_RING_SCANS ? head + 1 : 0), k, byte, at = 0;
  uint32_t index = ring.taken;
  ring.taken = index + 1;
  if (codes && ring.losing && head == ring.tail) {
    ring.resumed = index;
    ring.gap = 1;
    ring.losing = 0;
  }
  if (!codes || ring.losing || after == ring.tail) {
    if (!ring.losing) ring.overruns = ring.overruns + 1;
    ring.losing = 1;
    return;
  }
  for (k = 0; k < TAPS_CHANNELS; k++)
    for (byte = 0; byte < TAPS_FORMAT + 2; byte++) ring.slots[head][at++] = (uint8_t)((uint32_t)codes[k] >> 8 * byte);
  ring.slots[head][at] = overload;
  ring.head = after;
}

/* fuzz COUNT SEED: so many commands, mutated before or after they are made frames, while scans come and the host is late. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "taps.h"

void library_begin(void);
size_t library_exchange(const uint8_t *in, size_t size, uint8_t *out, size_t room);
uint32_t library_rate(void);
void library_press(int is_down);

enum { LONGEST = 2000 };

static uint32_t state;

static uint32_t below(uint32_t limit) { /* xorshift32 of Marsaglia (2003) */
  state ^= state << 13;
  state ^= state >> 17;
  state ^= state << 5;
  return state % limit;
}

static size_t mutated(uint8_t *bytes, size_t size) {
  uint32_t times = below(4);
  while (times--) {
    size_t at = size ? below((uint32_t)size) : 0, length = below(below(8) ? 8 : 600);
    uint32_t kind = below(4);
    if (kind == 0 && size) {
      bytes[at] = (uint8_t)below(256);
    } else if (kind == 1 && size) {
      bytes[at] ^= (uint8_t)(1u << below(8));
    } else if (kind == 2 && size) {
      length = length < size - at ? length : size - at;
      memmove(bytes + at, bytes + at + length, size - at - length);
      size -= length;
    } else if (size + length <= LONGEST) {
      memmove(bytes + at + length, bytes + at, size - at);
      while (length--) bytes[at + length] = (uint8_t)below(256), size++;
    }
  }
  return size;
}

static size_t command(uint8_t *raw) {
  static const char *const configs[] = {
      "{\"fs\": 25600.0, \"channels\": [0, 1], \"format\": 0, \"samples_per_frame\": 512}",
      "{\"samples_per_frame\":1,\"format\":0,\"channels\":[0,1],\"fs\":51200}", "{\"fs\":", ""};
  const char *config = configs[below(4)];
  size_t i;
  raw[0] = (uint8_t[]){1, 3, 6, 7}[below(4)];
  for (i = 1; i < 8; i++) raw[i] = (uint8_t)below(256);
  if (raw[0] == 3) memcpy(raw + 8, config, strlen(config));
  if (raw[0] == 3) return 8 + strlen(config);
  if (raw[0] != 6) return 8;
  memset(raw + 8, 0, 8);
  raw[8] = (uint8_t)below(256);
  raw[9] = (uint8_t)below(3);
  return 16;
}

/* CRC and COBS, apart from those of the core. */
static size_t frame(const uint8_t *raw, size_t size, uint8_t *to) {
  uint32_t crc = UINT32_MAX, i, bit;
  uint8_t all[LONGEST + 4];
  size_t code = 0, at = 1;
  for (i = 0; i < size; i++)
    for (bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (((crc ^ raw[i] >> bit) & 1) ? 0xEDB88320u : 0);
  memcpy(all, raw, size);
  for (i = 0; i < 4; i++) all[size + i] = (uint8_t)(~crc >> 8 * i);
  for (i = 0; i < size + 4; i++) {
    if (all[i]) to[at++] = all[i];
    if (!all[i] || at - code == 255) {
      to[code] = (uint8_t)(at - code);
      code = at++;
    }
  }
  to[code] = (uint8_t)(at - code);
  to[at++] = 0;
  return at;
}

int main(int count, char **words) {
  static uint8_t raw[LONGEST], encoded[2 * LONGEST], out[1 << 16];
  unsigned long left = strtoul(count > 1 ? words[1] : "1000", NULL, 10), configured = 0, started = 0, sent = 0;
  state = (uint32_t)strtoul(count > 2 ? words[2] : "1", NULL, 10) | 1;
  library_begin();
  while (left--) {
    size_t size = command(raw);
    uint32_t scans = library_rate() ? below(below(20) ? 300 : 3000) : 0, rate = library_rate();
    if (below(2)) size = mutated(raw, size);
    size = frame(raw, size, encoded);
    if (below(3) == 0) size = mutated(encoded, size);
    library_press(below(10) == 0);
    sent += library_exchange(encoded, size, out, below(5) ? sizeof out : below(3000));
    configured += library_rate() == 51200;
    started += !rate && library_rate();
    while (scans--) {
      int32_t codes[TAPS_CHANNELS] = {(int32_t)below(65536) - 32768, (int32_t)below(3) - 1};
      taps_scan(below(5000) ? codes : NULL, (uint8_t)(below(100) == 0));
    }
  }
  printf("%lu streams begun, %lu commands at the second rate, %lu bytes sent\n", started, configured, sent);
  return !(started && configured && sent);
}

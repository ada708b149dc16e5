#include <string.h>

#include "taps.h"

static struct {
  const uint8_t *in;
  uint8_t *out;
  size_t left, room, sent;
  uint32_t rate; /* 0: stopped */
  int button;
} board;

size_t board_send(const uint8_t *data, size_t size) {
  if (size > board.room - board.sent) size = board.room - board.sent;
  memcpy(board.out + board.sent, data, size);
  board.sent += size;
  return size;
}

int board_receive(void) { return board.left ? (board.left--, *board.in++) : -1; }

void board_start(uint32_t rate) { board.rate = rate; }

void board_stop(void) { board.rate = 0; }

int board_button(void) { return board.button; }

/* Switch it on. */
void library_begin(void) {
  static const char *const info[] = {TAPS_INFO_BEGIN "LIB-1" TAPS_INFO_CLOCK "0" TAPS_INFO_CHANNELS,
                                     TAPS_CHANNEL(0, "force", 2.25e-3, "2026-01-15", 5, 0),
                                     "," TAPS_CHANNEL(1, "acceleration", 1.02e-3, "", 5, 1e-6), "]}", NULL};
  memset(&board, 0, sizeof board);
  taps_init(info);
}

/* Hand over bytes, poll until nothing moves, and return how many bytes were sent into out. */
size_t library_exchange(const uint8_t *in, size_t size, uint8_t *out, size_t room) {
  size_t before, left;
  board.in = in;
  board.left = size;
  board.out = out;
  board.room = room;
  board.sent = 0;
  do {
    before = board.sent;
    left = board.left;
    taps_poll();
  } while (board.sent != before || board.left != left);
  return board.sent;
}

/* Rate of the sampling that goes on (Hz); 0: none. */
uint32_t library_rate(void) { return board.rate; }

void library_press(int is_down) { board.button = is_down; }

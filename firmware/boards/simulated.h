/* A converter made of a table: its scans over and over, by the clock or as fast as they are sent; and what happens beside it
   at certain scans: the button is pressed (B, b), the force input overloaded (O, o), the link shut for a while (L). */
#ifndef SIMULATED_H
#define SIMULATED_H

#include "taps.h"

enum { SHUT_SCANS = 3 * TAPS_RING_SCANS, AT_ONCE = 128 };

/* What firmware/scan_table.py writes, little-endian. */
struct table {
  char magic[4];     /* "TAPS" */
  uint32_t scans;    /* in it */
  uint32_t by_clock; /* whether they come at the rate, or as fast as the host reads */
  struct {
    uint32_t scan, letter; /* scans since power came on, what happens then; letter 0: nothing */
  } events[16];
  int32_t codes[][2]; /* force, acceleration */
};

static struct {
  const struct table *table;
  uint32_t played, rate, shut; /* rate 0: stopped; shut: scans until the link is open again */
  uint8_t is_down, overload, is_blocked;
} simulated;

static const char *const simulated_info[] = {
    TAPS_INFO_BEGIN TAPS_SERIAL TAPS_INFO_CLOCK, NULL, TAPS_INFO_CHANNELS,
    TAPS_CHANNEL(0, "force", 2.25e-3, "2026-01-15", 5, 0) ",",
    TAPS_CHANNEL(1, "acceleration", 1.02e-3, "2026-01-15", 5, 0) "]}", NULL};

static void simulated_begin(const struct table *table) {
  static const char *info[sizeof simulated_info / sizeof *simulated_info];
  size_t i;
  for (i = 0; i < sizeof info / sizeof *info; i++) info[i] = simulated_info[i];
  info[1] = table->by_clock ? "0" : "null";
  simulated.table = table;
  taps_init(info);
}

static int simulated_fits(const struct table *table) {
  return table->magic[0] == 'T' && table->magic[1] == 'A' && table->magic[2] == 'P' && table->magic[3] == 'S' &&
         table->scans > 0;
}

static void simulated_event(uint32_t letter) {
  if (letter == 'B' || letter == 'b') simulated.is_down = letter == 'B';
  if (letter == 'O' || letter == 'o') simulated.overload = letter == 'O';
  if (letter == 'L') simulated.shut = SHUT_SCANS;
}

static void simulated_play(uint32_t scans) {
  const struct table *table = simulated.table;
  size_t i;
  for (; scans-- && simulated.rate; simulated.played++) {
    for (i = 0; i < sizeof table->events / sizeof *table->events; i++)
      if (table->events[i].scan == simulated.played) simulated_event(table->events[i].letter);
    taps_scan(table->codes[simulated.played % table->scans], simulated.overload);
    if (simulated.shut) simulated.shut--;
  }
}

/* Scans that are not by the clock: none while the host is late, unless it is the link that is shut. */
static void simulated_play_free(void) {
  if (!simulated.table->by_clock && (simulated.shut || !simulated.is_blocked)) simulated_play(AT_ONCE);
}

void board_start(uint32_t rate) { simulated.rate = rate; }

void board_stop(void) { simulated.rate = 0; }

int board_button(void) { return simulated.is_down; }

#endif

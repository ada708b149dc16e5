/* A program of this computer as a board: taps TABLE prints its pseudo-terminal, and runs until it is ended. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "simulated.h"

static int line = -1;

size_t board_send(const uint8_t *data, size_t size) {
  ssize_t sent = simulated.shut ? 0 : write(line, data, size);
  simulated.is_blocked = sent < (ssize_t)size;
  return sent > 0 ? (size_t)sent : 0;
}

int board_receive(void) {
  uint8_t byte;
  return read(line, &byte, 1) == 1 ? byte : -1;
}

static void fail(const char *what) {
  perror(what);
  exit(1);
}

/* Open a pseudo-terminal in raw mode. Its other end stays open here, so that a host may come and go. */
static void open_line(void) {
  struct termios mode;
  int other;
  line = posix_openpt(O_RDWR | O_NOCTTY);
  if (line < 0 || grantpt(line) || unlockpt(line)) fail("pseudo-terminal");
  other = open(ptsname(line), O_RDWR | O_NOCTTY);
  if (other < 0 || tcgetattr(other, &mode)) fail(ptsname(line));
  mode.c_iflag = mode.c_oflag = mode.c_lflag = 0;
  mode.c_cflag = (mode.c_cflag & ~(tcflag_t)(CSIZE | PARENB)) | CS8;
  if (tcsetattr(other, TCSANOW, &mode) || fcntl(line, F_SETFL, O_NONBLOCK)) fail(ptsname(line));
  printf("port %s\n", ptsname(line));
  fflush(stdout);
}

static const struct table *read_table(const char *path) {
  FILE *file = fopen(path, "rb");
  struct table *table;
  long size;
  if (!file || fseek(file, 0, SEEK_END) || (size = ftell(file)) < 0 || fseek(file, 0, SEEK_SET)) fail(path);
  table = malloc((size_t)size);
  if (!table || fread(table, 1, (size_t)size, file) != (size_t)size) fail(path);
  fclose(file);
  if ((size_t)size < sizeof *table || !simulated_fits(table) ||
      table->scans > ((size_t)size - sizeof *table) / sizeof *table->codes) {
    fprintf(stderr, "%s is no table of scans; firmware/scan_table.py makes one\n", path);
    exit(2);
  }
  return table;
}

static double seconds(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* The scans that are due by the clock. */
static void play_by_clock(void) {
  static double last;
  static double due;
  double time = seconds();
  due = simulated.rate ? due + (time - last) * simulated.rate : 0;
  last = time;
  if (!simulated.table->by_clock || due < 1) return;
  simulated_play((uint32_t)due);
  due -= (uint32_t)due;
}

/* Wait for the host, a millisecond at most; not at all where there is more to send. */
static void wait_a_little(void) {
  int is_busy = simulated.rate && !simulated.table->by_clock && !simulated.is_blocked;
  struct pollfd end = {line, POLLIN, 0};
  if (simulated.is_blocked) end.events |= POLLOUT;
  poll(&end, 1, is_busy ? 0 : 1);
}

int main(int count, char **words) {
  if (count != 2) {
    fprintf(stderr, "usage: %s TABLE\n", words[0]);
    return 2;
  }
  simulated_begin(read_table(words[1]));
  open_line();
  for (;;) {
    wait_a_little();
    play_by_clock();
    simulated_play_free();
    taps_poll();
  }
}

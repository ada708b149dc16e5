/* A Cortex-M3 of QEMU's board mps2-an385: UART0 to the host, UART1 to the bench, the table of scans in its 16 MB of RAM. */
#include "simulated.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define UART_DATA(base) REGISTER(base)
#define UART_STATE(base) REGISTER((base) + 4u) /* bit 0: cannot send, bit 1: has received */
#define UART_CONTROL(base) REGISTER((base) + 8u)
#define UART_DIVISOR(base) REGISTER((base) + 0x10u)
#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_VALUE REGISTER(0xE000E018u)
enum { HOST = 0x40004000, BENCH = 0x40005000, TABLE = 0x21000000, CLOCK = 25000000, TICKS = 1000 };

extern uint32_t bss_begin[], bss_end[], stack_end[];
void reset(void);
void tick(void);

static volatile uint32_t ticks;

__attribute__((section(".vectors"), used)) static const struct {
  uint32_t *stack;
  void (*handlers[15])(void);
} vectors = {stack_end, {[0] = reset, [14] = tick}};

size_t board_send(const uint8_t *data, size_t size) {
  size_t sent = 0;
  while (sent < size && !simulated.shut && !(UART_STATE(HOST) & 1)) UART_DATA(HOST) = data[sent++];
  simulated.is_blocked = sent < size;
  return sent;
}

static int receive_from(uint32_t uart) { return UART_STATE(uart) & 2 ? (int)(UART_DATA(uart) & 0xFF) : -1; }

int board_receive(void) { return receive_from(HOST); }

/* A thousand times a second: the scans that are due by the clock. */
void tick(void) {
  static uint32_t due;
  ticks = ticks + 1;
  if (!simulated.table->by_clock) return;
  for (due += simulated.rate; due >= TICKS; due -= TICKS) simulated_play(1);
}

static void open_uart(uint32_t uart) {
  UART_DIVISOR(uart) = 16;
  UART_CONTROL(uart) = 3;
}

void reset(void) {
  const struct table *table = (const struct table *)TABLE;
  uint32_t *word;
  for (word = bss_begin; word < bss_end; word++) *word = 0;
  open_uart(HOST);
  open_uart(BENCH);
  while (!simulated_fits(table)) continue; /* QEMU was given none: there is nothing to measure */
  simulated_begin(table);
  SYSTICK_RELOAD = CLOCK / TICKS - 1;
  SYSTICK_VALUE = 0;
  SYSTICK_CONTROL = 7;
  for (;;) {
    simulated_bench(receive_from(BENCH));
    simulated_play_free();
    taps_poll();
    if (!simulated.rate || simulated.table->by_clock || simulated.is_blocked) __asm__ volatile("wfi"); /* a tick at the latest */
  }
}

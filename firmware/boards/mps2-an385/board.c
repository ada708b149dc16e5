/* A Cortex-M3 of QEMU's board mps2-an385: UART0 to the host, the table of scans in its 16 MB of RAM. */
#include "simulated.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define UART_DATA REGISTER(0x40004000u)
#define UART_STATE REGISTER(0x40004004u) /* bit 0: cannot send, bit 1: has received */
#define UART_CONTROL REGISTER(0x40004008u)
#define UART_DIVISOR REGISTER(0x40004010u)
#define COUNTER REGISTER(0x40028018u) /* of the FPGA: PRESCALED Hz / (PRESCALE + 1) */
#define PRESCALE REGISTER(0x4002801Cu)
#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_VALUE REGISTER(0xE000E018u)
enum { TABLE = 0x21000000, CLOCK = 25000000, TICKS = 1000, PRESCALED = 25000000, DIVIDED = 25 };

extern uint32_t bss_begin[], bss_end[], stack_end[];
void reset(void);
void tick(void);

__attribute__((section(".vectors"), used)) static const struct {
  uint32_t *stack;
  void (*handlers[15])(void);
} vectors = {stack_end, {[0] = reset, [14] = tick}};

size_t board_send(const uint8_t *data, size_t size) {
  size_t sent = 0;
  while (sent < size && !simulated.shut && !(UART_STATE & 1)) UART_DATA = data[sent++];
  simulated.is_blocked = sent < size;
  return sent;
}

int board_receive(void) { return UART_STATE & 2 ? (int)(UART_DATA & 0xFF) : -1; }

/* A thousand times a second, or late: the scans that are due by the counter. */
void tick(void) {
  static uint32_t last;
  static uint64_t due;
  uint32_t count = COUNTER, second = PRESCALED / DIVIDED;
  due = simulated.rate ? due + (uint64_t)(count - last) * simulated.rate : 0;
  last = count;
  if (!simulated.table->by_clock) return;
  simulated_play((uint32_t)(due / second));
  due %= second;
}

void reset(void) {
  const struct table *table = (const struct table *)TABLE;
  uint32_t *word;
  for (word = bss_begin; word < bss_end; word++) *word = 0;
  UART_DIVISOR = 16;
  UART_CONTROL = 3;
  PRESCALE = DIVIDED - 1;
  while (!simulated_fits(table)) continue; /* QEMU was given none: there is nothing to measure */
  simulated_begin(table);
  SYSTICK_RELOAD = CLOCK / TICKS - 1;
  SYSTICK_VALUE = 0;
  SYSTICK_CONTROL = 7;
  for (;;) {
    simulated_play_free();
    taps_poll();
    if (!simulated.rate || simulated.table->by_clock || simulated.is_blocked) __asm__ volatile("wfi"); /* a tick at the latest */
  }
}

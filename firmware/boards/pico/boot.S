/* The second stage of the RP2040's start (2.8.1.3.1): the first 256 bytes of the flash, run from RAM. It maps the flash for
   plain reading (command 03h, any chip; 4.10) and goes on at the vectors behind it. image.py adds its checksum. */
  .syntax unified
  .cpu cortex-m0plus
  .thumb
  .section .boot, "ax"
  ldr r3, =0x18000000   /* the SSI */
  movs r1, #0
  str r1, [r3, #0x08]   /* off */
  movs r1, #4
  str r1, [r3, #0x14]   /* a quarter of the system clock */
  ldr r1, =0x001F0300   /* 32 bits a frame, read as an EEPROM is */
  str r1, [r3, #0x00]
  movs r1, #0
  str r1, [r3, #0x04]   /* one frame at a time */
  ldr r1, =0x03000218   /* command 03h of 8 bits, address of 24 */
  ldr r0, =0x180000F4
  str r1, [r0]
  movs r1, #1
  str r1, [r3, #0x08]   /* on */
  ldr r0, =0x10000100   /* the vectors */
  ldr r1, =0xE000ED08
  str r0, [r1]
  ldmia r0!, {r1, r2}
  msr msp, r1
  bx r2
  .ltorg

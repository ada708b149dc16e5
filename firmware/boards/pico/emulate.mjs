// The Pico in rp2040js, its USB serial port on a TCP port of this computer: node emulate.mjs TAPS.BIN TABLE
// (npm install rp2040js where it is run). TABLE: of scan_table.py, codes of 12 bits. SIGUSR2 presses the button for 50 ms.
import { readFileSync } from "node:fs";
import { createServer } from "node:net";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const require = createRequire(pathToFileURL(process.cwd() + "/"));
const { ConsoleLogger, LogLevel, Simulator, USBCDC } = await import(pathToFileURL(require.resolve("rp2040js")));
const [, , binary, table] = process.argv;
const simulator = new Simulator();
const chip = simulator.rp2040;
chip.logger = new ConsoleLogger(LogLevel.Error);
const image = readFileSync(binary);
chip.flash.set(image);

// Its ROM and second stage are left out: straight to the vectors behind them.
const vectors = new DataView(image.buffer, image.byteOffset + 256);
chip.core.VTOR = 0x10000100;
chip.core.SP = vectors.getUint32(0, true);
chip.core.PC = vectors.getUint32(4, true) & ~1;

// rp2040js 1.4.1 never leaves input 0 of the round robin (setter of activeChannel): the inputs are taken in turn here.
const scans = readFileSync(table);
const count = scans.readUInt32LE(4);
let scan = 0;
let input = 0;
chip.adc.onADCRead = () => {
  const code = scans.readInt32LE(140 + 8 * (scan % count) + 4 * input) + 2048;
  scan += input;
  input = 1 - input;
  chip.clock.createAlarm(() => chip.adc.completeADCRead(code, false)).schedule(2000);
};

const button = chip.gpio[15];
button.setInputValue(true);
process.on("SIGUSR2", () => {
  button.setInputValue(false);
  chip.clock.createAlarm(() => button.setInputValue(true)).schedule(50e6);
});

const serial = new USBCDC(chip.usbCtrl);
const server = createServer((host) => {
  host.on("data", (data) => data.forEach((byte) => serial.sendSerialByte(byte)));
  serial.onSerialData = (data) => host.write(data);
  host.on("error", () => host.destroy());
});
serial.onDeviceConnected = () =>
  server.listen(0, "127.0.0.1", () => console.log(`port socket://127.0.0.1:${server.address().port}`));
simulator.execute();

// The token and the two ways to the server: a feed that reconnects by itself, and requests that may alter something.
const RETRY_MS = 1000;
const SILENCE_MS = 3000;
const GOING_AWAY = 1001;

const given = new URLSearchParams(location.hash.slice(1)).get("token");
if (given) {
  sessionStorage.setItem("token", given);
  history.replaceState(null, "", location.pathname);
}
const token = sessionStorage.getItem("token") ?? "";

export async function ask(path, method = "GET", body = undefined) {
  const headers = { Authorization: `Bearer ${token}` };
  let response;
  try {
    response = await fetch(path, { method, headers, body: body instanceof Blob ? body : body && JSON.stringify(body) });
  } catch {
    throw new Error("No connection to lobewatch");
  }
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Error(answer.error ?? `lobewatch reported error ${response.status}`);
  return answer;
}

// Calls onState and onPlots with what comes, and onLost(sentence, ended) when the connection is gone.
export function follow(onState, onPlots, onLost) {
  const address = new URL("feed", location.href);
  address.protocol = "ws:";
  const socket = new WebSocket(address, ["lobewatch", `token.${token}`]);
  socket.binaryType = "arraybuffer";
  let watchdog;
  const alive = () => {
    clearTimeout(watchdog);
    watchdog = setTimeout(() => lost(false), SILENCE_MS);
  };
  const lost = async (ended) => {
    clearTimeout(watchdog);
    socket.onmessage = socket.onclose = null;
    socket.close();
    onLost("Check that lobewatch is running. This page reconnects by itself.", ended);
    setTimeout(() => follow(onState, onPlots, onLost), RETRY_MS);
    await ask("access").catch((error) => onLost(error.message, ended));
  };
  socket.onmessage = ({ data }) => {
    alive();
    if (typeof data !== "string") onPlots(unpack(data));
    else if (data !== "{}") onState(JSON.parse(data));
  };
  socket.onclose = ({ code }) => lost(code === GOING_AWAY);
  alive();
}

// The layout is that of encode_curves in lobewatch/screen/live_feed.py.
function unpack(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const curves = { band: header.band };
  let offset = 4 + size;
  for (const [name, count] of header.curves) {
    curves[name] = Array.from(new Float32Array(buffer, offset, count), (v) => (Number.isFinite(v) ? v : null));
    offset += 4 * count;
  }
  return curves;
}

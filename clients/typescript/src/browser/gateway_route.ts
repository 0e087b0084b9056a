import { FrameReader } from "../client/frame_reader.js";
import type { Route, Transport, TransportListener } from "../client/transport.js";

/** The gateway's sub-protocol: the bytes of a TCP connection. */
const subprotocol = "rtpm.stream.v1";
// A connection with more bytes that the gateway does not take is ended.
const unsentMax = 32 * 1024 * 1024;
// The gateway learns of a new name within a second.
const attemptMax = 8;
const attemptIntervalMs = 250;

/** A WebSocket to the console's gateway for each channel. */
export class GatewayRoute implements Route {
  readonly medium = "stream";
  readonly name: string;
  trouble: string | undefined;

  /**
   * @param gateway  with the token
   * @param to  "names", or host and port as in the server's address
   */
  constructor(
    private readonly gateway: URL,
    private readonly to: string,
  ) {
    this.name = `${to} through ${gateway.host}`;
  }

  async connect(listener: TransportListener): Promise<Transport> {
    const url = new URL(this.gateway);
    url.searchParams.set("to", this.to);
    if (!url.searchParams.has("token")) {
      throw new Error("there is no token: open the page by the URL that rtpm-console printed");
    }
    for (let attempt = 1; ; attempt += 1) {
      try {
        return await open(url, listener);
      } catch (error) {
        this.trouble = (error as Error).message;
        if (attempt === attemptMax) throw error;
        await new Promise((resolve) => setTimeout(resolve, attemptIntervalMs));
      }
    }
  }
}

function open(url: URL, listener: TransportListener): Promise<Transport> {
  const socket = new WebSocket(url, subprotocol);
  socket.binaryType = "arraybuffer";
  const reader = new FrameReader(false);
  let isOpen = false;
  const end = (reason: string): void => {
    if (!isOpen) return;
    isOpen = false;
    socket.close();
    listener.onEnd(reason);
  };
  const transport: Transport = {
    isOnHost: false,
    send(frame) {
      if (!isOpen) return;
      socket.send(frame as Uint8Array<ArrayBuffer>); // no frame is in shared memory
      if (socket.bufferedAmount > unsentMax) end("the gateway does not take what is sent");
    },
    close() {
      isOpen = false;
      socket.close();
    },
  };
  return new Promise((resolve, reject) => {
    socket.addEventListener("open", () => {
      isOpen = true;
      resolve(transport);
    });
    socket.addEventListener("message", ({ data }) => {
      if (!(data instanceof ArrayBuffer)) return end("the gateway sent a text");
      const fault = reader.read(new Uint8Array(data), (frame) => {
        if (isOpen) listener.onFrame(frame);
        return isOpen;
      });
      if (fault !== undefined) end("the server does not keep to the protocol");
    });
    // A handshake that fails ends with an error, and not everywhere with `close`.
    const refuse = (): void =>
      reject(new Error("the gateway refuses it: is the token right, and the server bound?"));
    socket.addEventListener("error", refuse);
    socket.addEventListener("close", () => {
      end("the gateway ended the connection");
      refuse();
    });
  });
}

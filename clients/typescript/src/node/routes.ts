import { createSocket, type Socket as UdpSocket } from "node:dgram";
import { connect as connectTcp, isIPv6, type Socket } from "node:net";
import type { Route, Transport, TransportListener } from "../client/transport.js";
import { hostInUrl } from "../core/url.js";
import { FrameReader } from "../client/frame_reader.js";

// The receive buffer of a client's UDP socket: two windows of fragments for each of 8 calls.
const udpBufferSize = 1024 * 1024;

function isLoopback(address: string): boolean {
  return address.startsWith("127.") || address === "::1";
}

/** A UDP socket of its own for each channel, connected, so that it hears its server only. */
export class UdpRoute implements Route {
  readonly medium = "datagram";
  readonly name: string;

  /** @param host  numeric */
  constructor(
    private readonly host: string,
    private readonly port: number,
  ) {
    this.name = `${hostInUrl(host)}:${port} over UDP`;
  }

  connect(listener: TransportListener): Promise<Transport> {
    const type = isIPv6(this.host.split("%")[0]!) ? "udp6" : "udp4";
    const socket = createSocket({ type, recvBufferSize: udpBufferSize });
    return new Promise((resolve, reject) => {
      socket.once("error", reject);
      socket.connect(this.port, this.host, () => {
        socket.removeListener("error", reject);
        // An ICMP error is no proof that the server is gone: the call is repeated.
        socket.on("error", () => undefined);
        socket.on("message", (frame) => listener.onFrame(frame));
        resolve(transportOf(socket, this.host));
      });
    });
  }
}

function transportOf(socket: UdpSocket, host: string): Transport {
  let isOpen = true;
  return {
    isOnHost: isLoopback(host) || socket.address().address === host,
    send: (frame) => {
      if (isOpen) socket.send(frame, () => undefined);
    },
    close: () => {
      if (isOpen) socket.close();
      isOpen = false;
    },
  };
}

/** Writes frames that follow each other at once in one system call. */
export function writeTogether(socket: Socket, frame: Uint8Array): void {
  if (socket.writableCorked === 0) {
    socket.cork();
    process.nextTick(() => socket.uncork());
  }
  socket.write(frame);
}

/** A TCP connection for each channel. */
export class TcpRoute implements Route {
  readonly medium = "stream";
  readonly name: string;

  /** @param host  numeric */
  constructor(
    private readonly host: string,
    private readonly port: number,
    private readonly isSealed: boolean,
  ) {
    this.name = `${hostInUrl(host)}:${port} over TCP`;
  }

  connect(listener: TransportListener): Promise<Transport> {
    const socket = connectTcp({ host: this.host, port: this.port, noDelay: true });
    const reader = new FrameReader(this.isSealed);
    return new Promise((resolve, reject) => {
      let reason = "the connection ended";
      let isOpen = true;
      const close = (): void => {
        isOpen = false;
        // CLOSE still goes out; a peer that does not answer is cut off.
        socket.end();
        socket.setTimeout(1000, () => socket.destroy());
      };
      socket.on("error", (error) => {
        reason = error.message;
        reject(error);
      });
      socket.on("close", () => {
        if (isOpen) listener.onEnd(reason);
        isOpen = false;
      });
      socket.on("data", (chunk) => {
        const fault = reader.read(chunk, (frame) => {
          listener.onFrame(frame);
          return isOpen;
        });
        if (fault !== undefined) socket.destroy();
      });
      socket.on("connect", () => {
        resolve({
          isOnHost: isLoopback(this.host) || socket.localAddress === this.host,
          send: (frame) => {
            if (isOpen) writeTogether(socket, frame);
          },
          close,
        });
      });
    });
  }
}

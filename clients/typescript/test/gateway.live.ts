import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { request } from "node:http";
import { createServer, type Server as TcpServer } from "node:net";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { DeviceClient, DeviceInterface } from "../idl/device.rtpm.js";
import { InteropClient, InteropInterface, interopSkeleton } from "../idl/tests/interop.rtpm.js";
import { MeasuredEvent } from "../idl/tests/interop.rtpm.js";
import * as browser from "../src/browser/index.js";
import { Node, Server } from "../src/index.js";
import { InteropServer } from "./interop/serve.js";
import { endAll, programFolder, run, start } from "./support/programs.js";

// The part for pages, beside a real rtpm-console and RTPM's other programs.

const token = "token-of-the-gateway-test";

// rtpm-console is left out where Boost.Beast is not installed.
const hasConsole = programFolder !== undefined && existsSync(join(programFolder, "rtpm-console"));
const skip = hasConsole ? false : "SKIPPED: rtpm-console is not built";

describe("through the console's gateway", { skip }, () => {
  let registry = "";
  let gateway = "";
  let readOnly = "";
  let own: Node;
  let page: browser.Node;

  before(async () => {
    registry = await start("rtpm-registryd", ["--port", "0"], /(rtpm:\S+)/);
    const events = ["--registry", registry, "--port", "0"];
    await start("rtpm-eventd", events, /(rtpm:\S+)/);
    const devices = ["--registry", registry, "--events", "none", "--stops", "none"];
    await start("rtpm-deviced", [...devices, "--settings", ""], /(serving lab\/arm0)/);
    const startConsole = (...args: string[]): Promise<string> => {
      const options = ["--port", "0", "--registry", registry, "--incidents", "none", ...args];
      return start("rtpm-console", options, /(http:\/\/[^/ ]+)/, { RTPM_CONSOLE_TOKEN: token });
    };
    gateway = `${await startConsole()}/gateway`;
    readOnly = `${await startConsole("--read-only")}/gateway`;
    own = new Node({ registries: [registry], deadlineMs: 5000 });
    page = new browser.Node({ gateway, token, deadlineMs: 5000 });
  });
  after(async () => {
    await page.close();
    await own.close();
    await endAll();
  });

  test("a device by its name", async () => {
    const arm = await browser.Device.open(page, "lab/arm0");
    const sequences: bigint[] = [];
    for await (const { sequence } of arm.samples({ intervalMs: 5 })) {
      sequences.push(sequence);
      if (sequences.length === 5) break;
    }
    assert.deepEqual(new Set(sequences).size, 5);
    const standing = { lease: 0n };
    assert.equal((await arm.client.leaseState(standing)).state, 0, "nobody asked for a lease");
    {
      await using lease = await arm.acquire({ patienceMs: 2000 });
      await lease.force({ x: 0, y: 0, z: 1 }, 20, { deadlineMs: 5000 });
    }
  });

  test("a lease ends when its page is gone", async () => {
    const other = new browser.Node({ gateway, token, deadlineMs: 5000 });
    const arm = await browser.Device.open(other, "lab/arm0");
    const lease = await arm.acquire({ patienceMs: 2000 });
    await other.close(); // as a page that is left: it releases nothing
    const device = new DeviceClient(await own.bind("lab/arm0", DeviceInterface));
    for (let i = 0; i < 500; i += 1) {
      if ((await device.leaseState(lease.holder, { deadlineMs: 5000 })).state !== 1) break;
      await sleep(10);
    }
    assert.notEqual((await device.leaseState(lease.holder, { deadlineMs: 5000 })).state, 1);
    await lease.close();
  });

  test("calls, large ones, streams and events of a server of ours", async () => {
    const server = await Server.listen();
    server.add("interop", interopSkeleton(new InteropServer(own)));
    const kept = await own.names.bindName(
      "page/interop",
      server.addressOf("interop"),
      InteropInterface,
    );
    const interop = new InteropClient(await page.bind("page/interop", InteropInterface));
    const bytes = Uint8Array.from({ length: 1_000_000 }, (_, i) => i ^ (i >> 8));
    const reply = await interop.echoBytes({ bytes });
    assert.ok(Buffer.from(reply.bytes).equals(bytes));
    let next = 0;
    for await (const { number } of interop.countUp({ count: 500, padding: 100, failure: "" })) {
      assert.equal(number, next);
      next += 1;
    }
    assert.equal(next, 500);

    const { EventConsumer, EventFilter } = browser;
    const filter = EventFilter.of(MeasuredEvent);
    await using consumer = await EventConsumer.open(page, "rtpm/events", { filter });
    await interop.emit({ first: 7, count: 2, text: "page" });
    const levels: number[] = [];
    for await (const event of consumer) {
      levels.push(event.value(MeasuredEvent).level);
      if (levels.length === 2) break;
    }
    assert.deepEqual(levels, [7, 8]);

    await server.close();
    await assert.rejects(interop.add({ count: 0 }, { deadlineMs: 300 }), { name: "CallError" });
    await kept.close();
  });

  // The answer to a handshake with these headers.
  function statusOf(url: string, headers: Record<string, string> = {}): Promise<number> {
    const handshake = {
      Connection: "Upgrade",
      Upgrade: "websocket",
      "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
      "Sec-WebSocket-Version": "13",
      "Sec-WebSocket-Protocol": "rtpm.stream.v1",
    };
    return new Promise((resolve, reject) => {
      const asked = request(url, { headers: { ...handshake, ...headers } });
      asked.on("response", (response) => {
        response.resume();
        resolve(response.statusCode ?? 0);
      });
      asked.on("upgrade", (_, socket) => {
        socket.destroy();
        resolve(101);
      });
      asked.on("error", reject);
      asked.end();
    });
  }

  test("only pages of the console, with its token, to servers of its registry", async () => {
    const to = (place: string): string => `${gateway}?token=${token}&to=${place}`;
    const { host } = new URL(gateway);
    assert.equal(await statusOf(to("names"), { Origin: `http://${host}` }), 101);
    assert.equal(await statusOf(to("names"), { Origin: "http://elsewhere.org" }), 403);
    assert.equal(await statusOf(to("names"), { Host: "elsewhere.org" }), 403);
    assert.equal(await statusOf(`${gateway}?to=names`), 403);
    assert.equal(await statusOf(`${gateway}?token=${token}x&to=names`), 403);
    assert.equal(await statusOf(`${readOnly}?token=${token}&to=names`), 403);
    assert.equal(await statusOf(to("names"), { "Sec-WebSocket-Protocol": "other" }), 400);
    for (const place of ["", "nothing", "127.0.0.1:22", `${host}`, "127.0.0.1", "[::1]:80"]) {
      assert.equal(await statusOf(to(place)), 404, place);
    }
  });

  test("a page with a wrong token, or without, learns why", async () => {
    for (const wrong of [`${token}x`, ""]) {
      await using other = new browser.Node({ gateway, token: wrong });
      await assert.rejects(browser.Device.open(other, "lab/arm0"), /cannot be reached: .* token/);
    }
  });

  test("a server that is gone, and one that does not speak", async () => {
    const silent: TcpServer = createServer();
    await new Promise<void>((resolve) => silent.listen(0, "127.0.0.1", resolve));
    const address = silent.address();
    const port = typeof address === "object" && address !== null ? address.port : 0;
    const url = `rtpm://127.0.0.1:${port}/arm`;
    const kept = await own.names.bindName("page/silent", url, DeviceInterface);
    const open = browser.Device.open(page, "page/silent", { deadlineMs: 1500 });
    await assert.rejects(open, { code: "unreachable" });
    const place = `${gateway}?token=${token}&to=127.0.0.1:${port}`;
    assert.equal(await statusOf(place), 101);
    silent.close();
    await sleep(10);
    assert.equal(await statusOf(place), 502);
    await kept.close();
  });

  test("as many connections as there may be, and no more", async () => {
    const url = `${gateway.replace("http", "ws")}?token=${token}&to=names`;
    const sockets: WebSocket[] = [];
    const open = (): Promise<boolean> =>
      new Promise((resolve) => {
        const socket = new WebSocket(url, "rtpm.stream.v1");
        sockets.push(socket);
        socket.onopen = () => resolve(true);
        socket.onerror = () => resolve(false);
      });
    const isFull = async (): Promise<boolean> =>
      (await statusOf(`${gateway}?token=${token}&to=names`)) === 503;
    while (sockets.length < 80 && !(await isFull())) await open();
    assert.ok(sockets.length >= 50 && sockets.length <= 64, `${sockets.length} were opened`);
    for (const socket of sockets) socket.close();
    for (let i = 0; i < 200; i += 1) {
      if ((await statusOf(`${gateway}?token=${token}&to=names`)) === 101) break;
      await sleep(20);
    }
    assert.match(await run("rtpm", ["list"], registry), /lab\/arm0/);
    const arm = await browser.Device.open(page, "lab/arm0");
    assert.ok((await arm.read()).sequence > 0n);
  });

  test("a text, and a message beyond the limit, cost the connection", async () => {
    const url = `${gateway.replace("http", "ws")}?token=${token}&to=names`;
    for (const message of ["text", new Uint8Array(300_000)]) {
      const socket = new WebSocket(url, "rtpm.stream.v1");
      await new Promise((resolve) => (socket.onopen = resolve));
      socket.send(message);
      await new Promise((resolve) => (socket.onclose = resolve));
    }
  });
});

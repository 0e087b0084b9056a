package org.rtpm.conform;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.HexFormat;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.ConcurrentHashMap;
import java.util.concurrent.atomic.AtomicInteger;
import org.rtpm.PrivateKey;
import org.rtpm.PublicKey;
import org.rtpm.Refusal;
import org.rtpm.Server;
import org.rtpm.ServerOptions;
import org.rtpm.Status;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.values.CallContext;
import org.rtpm.values.Codec;
import org.rtpm.values.Interface;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;
import org.rtpm.values.Operation;
import org.rtpm.values.Skeleton;

/** A server for spec/conform/rtpm-conform, by its line protocol; see that folder's README. */
public final class ServerSubject {
  private static final Codec<byte[]> BYTES =
      new Codec<>() {
        @Override
        public byte[] encode(byte[] value) {
          return value;
        }

        @Override
        public byte[] decode(ByteBuffer bytes) {
          byte[] value = new byte[bytes.remaining()];
          bytes.duplicate().get(value);
          return value;
        }
      };

  private static final Method<byte[], byte[]> PLAIN =
      new Method<>("run", 2, Kind.CALL, BYTES, BYTES);

  private final Map<String, CompletableFuture<byte[]>> running = new ConcurrentHashMap<>();
  private final Map<String, CallContext> contexts = new ConcurrentHashMap<>();
  private final AtomicInteger runs = new AtomicInteger();
  private Server server;

  public static void main(String[] arguments) throws IOException {
    if (arguments.length == 1 && arguments[0].equals("--count")) {
      new ServerSubject().serveCounting(ServerOptions.DEFAULT);
      return;
    }
    if (arguments.length == 2 && arguments[0].equals("--sealed")) {
      PrivateKey key = PrivateKey.draw();
      say(key.publicKey().toString());
      new ServerSubject()
          .serveCounting(
              ServerOptions.DEFAULT.withKey(key, Set.of(PublicKey.parse(arguments[1])), false));
      return;
    }
    new ServerSubject().talk();
  }

  private static synchronized void say(String line) {
    System.out.println(line);
    System.out.flush();
  }

  private void talk() throws IOException {
    BufferedReader in =
        new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
    for (String line; (line = in.readLine()) != null && !line.equals("quit"); ) {
      try {
        handle(new ArrayList<>(List.of(line.split(" "))));
      } catch (RuntimeException e) {
        say("cannot " + e);
      }
    }
    System.exit(0);
  }

  private static Map<String, String> values(List<String> words) {
    Map<String, String> values = new HashMap<>();
    for (String word : words) {
      int equals = word.indexOf('=');
      if (equals > 0) {
        values.put(word.substring(0, equals), word.substring(equals + 1));
      }
    }
    return values;
  }

  private void handle(List<String> words) {
    switch (words.get(0)) {
      case "setup" -> setUp(values(words));
      case "counters" -> {
        StringBuilder counters = new StringBuilder("counters");
        for (DropReason reason : DropReason.values()) {
          counters.append(' ').append(reason).append('=').append(
              server.dropped(reason.toString()));
        }
        say(counters.toString());
      }
      case "does" -> does(words);
      default -> say("cannot " + words.get(0));
    }
  }

  private static int number(Map<String, String> values, String name, int otherwise) {
    return values.containsKey(name) ? Integer.decode(values.get(name)) : otherwise;
  }

  private void setUp(Map<String, String> values) {
    String address = values.get("address");
    int colon = address.lastIndexOf(':');
    List<ServerOptions.LaneOptions> lanes = new ArrayList<>();
    for (String band : values.getOrDefault("bands", "0-32767").split(",")) {
      String[] ends = band.split("-");
      lanes.add(
          new ServerOptions.LaneOptions(Integer.parseInt(ends[0]), Integer.parseInt(ends[1]), 2));
    }
    ServerOptions options =
        ServerOptions.DEFAULT
            .withHosts(address.substring(0, colon))
            .withPort(Integer.parseInt(address.substring(colon + 1)))
            .withLanes(lanes.toArray(new ServerOptions.LaneOptions[0]))
            .withCeiling(number(values, "ceiling", 32767))
            .withLimits(
                number(values, "session_count_max", 256),
                number(values, "message_size_max", 4 * 1024 * 1024),
                number(values, "large_message_count_max", 32));
    server = Server.open(options);
    server.serve("lab/arm0", arm(this::run));
    Thread watcher = new Thread(this::watchCancelled);
    watcher.setDaemon(true);
    watcher.start();
    say("ready address=" + address.substring(0, colon) + ":" + server.port());
  }

  private static Skeleton arm(Operation.Function<byte[], CompletableFuture<byte[]>> function) {
    Interface description = new Interface("lab.Arm", 0x0123456789abcdefL, List.of(PLAIN));
    return new Skeleton(
        description,
        List.of(new Operation.Deferred<>(PLAIN, (bytes, context) -> function.run(bytes, context))));
  }

  private CompletableFuture<byte[]> run(byte[] payload, CallContext context) {
    String call = "c" + runs.incrementAndGet();
    CompletableFuture<byte[]> result = new CompletableFuture<>();
    running.put(call, result);
    contexts.put(call, context);
    say("sees run " + call + " method=2 payload=" + HexFormat.of().formatHex(payload));
    return result;
  }

  private void watchCancelled() {
    while (true) {
      contexts.forEach(
          (call, context) -> {
            if (context.isCancelled() && contexts.remove(call) != null) {
              say("sees cancelled " + call);
            }
          });
      try {
        Thread.sleep(2);
      } catch (InterruptedException e) {
        return;
      }
    }
  }

  private void does(List<String> words) {
    Map<String, String> values = values(words);
    switch (words.get(1)) {
      case "stop" -> server.close();
      case "receipt" -> {
        if (!values.get("status").equals("ok")) {
          say("cannot");
        }
      }
      case "complete" -> {
        contexts.remove(words.get(2));
        complete(running.remove(words.get(2)), values);
      }
      default -> say("cannot " + words.get(1));
    }
  }

  private static void complete(CompletableFuture<byte[]> call, Map<String, String> values) {
    Status status = Status.valueOf(values.get("status").toUpperCase(Locale.ROOT));
    byte[] payload = HexFormat.of().parseHex(values.getOrDefault("payload", ""));
    if (status == Status.OK) {
      call.complete(payload);
    } else {
      call.completeExceptionally(
          new Refusal(status, new String(payload, StandardCharsets.UTF_8)));
    }
  }

  /** Serves what "Test a server" of rtpm-conform's README says, until it is ended. */
  private void serveCounting(ServerOptions options) {
    server = Server.open(options);
    server.serve(
        "lab/arm0",
        arm(
            (bytes, context) ->
                CompletableFuture.completedFuture(
                    ByteBuffer.allocate(8)
                        .order(java.nio.ByteOrder.LITTLE_ENDIAN)
                        .putLong(runs.incrementAndGet())
                        .array())));
    say("127.0.0.1:" + server.port());
    try {
      Thread.currentThread().join();
    } catch (InterruptedException e) {
      server.close();
    }
  }
}

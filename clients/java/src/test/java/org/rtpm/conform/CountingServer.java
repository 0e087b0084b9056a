package org.rtpm.conform;

import static org.rtpm.BytesCodec.BYTES;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.Arrays;
import java.util.List;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.atomic.AtomicLong;
import java.util.stream.Collectors;
import org.rtpm.PrivateKey;
import org.rtpm.PublicKey;
import org.rtpm.Server;
import org.rtpm.ServerOptions;
import org.rtpm.values.Interface;
import org.rtpm.values.Kind;
import org.rtpm.values.Method;
import org.rtpm.values.Operation;
import org.rtpm.values.Skeleton;

/**
 * The server of "Test a server" in spec/conform/README.md, by the public interface. With public
 * keys, in Base64, as its arguments it seals, admits those alone, and prints its own.
 */
public final class CountingServer {
  private CountingServer() {}

  public static void main(String[] arguments) throws InterruptedException {
    ServerOptions options = ServerOptions.DEFAULT;
    if (arguments.length > 0) {
      PrivateKey key = PrivateKey.draw();
      System.out.println(key.publicKey().toString().split(" ")[1]);
      Set<PublicKey> admitted =
          Arrays.stream(arguments)
              .map(word -> PublicKey.parse("rtpm25519 " + word))
              .collect(Collectors.toSet());
      options = options.withKey(key, admitted, false);
    }
    Method<byte[], byte[]> run = new Method<>("run", 2, Kind.CALL, BYTES, BYTES);
    AtomicLong runs = new AtomicLong();
    try (Server server = Server.open(options)) {
      server.serve(
          "lab/arm0",
          new Skeleton(
              new Interface("lab.Arm", 0x0123456789abcdefL, List.of(run)),
              List.of(
                  new Operation.Deferred<>(
                      run,
                      (bytes, context) ->
                          CompletableFuture.completedFuture(counted(runs.incrementAndGet()))))));
      System.out.println("127.0.0.1:" + server.port());
      System.out.flush();
      Thread.currentThread().join();
    }
  }

  private static byte[] counted(long runs) {
    return ByteBuffer.allocate(8).order(ByteOrder.LITTLE_ENDIAN).putLong(runs).array();
  }
}

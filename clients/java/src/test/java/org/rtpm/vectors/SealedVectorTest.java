package org.rtpm.vectors;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotNull;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import java.util.List;
import java.util.stream.Stream;
import org.junit.jupiter.api.DynamicTest;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.TestFactory;
import org.junit.jupiter.api.function.Executable;
import org.rtpm.internal.sealed.KeyPair;
import org.rtpm.internal.sealed.Noise;
import org.rtpm.internal.sealed.SealedSession;
import org.rtpm.internal.sealed.Sealing;
import org.rtpm.internal.sealed.Suite;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Hello;
import org.rtpm.internal.wire.Medium;

/** spec/vectors/sealed.json: all keys are fixed, so that every byte is compared. */
class SealedVectorTest {
  private static final Json VECTORS = Json.vectors("sealed.json");

  private interface Check {
    void run(Json vector) throws Throwable;
  }

  private static Stream<DynamicTest> each(String list, Check check) {
    List<Json> vectors = VECTORS.at(list).list();
    assertFalse(vectors.isEmpty());
    return vectors.stream()
        .map(
            vector -> {
              Executable run = () -> check.run(vector);
              return DynamicTest.dynamicTest(
                  vector.text("name", vector.at("suite").text()), run);
            });
  }

  private static Suite suite(Json vector) {
    return vector.at("suite").text().contains("AESGCM") ? Suite.AES_GCM : Suite.CHACHA_POLY;
  }

  private static byte[] behindHeader(byte[] frame) {
    return Arrays.copyOfRange(frame, 64, frame.length);
  }

  private static byte[] prologue(Json vector) {
    byte[] hello = vector.at("hello").bytes();
    Header header = new Header();
    assertNull(header.readFrame(hello, Medium.DATAGRAM));
    byte[] cookie = vector.at("cookie").bytes();
    byte[] prologue =
        Sealing.prologue(header, behindHeader(hello), cookie.length == 0 ? null : cookie);
    assertArrayEquals(vector.at("prologue").bytes(), prologue);
    return prologue;
  }

  private static void expectKeys(Json vector, Noise.Keys keys) {
    assertArrayEquals(vector.at("client_key").bytes(), keys.client());
    assertArrayEquals(vector.at("server_key").bytes(), keys.server());
    assertArrayEquals(vector.at("handshake_hash").bytes(), keys.handshakeHash());
  }

  private static byte[] publicOf(Json vector, String key) {
    // The server's side of an unused handshake knows its public key by the COOKIE's.
    return VECTORS.at("cookie").at(key).bytes();
  }

  @TestFactory
  Stream<DynamicTest> handshakesOfTheClient() {
    return each(
        "handshakes",
        vector -> {
          Noise client =
              Noise.client(
                  suite(vector),
                  vector.at("client_private").bytes(),
                  publicOf(vector, "server_key"),
                  vector.at("psk").bytes(),
                  vector.at("client_ephemeral").bytes(),
                  prologue(vector));
          byte[] former = new byte[8];
          Bytes.put64(former, 0, vector.at("former_session").number());
          byte[] hello = behindHeader(vector.at("hello").bytes());
          assertArrayEquals(
              Arrays.copyOfRange(hello, Hello.SIZE, hello.length), client.writeMessage1(former));
          byte[] message = behindHeader(vector.at("welcome").bytes());
          byte[] forged = message.clone();
          forged[forged.length - 1] ^= 1;
          assertNull(client.readMessage2(forged));
          byte[] inner = client.readMessage2(message);
          assertArrayEquals(vector.at("welcome_inside").bytes(), inner);
          int features = Sealing.readHello(hello).features();
          Sealing.Granted granted = Sealing.Granted.read(inner, features);
          assertEquals(vector.at("former").integer(), granted.former());
          assertArrayEquals(inner, granted.bytes());
          expectKeys(vector, client.keys());
        });
  }

  @TestFactory
  Stream<DynamicTest> handshakesOfTheServer() {
    return each(
        "handshakes",
        vector -> {
          Noise server =
              Noise.server(
                  suite(vector),
                  KeyPair.of(vector.at("server_private").bytes()),
                  vector.at("psk").bytes(),
                  prologue(vector));
          byte[] hello = behindHeader(vector.at("hello").bytes());
          byte[] former =
              server.readMessage1(Arrays.copyOfRange(hello, Hello.SIZE, hello.length));
          assertNotNull(former);
          assertEquals(vector.at("former_session").number(), Bytes.i64(former, 0));
          assertArrayEquals(
              behindHeader(vector.at("welcome").bytes()),
              server.writeMessage2(
                  vector.at("server_ephemeral").bytes(), vector.at("welcome_inside").bytes()));
          expectKeys(vector, server.keys());
        });
  }

  @Test
  void cookieIsReadAndWritten() {
    Json vector = VECTORS.at("cookie");
    Sealing.Cookie cookie = Sealing.Cookie.read(vector.at("hex").bytes());
    assertArrayEquals(vector.at("cookie").bytes(), cookie.cookie());
    assertArrayEquals(vector.at("server_key").bytes(), cookie.serverKey());
    assertEquals(vector.at("suites").integer(), cookie.suites());
    assertArrayEquals(vector.at("hex").bytes(), cookie.payload());
  }

  @TestFactory
  Stream<DynamicTest> badPayloadsAreNotRead() {
    return VECTORS.at("bad_payloads").list().stream()
        .map(
            vector ->
                DynamicTest.dynamicTest(
                    vector.at("kind").text() + ": " + vector.at("name").text(),
                    () -> {
                      byte[] payload = vector.at("hex").bytes();
                      switch (vector.at("kind").text()) {
                        case "COOKIE" -> assertNull(Sealing.Cookie.read(payload));
                        case "HELLO" -> assertNull(Sealing.readHello(payload));
                        default -> assertNull(Sealing.Granted.read(payload, 1));
                      }
                    }));
  }

  private static SealedSession session(Json vector, boolean isExact) {
    byte[] key = vector.at("key").bytes();
    return new SealedSession(suite(vector), key, key, isExact);
  }

  // One session, frame after frame.
  @Test
  void framesAreSealedAndOpened() {
    SealedSession sender = null;
    SealedSession receiver = null;
    for (Json vector : VECTORS.at("frames").list()) {
      if (vector.at("counter").number() == 0) {
        sender = session(vector, false);
        receiver = session(vector, true);
      }
      byte[] header = vector.at("header").bytes();
      byte[] payload = vector.at("payload").bytes();
      byte[] plain = Arrays.copyOf(header, header.length + payload.length);
      Sealing.unmark(plain);
      System.arraycopy(payload, 0, plain, header.length, payload.length);
      byte[] frame = vector.at("hex").bytes();
      assertArrayEquals(frame, sender.seal(plain), vector.at("name").text());
      assertTrue(Sealing.isSealed(frame));
      assertNull(Sealing.readFrame(new Header(), frame, Medium.DATAGRAM));
      assertArrayEquals(plain, receiver.open(frame));
      // hp-2-2: without level S it is dropped.
      assertEquals(
          DropReason.RESERVED_SET, new Header().readFrame(frame, Medium.DATAGRAM));
    }
  }

  private static String openedAs(SealedSession session, byte[] frame) {
    if (!Sealing.isSealed(frame)) {
      DropReason fault = new Header().read(frame, frame.length);
      return fault == null ? "unsealed" : fault.toString();
    }
    DropReason fault = Sealing.readFrame(new Header(), frame, Medium.DATAGRAM);
    if (fault != null) {
      return fault.toString();
    }
    return session.open(frame) == null ? session.fault().toString() : "";
  }

  @Test
  void badFramesAreDroppedAndChangeNothing() {
    List<Json> vectors = VECTORS.at("bad_frames").list();
    SealedSession session = session(vectors.get(0), false);
    for (Json vector : vectors) {
      if (!vector.at("drop").text().isEmpty()) {
        assertEquals(
            vector.at("drop").text(),
            openedAs(session, vector.at("hex").bytes()),
            vector.at("name").text());
      }
    }
    assertEquals("", openedAs(session, vectors.get(0).at("hex").bytes()));
  }

  @TestFactory
  Stream<DynamicTest> windowsAndKeysTakeTheRightFrames() {
    return each(
        "windows",
        vector -> {
          SealedSession session = session(vector, false);
          for (Json step : vector.at("steps").list()) {
            assertEquals(
                step.text("drop", ""),
                openedAs(session, step.at("hex").bytes()),
                step.at("counter").text());
          }
        });
  }

  // A frame of generation g is opened only by the g-th key of the list.
  @TestFactory
  Stream<DynamicTest> eachKeyFollowsFromTheOneBefore() {
    return each(
        "keys",
        vector -> {
          List<Json> keys = vector.at("keys").list();
          for (int i = 1; i < keys.size(); ++i) {
            assertArrayEquals(
                keys.get(i).bytes(),
                SealedSession.nextKey(suite(vector), keys.get(i - 1).bytes()));
          }
        });
  }
}

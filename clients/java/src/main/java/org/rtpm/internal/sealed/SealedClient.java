package org.rtpm.internal.sealed;

import java.util.ArrayDeque;
import java.util.Arrays;
import java.util.Queue;
import org.rtpm.Status;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Counters;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.FrameKind;
import org.rtpm.internal.wire.FrameSink;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Hello;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Welcome;

/**
 * Sits between a {@link ClientChannel} and its transport, and seals the channel's session
 * (spec/security.md). The channel knows nothing of it; its frames' payloads are at most {@link
 * Sealing#payloadSizeMax}.
 *
 * <p>The channel's owner calls {@link #settle} after each call of the channel that may send. One
 * thread at a time; work with keys takes about a millisecond.
 */
public final class SealedClient implements FrameSink {
  /**
   * How a session is sealed.
   *
   * @param serverKey from the client's own configuration, never from the network (sec-2-4)
   * @param presharedKey 32 bytes; zeros for none
   * @param handshakeNumber random for each life of the program (hp-4-2)
   */
  public record Config(
      Medium medium,
      KeyPair own,
      byte[] serverKey,
      byte[] presharedKey,
      int suites,
      int handshakeNumber) {}

  /** A session, and what its WELCOME granted. */
  private record Session(SealedSession seal, long id, Welcome granted, long opened) {}

  private static final int AT_FEATURES = Limits.HEADER_SIZE + 4;
  private static final int AT_CALL_ID = 16;
  private static final int AT_COOKIE = Limits.HEADER_SIZE + 40;
  /** sec-6-2: at most one handshake because of a hint in this time, at first. */
  private static final long PROBE_INTERVAL_MIN = 100 * Limits.MILLISECOND;
  private static final long PROBE_INTERVAL_MAX = Limits.SECOND;
  /** How long a new session waits for the channel; the server keeps half-open ones longer. */
  private static final long NEXT_MAX = Limits.SECOND;
  private static final long RENEWAL_INTERVAL = 24 * 3600 * Limits.SECOND;

  private final Config config;
  private final FrameSink transport;
  private final Counters counters = new Counters();
  private final Queue<byte[]> undelivered = new ArrayDeque<>();
  private final Header read = new Header();
  private ClientChannel channel;
  private Session current;
  private Session next;
  private long nextUntil;
  /** The session that the server reported as gone. */
  private long goneSession;
  private Status hint;
  private boolean isOpening;
  /** The handshake asks whether the server still has the session, unknown to the channel. */
  private boolean isProbe;
  private int number;
  /** The number by which the channel knows the handshake. */
  private int channelNumber;
  private Suite suite;
  /** The payload of the COOKIE that is to be answered; null: none. */
  private byte[] cookie;
  private byte[] hello;
  private byte[] sealedHello;
  private Noise noise;
  private Header refused;
  private long nextProbe = Long.MIN_VALUE;
  private long probeInterval;

  public SealedClient(Config config, FrameSink transport) {
    this.config = config;
    this.transport = transport;
    number = config.handshakeNumber;
  }

  /** Sets the channel, whose sink this is. */
  public void attach(ClientChannel owner) {
    channel = owner;
  }

  public Counters counters() {
    return counters;
  }

  /**
   * The status in an unsealed REFUSE or COOKIE of this handshake, for the text of an error; it is
   * not authentic. not_allowed: the server may not admit this client's key; version_unsupported: it
   * may know no sealed sessions. Null: nothing.
   */
  public Status hint() {
    return hint;
  }

  /** sec-6-5: whether the keys are old or worn. Closing the idle session gets new ones. */
  public boolean isRenewalDue(long now) {
    return current != null
        && (current.seal.isWorn() || now - current.opened >= RENEWAL_INTERVAL);
  }

  /** The connection is gone. */
  public void reset() {
    current = null;
    next = null;
    goneSession = 0;
    isOpening = false;
    noise = null;
  }

  /** Gives the channel what it has to learn. */
  public void settle(long now) {
    for (byte[] frame; (frame = undelivered.poll()) != null; ) {
      channel.onFrame(frame, now);
    }
  }

  // ---- sending ----------------------------------------------------------------------------------

  @Override
  public void send(byte[] frame) {
    Header header = new Header();
    header.read(frame, frame.length);
    // A client's frames bear the time when they are sent.
    long now = header.senderTimeNs;
    if (header.kind == FrameKind.HELLO) {
      sendHello(header, frame, now);
      return;
    }
    boolean asks = header.kind == FrameKind.CALL || header.kind == FrameKind.CREDIT;
    if (asks && goneSession != 0 && header.session == goneSession) {
      // The server said so; the channel learns it call by call.
      tellLost(header);
      return;
    }
    // No frame of a session goes unsealed: without keys it counts as lost.
    if (current == null || current.id != header.session) {
      return;
    }
    byte[] sealed = current.seal.seal(frame);
    if (header.kind == FrameKind.CLOSE) {
      current = null;
    }
    if (sealed != null) {
      transport.send(sealed);
    }
  }

  private void begin(boolean asProbe) {
    isOpening = true;
    isProbe = asProbe;
    next = null;
    cookie = null;
    sealedHello = null;
    noise = null;
    ++number;
    hint = null;
  }

  private void sendHello(Header header, byte[] frame, long now) {
    boolean isNew = !isOpening || isProbe || header.callId != channelNumber;
    channelNumber = header.callId;
    if (isNew) {
      if (next != null && now < nextUntil && next.granted.serves(header.priority)) {
        current = next;
        next = null;
        isOpening = false;
        hello = frame.clone();
        welcomeChannel();
        return;
      }
      begin(false);
    }
    hello = frame.clone();
    Bytes.put32(hello, AT_CALL_ID, number);
    if (sealedHello != null) {
      // hp-4-5, sec-3-1: a copy has the same bytes.
      transport.send(sealedHello);
    } else if (config.medium == Medium.STREAM || cookie != null) {
      suite = cookie == null ? bestSuite(config.suites) : suite;
      sendMessage1(now);
    } else {
      sendFirstHello();
    }
  }

  private void sendFirstHello() {
    Arrays.fill(hello, AT_COOKIE, AT_COOKIE + Hello.COOKIE_SIZE, (byte) 0);
    Bytes.put32(hello, AT_FEATURES, Sealing.FEATURE_SEALED);
    transport.send(hello.clone());
  }

  private Suite bestSuite(int theirs) {
    boolean hasAes = (config.suites & theirs & Suite.AES_GCM.bit()) != 0;
    return hasAes ? Suite.AES_GCM : Suite.CHACHA_POLY;
  }

  // sec-3-1: each message 1 has an ephemeral key of its own.
  private void sendMessage1(long now) {
    Arrays.fill(hello, AT_COOKIE, AT_COOKIE + Hello.COOKIE_SIZE, (byte) 0);
    if (cookie != null) {
      System.arraycopy(cookie, 0, hello, AT_COOKIE, Hello.COOKIE_SIZE);
    }
    Bytes.put32(hello, AT_FEATURES, suite.features());
    Header header = new Header();
    header.read(hello, hello.length);
    header.flags = 0;
    header.payloadSize = Sealing.HELLO_SIZE;
    header.messageSize = Sealing.HELLO_SIZE;
    header.senderTimeNs = now;
    byte[] payload = Arrays.copyOfRange(hello, Limits.HEADER_SIZE, hello.length);
    noise =
        Noise.client(
            suite,
            config.own.privateKey(),
            config.serverKey,
            config.presharedKey,
            Crypto.random(),
            Sealing.prologue(header, payload, cookie));
    // sec-6-3: asks for the session that this client still has keys of.
    byte[] former = new byte[8];
    Bytes.put64(former, 0, current != null && !current.seal.hasEnded() ? current.id : 0);
    byte[] message = noise.writeMessage1(former);
    if (message == null) {
      return; // The configured key is of small order.
    }
    byte[] whole = Arrays.copyOf(payload, Sealing.HELLO_SIZE);
    System.arraycopy(message, 0, whole, Hello.SIZE, message.length);
    sealedHello = header.frame(whole, 0);
    transport.send(sealedHello);
  }

  // ---- receiving --------------------------------------------------------------------------------

  /**
   * Takes a received frame in, which may be anything.
   *
   * @return false, on a stream only, if the connection is to be ended
   */
  public boolean onFrame(byte[] frame, long now) {
    ++counters.received;
    if (Sealing.isSealed(frame)) {
      return onSealed(frame, now);
    }
    DropReason fault = read.read(frame, frame.length);
    if (fault == null
        && read.kind != FrameKind.COOKIE
        && read.kind != FrameKind.WELCOME
        && read.kind != FrameKind.REFUSE) {
      // sec-4-4, sec-6-2: an unsealed frame changes nothing in a sealed session.
      counters.drop(DropReason.UNSEALED);
      return true;
    }
    if (fault == null) {
      fault = read.readFrame(frame, config.medium);
    }
    if (fault != null) {
      counters.drop(fault);
      return config.medium == Medium.DATAGRAM;
    }
    switch (read.kind) {
      case COOKIE -> onCookie(frame, now);
      case WELCOME -> onWelcome(frame, now);
      default -> onRefuse(now);
    }
    settle(now);
    return true;
  }

  private boolean onSealed(byte[] frame, long now) {
    DropReason fault = Sealing.readFrame(read, frame, config.medium);
    byte[] plain = null;
    if (fault == null && (current == null || current.id != read.session)) {
      fault = DropReason.UNEXPECTED;
    }
    if (fault == null) {
      plain = current.seal.open(frame);
      fault = current.seal.fault();
    }
    if (fault != null) {
      counters.drop(fault);
      return config.medium == Medium.DATAGRAM; // sec-5-7
    }
    if (read.kind == FrameKind.CLOSE) {
      current = null;
    }
    channel.onFrame(plain, now);
    return true;
  }

  private void onCookie(byte[] frame, long now) {
    if (!isOpening || read.callId != number) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    byte[] payload = Arrays.copyOfRange(frame, Limits.HEADER_SIZE, frame.length);
    Sealing.Cookie given = Sealing.Cookie.read(payload);
    if (given == null) {
      // sec-3.1-2
      if (payload.length == Hello.COOKIE_SIZE) {
        hint = Status.VERSION_UNSUPPORTED;
      }
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    if (cookie != null && Arrays.equals(payload, cookie)) {
      return;
    }
    cookie = payload;
    sealedHello = null;
    suite = bestSuite(given.suites());
    if (isProbe || config.medium == Medium.STREAM) {
      sendMessage1(now);
      return;
    }
    // hp-4.2-4: the channel decides whether to answer at once, and gives its HELLO again.
    Header plain = new Header();
    plain.kind = FrameKind.COOKIE;
    plain.priority = read.priority;
    plain.callId = channelNumber;
    plain.payloadSize = Hello.COOKIE_SIZE;
    plain.messageSize = Hello.COOKIE_SIZE;
    undelivered.add(plain.frame(given.cookie(), 0));
  }

  // sec-3-4: a WELCOME that can't be opened changes nothing.
  private void onWelcome(byte[] frame, long now) {
    if (!isOpening || read.callId != number || sealedHello == null) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    if (frame.length != Limits.HEADER_SIZE + Noise.MESSAGE_2_SIZE) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    byte[] inner =
        noise.readMessage2(Arrays.copyOfRange(frame, Limits.HEADER_SIZE, frame.length));
    if (inner == null) {
      counters.drop(DropReason.BAD_SEAL);
      return;
    }
    Sealing.Granted granted = Sealing.Granted.read(inner, suite.features());
    boolean isAlive = granted != null && granted.former() == Sealing.Granted.ALIVE;
    isOpening = false;
    // sec-3.3-1. It was authentic, so that the server itself is faulty.
    if (granted == null
        || granted.session() != read.session
        || !granted.welcome().serves(Bytes.u16(hello, 4))
        || (isAlive && (current == null || current.id != granted.session()))) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    probeInterval = 0;
    if (isAlive) {
      // sec-6-3: the old keys and counters go on.
      if (!isProbe) {
        welcomeChannel();
      }
      return;
    }
    open(granted, now);
  }

  private void open(Sealing.Granted granted, long now) {
    Noise.Keys keys = noise.keys();
    noise = null;
    SealedSession seal =
        new SealedSession(suite, keys.client(), keys.server(), config.medium == Medium.STREAM);
    Session opened = new Session(seal, granted.session(), granted.welcome(), now);
    if (!isProbe) {
      current = opened;
      welcomeChannel();
      return;
    }
    // The session waits until the channel opens one.
    next = opened;
    nextUntil = now + NEXT_MAX;
    long lost = refused.session;
    current = null;
    if (granted.former() == Sealing.Granted.ENDED) {
      // sec-6-6: as a CLOSE of the server.
      Header close = new Header();
      close.kind = FrameKind.CLOSE;
      close.priority = refused.priority;
      close.session = lost;
      undelivered.add(close.frame(new byte[0], 0));
      return;
    }
    goneSession = lost;
    tellLost(refused);
  }

  private void welcomeChannel() {
    Header plain = new Header();
    plain.kind = FrameKind.WELCOME;
    plain.priority = Bytes.u16(hello, 4);
    plain.session = current.id;
    plain.callId = channelNumber;
    plain.payloadSize = Welcome.SIZE;
    plain.messageSize = Welcome.SIZE;
    Welcome granted = current.granted;
    Welcome ordinary =
        new Welcome(
            granted.bandLow(),
            granted.bandHigh(),
            granted.ceiling(),
            0,
            granted.window(),
            granted.serverEpoch(),
            granted.clockDomain(),
            granted.messageSizeMax());
    undelivered.add(plain.frame(ordinary.payload(), 0));
  }

  private void tellLost(Header about) {
    Header plain = new Header();
    plain.kind = FrameKind.REFUSE;
    plain.priority = about.priority;
    plain.session = about.session;
    plain.callId = about.callId;
    plain.statusNumber = Status.UNKNOWN_SESSION.number();
    undelivered.add(plain.frame(new byte[0], 0));
  }

  // sec-6-2: an unsealed REFUSE ends nothing; it is a reason to ask.
  private void onRefuse(long now) {
    counters.drop(DropReason.UNSEALED);
    if (read.payloadSize != 0) {
      return;
    }
    if (isOpening && !isProbe) {
      if (read.callId == number && read.session == 0) {
        hint = read.status();
      }
      return;
    }
    boolean isAboutUs =
        current != null
            && current.id == read.session
            && read.status() == Status.UNKNOWN_SESSION
            && config.medium == Medium.DATAGRAM;
    if (!isAboutUs || now < nextProbe || hello == null) {
      return;
    }
    probeInterval =
        Math.min(Math.max(2 * probeInterval, PROBE_INTERVAL_MIN), PROBE_INTERVAL_MAX);
    nextProbe = now + probeInterval;
    refused = read.about(FrameKind.REFUSE, 0, now);
    begin(true);
    Bytes.put32(hello, AT_CALL_ID, number);
    sendFirstHello();
  }
}

package org.rtpm.internal.sealed;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashMap;
import java.util.Iterator;
import java.util.List;
import java.util.Map;
import java.util.concurrent.Executor;
import java.util.function.LongSupplier;
import java.util.function.Predicate;
import org.rtpm.Status;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.CookieJar;
import org.rtpm.internal.wire.Counters;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.FrameKind;
import org.rtpm.internal.wire.Header;
import org.rtpm.internal.wire.Hello;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.RateLimiter;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;
import org.rtpm.internal.wire.Welcome;

/**
 * Sits between a lane's {@link ServerSessions} and its transport, and seals its sessions
 * (spec/security.md). The sessions know nothing of it: their frames' payloads are at most {@link
 * Sealing#payloadSizeMax}, and what they send goes through {@link #send}.
 *
 * <p>One thread at a time; work with keys is given to the executor, which calls back by {@code
 * lock}.
 */
public final class SealedServer {
  /** Which clients a server admits. Called by one thread at a time. */
  public interface Admission {
    /** Whether the client with this key may have a session. */
    boolean admits(byte[] clientKey);

    /** Whether clients without a key may have sessions (sec-6.2). */
    boolean admitsUnsealed();
  }

  /**
   * How a lane seals.
   *
   * @param presharedKey 32 bytes; zeros for none
   * @param lock runs a task while the lane is locked
   * @param clock the monotonic clock that the lane reads
   */
  public record Config(
      Medium medium,
      KeyPair own,
      byte[] presharedKey,
      int suites,
      Admission admission,
      SipHash key,
      int sessionCountMax,
      Executor keyWorker,
      Executor lock,
      LongSupplier clock) {}

  /** The seal of a session. */
  private static final class Entry {
    long id;
    Peer peer;
    long clientEpoch;
    long channel;
    int handshakeNumber;
    byte[] client;
    byte[] helloHash;
    Welcome granted;
    long opened;
    long lastHeard;
    final Freshness freshness = new Freshness();
    boolean hasOurClock;
    /** Its client sent an authentic frame. */
    boolean isConfirmed;
    /** The answer to a copy of its HELLO; null while the work with keys is not done. */
    byte[] welcome;
    SealedSession session;
  }

  /** A handshake whose work with keys is under way. */
  private record Job(
      Peer peer, Header header, Hello hello, byte[] hash, Suite suite, Noise noise) {}

  /** sec-6-1: how long a session lives without a frame of its client. */
  private static final long HALF_OPEN_MAX = 2 * Limits.SECOND;
  /** For how long clients may remember what was ended (hp-5.5-2). */
  private static final long ENDED_MEMORY = 2 * Limits.SESSION_IDLE_MIN;
  private static final int JOB_COUNT_MAX = 8;
  /** Handshakes of one host: at once, and then one in this time (sec-7). */
  private static final int JOB_BURST = 32;
  private static final long JOB_INTERVAL = 20 * Limits.MILLISECOND;
  private static final int AT_CHANNEL = 16;
  private static final int AT_BUDGET = 40;

  private final Config config;
  private final ServerSessions.Sink transport;
  private final CookieJar cookies;
  private final RateLimiter jobLimit;
  private final RateLimiter refusalLimit;
  private final Map<Long, Entry> entries = new HashMap<>();
  private final List<Job> jobs = new ArrayList<>();
  private final Counters counters = new Counters();
  private ServerSessions sessions;
  private long endedUntil = Long.MIN_VALUE;
  /** While it is not null, it takes the sessions' next frame instead of the transport. */
  private List<byte[]> caught;

  public SealedServer(Config config, ServerSessions.Sink transport) {
    this.config = config;
    this.transport = transport;
    cookies = new CookieJar(config.key);
    jobLimit = new RateLimiter(config.key, JOB_BURST, JOB_INTERVAL);
    refusalLimit =
        new RateLimiter(
            config.key, Limits.STRANGER_ANSWER_BURST, Limits.STRANGER_ANSWER_INTERVAL);
  }

  /** Sets the sessions, whose sink is {@link #send}. */
  public void attach(ServerSessions lane) {
    sessions = lane;
  }

  /** Counts what was dropped here; the sessions count what got to them. */
  public Counters counters() {
    return counters;
  }

  /** The key of a session's client; null if it is not sealed. */
  public byte[] clientOf(long session) {
    Entry entry = find(session);
    return entry == null ? null : entry.client.clone();
  }

  // ---- frames -----------------------------------------------------------------------------------

  /** Sends a frame of the sessions, sealed where its session is. */
  public void send(Peer peer, byte[] frame) {
    if (caught != null) {
      caught.add(frame);
      return;
    }
    Header header = new Header();
    header.read(frame, frame.length);
    Entry entry = entries.get(header.session);
    boolean isHandshake = header.kind == FrameKind.WELCOME || header.kind == FrameKind.COOKIE;
    if (isHandshake || entry == null) {
      // A frame of an unsealed session, or a refusal to a stranger.
      if (isHandshake
          || header.kind == FrameKind.REFUSE
          || config.admission.admitsUnsealed()) {
        transport.send(peer, frame);
      }
      return;
    }
    byte[] sealed = entry.session == null ? null : entry.session.seal(frame);
    if (sealed != null) {
      transport.send(peer, sealed);
    }
  }

  /**
   * Takes a received frame in, which may be anything.
   *
   * @return false, on a stream only, if the connection is to be ended
   */
  public boolean onFrame(byte[] frame, Peer peer, long now) {
    if (Sealing.isSealed(frame)) {
      return onSealed(frame, peer, now);
    }
    Header header = new Header();
    DropReason fault = header.read(frame, frame.length);
    // sec-4-4: an unsealed frame never reaches a sealed session.
    if (fault == null && header.kind != FrameKind.HELLO && find(header.session) != null) {
      return drop(DropReason.UNSEALED);
    }
    if (header.readFrame(frame, config.medium) == null && header.kind == FrameKind.HELLO) {
      return onHello(header, frame, peer, now);
    }
    return sessions.onFrame(frame, peer, now);
  }

  private boolean drop(DropReason reason) {
    ++counters.received;
    counters.drop(reason);
    return true;
  }

  // sec-5-7: on a stream the client must not wait for an answer that never comes.
  private boolean broken(DropReason reason) {
    drop(reason);
    return config.medium == Medium.DATAGRAM;
  }

  private Entry find(long session) {
    Entry entry = entries.get(session);
    if (entry != null && !sessions.isKnown(session)) {
      entries.remove(session);
      return null;
    }
    return entry;
  }

  // sec-4-2: session, address, counter, tag, in this order.
  private boolean onSealed(byte[] frame, Peer peer, long now) {
    Header header = new Header();
    DropReason fault = Sealing.readFrame(header, frame, config.medium);
    if (fault != null) {
      return broken(fault);
    }
    Entry entry = find(header.session);
    if (entry == null || entry.session == null) {
      if (sessions.isKnown(header.session)) {
        return drop(DropReason.UNEXPECTED);
      }
      // The sessions refuse it, which is a hint for the client (sec-6-2).
      byte[] plain = Arrays.copyOf(frame, frame.length - Sealing.TRAILER_SIZE);
      Sealing.unmark(plain);
      return sessions.onFrame(plain, peer, now);
    }
    if (!entry.peer.equals(peer)) {
      return drop(DropReason.FOREIGN_ADDRESS);
    }
    byte[] plain = entry.session.open(frame);
    if (plain == null) {
      fault = entry.session.fault();
      if (entry.session.hasEnded()) {
        end(entry, now);
      }
      return broken(fault);
    }
    if (!entry.isConfirmed) {
      confirm(entry, now);
    }
    entry.lastHeard = now;
    return isHeldBack(entry, header, plain, now) || sessions.onFrame(plain, peer, now);
  }

  // sec-6-1: only now the session replaces an earlier one of its channel.
  private void confirm(Entry entry, long now) {
    entry.isConfirmed = true;
    for (Entry other : List.copyOf(entries.values())) {
      boolean isOfChannel =
          other != entry
              && other.peer.equals(entry.peer)
              && other.clientEpoch == entry.clientEpoch
              && other.channel == entry.channel
              && Arrays.equals(other.client, entry.client);
      if (isOfChannel && entry.handshakeNumber - other.handshakeNumber > 0) {
        close(other, now);
      }
    }
  }

  // sec-6.1-1, sec-6.1-2
  private boolean isHeldBack(Entry entry, Header header, byte[] plain, long now) {
    long late = entry.freshness.take(header.senderTimeNs, now) - Freshness.TOLERANCE;
    if (header.kind != FrameKind.CALL
        || header.budgetUs == Limits.BUDGET_UNLIMITED
        || late <= 0) {
      return false;
    }
    long left = Integer.toUnsignedLong(header.budgetUs) * Limits.MICROSECOND - late;
    if (left > 0) {
      // Where both sides read one clock, the sessions find it out themselves.
      if (!entry.hasOurClock) {
        Bytes.put32(plain, AT_BUDGET, (int) (left / Limits.MICROSECOND));
      }
      return false;
    }
    ++counters.received;
    ++counters.expired;
    if (entry.freshness.hasStillClock(now)) {
      end(entry, now);
    }
    return true;
  }

  // Ends a session for its client.
  private void close(Entry entry, long now) {
    Header header = new Header();
    header.kind = FrameKind.CLOSE;
    header.session = entry.id;
    sessions.onFrame(header.frame(new byte[0], 0), entry.peer, now);
    entries.remove(entry.id);
  }

  /** Ends the sessions of clients that are admitted no more. */
  public void endUnadmitted(long now) {
    for (Entry entry : List.copyOf(entries.values())) {
      if (entry.client != null && !config.admission.admits(entry.client)) {
        end(entry, now);
      }
    }
  }

  // sec-6-6: its client may still use it, and its open calls may have run.
  private void end(Entry entry, long now) {
    endedUntil = now + ENDED_MEMORY;
    close(entry, now);
  }

  // ---- handshakes -------------------------------------------------------------------------------

  private boolean onHello(Header header, byte[] frame, Peer peer, long now) {
    byte[] payload = Arrays.copyOfRange(frame, Limits.HEADER_SIZE, frame.length);
    if (payload.length == Sealing.HELLO_SIZE) {
      return onSealedHello(header, frame, payload, peer, now);
    }
    Hello hello = Hello.read(payload);
    if (hello == null) {
      return drop(DropReason.BAD_PAYLOAD);
    }
    if ((hello.features() & Sealing.FEATURE_SEALED) != 0) {
      giveCookie(header, payload, peer, now);
      return true;
    }
    // sec-6.2-2
    if (hasConfirmedStream(peer)) {
      return drop(DropReason.UNSEALED);
    }
    if (config.admission.admitsUnsealed()) {
      return sessions.onFrame(frame, peer, now);
    }
    // sec-6.2-1, hp-4.4-5
    if (!refusalLimit.admit(peer, now)) {
      return drop(DropReason.RATE_LIMITED);
    }
    ++counters.received;
    refuse(header, peer, Status.NOT_ALLOWED, now);
    return true;
  }

  private boolean hasConfirmedStream(Peer peer) {
    if (config.medium == Medium.DATAGRAM) {
      return false;
    }
    for (Entry entry : entries.values()) {
      if (entry.isConfirmed && entry.peer.equals(peer) && sessions.isKnown(entry.id)) {
        return true;
      }
    }
    return false;
  }

  private void refuse(Header about, Peer peer, Status status, long now) {
    ++counters.refused;
    Header header = about.about(FrameKind.REFUSE, 0, now);
    header.statusNumber = status.number();
    transport.send(peer, header.frame(new byte[0], 0));
  }

  // The sessions' answer to a HELLO without message 1; null if there is none.
  private byte[] passHello(Header header, byte[] hello, Peer peer, long now) {
    Header plain = header.about(FrameKind.HELLO, Hello.SIZE, now);
    caught = new ArrayList<>();
    sessions.onFrame(plain.frame(hello, 0), peer, now);
    byte[] answer = caught.isEmpty() ? null : caught.get(0);
    caught = null;
    return answer;
  }

  private Sealing.Cookie cookieOf(byte[] cookie) {
    return new Sealing.Cookie(cookie, config.own.publicKey(), config.suites);
  }

  // sec-3.1-1: opens no session. The sessions limit strangers, and refuse what is out of range.
  private void giveCookie(Header header, byte[] payload, Peer peer, long now) {
    byte[] hello = Arrays.copyOf(payload, Hello.SIZE);
    byte[] cookie;
    if (config.medium == Medium.DATAGRAM) {
      Arrays.fill(hello, 40, 56, (byte) 0);
      byte[] answer = passHello(header, hello, peer, now);
      if (answer == null) {
        return;
      }
      if (answer[3] != FrameKind.COOKIE.number()) {
        transport.send(peer, answer);
        return;
      }
      cookie = Arrays.copyOfRange(answer, Limits.HEADER_SIZE, answer.length);
    } else {
      // Not zero, so that the next HELLO shows that there was a cookie.
      cookie = cookies.give(peer, Bytes.i64(hello, 8), now);
    }
    Header answer = header.about(FrameKind.COOKIE, Sealing.COOKIE_SIZE, now);
    transport.send(peer, answer.frame(cookieOf(cookie).payload(), 0));
  }

  private boolean onSealedHello(
      Header header, byte[] frame, byte[] payload, Peer peer, long now) {
    Hello hello = Sealing.readHello(payload);
    if (hello == null) {
      return drop(DropReason.BAD_PAYLOAD);
    }
    boolean wantsAes = (hello.features() & Sealing.FEATURE_AES_GCM) != 0;
    Suite suite = wantsAes ? Suite.AES_GCM : Suite.CHACHA_POLY;
    boolean hasSuite = (config.suites & suite.bit()) != 0;
    // sec-3.2-2: before any work with keys.
    boolean isProven =
        config.medium == Medium.STREAM
            || cookies.isGood(hello.cookie(), peer, hello.clientEpoch(), now);
    if (!hasSuite || !isProven) {
      if (hasSuite) {
        counters.drop(DropReason.BAD_COOKIE);
      }
      giveCookie(header, payload, peer, now);
      return true;
    }
    byte[] hash = Crypto.sha256(frame);
    for (Entry entry : entries.values()) {
      if (!entry.peer.equals(peer)
          || entry.clientEpoch != hello.clientEpoch()
          || entry.channel != hello.channel()
          || !sessions.isKnown(entry.id)) {
        continue;
      }
      // sec-3-3: only an exact copy gets the same WELCOME.
      if (Arrays.equals(entry.helloHash, hash)) {
        if (entry.welcome == null) {
          return drop(DropReason.UNEXPECTED);
        }
        transport.send(peer, entry.welcome);
        return true;
      }
      // hp-4.1-6: a late copy of an earlier handshake.
      if (header.callId - entry.handshakeNumber < 0) {
        return drop(DropReason.UNEXPECTED);
      }
    }
    return beginJob(header, payload, hello, suite, hash, peer, now);
  }

  private boolean beginJob(
      Header header, byte[] payload, Hello hello, Suite suite, byte[] hash, Peer peer, long now) {
    for (Job job : jobs) {
      // A connection has one handshake at a time.
      if (job.peer.equals(peer)
          && (config.medium == Medium.STREAM || Arrays.equals(job.hash, hash))) {
        return drop(DropReason.UNEXPECTED);
      }
    }
    // Over UDP the client repeats its HELLO; over TCP it connects again.
    if (jobs.size() >= JOB_COUNT_MAX || !jobLimit.admit(peer, now)) {
      return broken(DropReason.RATE_LIMITED);
    }
    // sec-3.4-1: over a stream there may have been no COOKIE.
    boolean hasCookie =
        config.medium == Medium.DATAGRAM || !Bytes.areZero(payload, 40, 56);
    byte[] prologue =
        Sealing.prologue(
            header, payload, hasCookie ? cookieOf(hello.cookie()).payload() : null);
    Noise noise =
        Noise.server(suite, config.own, config.presharedKey, prologue);
    Job job = new Job(peer, header, hello, hash, suite, noise);
    jobs.add(job);
    byte[] message = Arrays.copyOfRange(payload, Hello.SIZE, payload.length);
    config.keyWorker.execute(
        () -> {
          byte[] former = noise.readMessage1(message);
          config.lock.execute(() -> openSession(job, former, payload, config.clock.getAsLong()));
        });
    return true;
  }

  private void openSession(Job job, byte[] formerBytes, byte[] payload, long now) {
    if (formerBytes == null) {
      // sec-3.2-2: a client that proved no key gets no answer.
      jobs.remove(job);
      drop(DropReason.BAD_SEAL);
      return;
    }
    byte[] client = job.noise.clientPublic();
    if (!config.admission.admits(client)) {
      jobs.remove(job);
      refuse(job.header, job.peer, Status.NOT_ALLOWED, now);
      return;
    }
    long formerId = Bytes.i64(formerBytes, 0);
    Entry former = find(formerId);
    // sec-6-3, sec-6-4
    boolean isAlive =
        former != null
            && former.session != null
            && Arrays.equals(former.client, client)
            && former.peer.equals(job.peer)
            && former.granted.serves(job.header.priority);
    if (isAlive) {
      Welcome granted = withFeatures(former.granted, job.hello.features());
      finish(job, new Sealing.Granted(former.id, granted, Sealing.Granted.ALIVE), null);
      return;
    }
    // By hp-4-4 this HELLO would end the connection's session.
    if (hasConfirmedStream(job.peer)) {
      jobs.remove(job);
      drop(DropReason.UNEXPECTED);
      return;
    }
    if (!makePlace(client, now)) {
      jobs.remove(job);
      refuse(job.header, job.peer, Status.OVERLOAD, now);
      return;
    }
    Entry opened = openEntry(job, client, payload, now);
    if (opened == null) {
      jobs.remove(job);
      return;
    }
    int fate = Sealing.Granted.NONE;
    if (formerId != 0) {
      fate = now < endedUntil ? Sealing.Granted.ENDED : Sealing.Granted.GONE;
    }
    finish(job, new Sealing.Granted(opened.id, opened.granted, fate), opened);
  }

  private static Welcome withFeatures(Welcome granted, int features) {
    return new Welcome(
        granted.bandLow(),
        granted.bandHigh(),
        granted.ceiling(),
        features,
        granted.window(),
        granted.serverEpoch(),
        granted.clockDomain(),
        granted.messageSizeMax());
  }

  private Entry openEntry(Job job, byte[] client, byte[] payload, long now) {
    // sec-6-1: for the sessions each handshake is a channel of its own, so that it replaces none.
    byte[] hello = Arrays.copyOf(payload, Hello.SIZE);
    System.arraycopy(job.hash, 0, hello, AT_CHANNEL, 8);
    byte[] answer = passHello(job.header, hello, job.peer, now);
    if (answer == null || answer[3] != FrameKind.WELCOME.number()) {
      if (answer != null) {
        transport.send(job.peer, answer);
      }
      return null;
    }
    Entry entry = new Entry();
    entry.id = Bytes.i64(answer, 8);
    entry.peer = job.peer;
    entry.clientEpoch = job.hello.clientEpoch();
    entry.channel = job.hello.channel();
    entry.handshakeNumber = job.header.callId;
    entry.client = client;
    entry.helloHash = job.hash;
    Welcome granted =
        Welcome.read(Arrays.copyOfRange(answer, Limits.HEADER_SIZE, answer.length), 0);
    entry.granted = withFeatures(granted, job.hello.features());
    entry.opened = now;
    entry.lastHeard = now;
    entry.hasOurClock =
        job.hello.clockDomain() != 0 && job.hello.clockDomain() == granted.clockDomain();
    entries.put(entry.id, entry);
    return entry;
  }

  // `opened`: null if the former session goes on.
  private void finish(Job job, Sealing.Granted granted, Entry opened) {
    config.keyWorker.execute(
        () -> {
          byte[] message = job.noise.writeMessage2(Crypto.random(), granted.bytes());
          config.lock.execute(
              () -> sendWelcome(job, granted, opened, message, config.clock.getAsLong()));
        });
  }

  private void sendWelcome(
      Job job, Sealing.Granted granted, Entry opened, byte[] message, long now) {
    jobs.remove(job);
    // The session may have ended meanwhile; its client repeats the HELLO.
    if (message == null || find(granted.session()) == null) {
      drop(DropReason.UNEXPECTED);
      return;
    }
    Header header = new Header();
    header.kind = FrameKind.WELCOME;
    header.priority = job.header.priority;
    header.callId = job.header.callId;
    header.session = granted.session();
    header.payloadSize = Noise.MESSAGE_2_SIZE;
    header.messageSize = Noise.MESSAGE_2_SIZE;
    header.senderTimeNs = now;
    byte[] frame = header.frame(message, 0);
    if (opened != null) {
      Noise.Keys keys = job.noise.keys();
      opened.session =
          new SealedSession(
              job.suite, keys.server(), keys.client(), config.medium == Medium.STREAM);
      opened.welcome = frame;
    }
    transport.send(job.peer, frame);
  }

  // sec-6-7: a key has at most its share, and replaces only its own sessions that may be replaced.
  private boolean makePlace(byte[] client, long now) {
    onTime(now);
    int halfOpenMax = Math.max(1, config.sessionCountMax / 4);
    replaceOldestHalfOpen(
        Limits.shareOfOneHost(halfOpenMax), entry -> Arrays.equals(entry.client, client), now);
    replaceOldestHalfOpen(halfOpenMax, entry -> true, now);
    int count = 0;
    Entry oldest = null;
    for (Entry entry : entries.values()) {
      if (Arrays.equals(entry.client, client)) {
        ++count;
        oldest = oldest == null || entry.lastHeard < oldest.lastHeard ? entry : oldest;
      }
    }
    if (count < Limits.shareOfOneHost(config.sessionCountMax)) {
      return true;
    }
    if (now - oldest.lastHeard < Limits.SESSION_IDLE_MIN) {
      return false;
    }
    close(oldest, now);
    return true;
  }

  private void replaceOldestHalfOpen(int limit, Predicate<Entry> isMeant, long now) {
    int count = 0;
    Entry oldest = null;
    for (Entry entry : entries.values()) {
      if (!entry.isConfirmed && isMeant.test(entry)) {
        ++count;
        oldest = oldest == null || entry.opened < oldest.opened ? entry : oldest;
      }
    }
    if (count >= limit && oldest != null) {
      close(oldest, now);
    }
  }

  // ---- time -------------------------------------------------------------------------------------

  /** Ends half-open sessions whose time is over (sec-6-1). */
  public void onTime(long now) {
    List<Entry> late = new ArrayList<>();
    for (Iterator<Entry> all = entries.values().iterator(); all.hasNext(); ) {
      Entry entry = all.next();
      if (!sessions.isKnown(entry.id)) {
        all.remove();
      } else if (!entry.isConfirmed && now - entry.opened > HALF_OPEN_MAX) {
        late.add(entry);
      }
    }
    for (Entry entry : late) {
      close(entry, now);
    }
  }

  /** When {@link #onTime} is due. */
  public long nextTime() {
    long next = Limits.NEVER;
    for (Entry entry : entries.values()) {
      if (!entry.isConfirmed) {
        next = Math.min(next, entry.opened + HALF_OPEN_MAX + 1);
      }
    }
    return next;
  }
}

package org.rtpm.internal.wire;

import java.util.ArrayList;
import java.util.List;
import org.rtpm.Status;

/**
 * The server's half of the protocol for one lane and medium: sessions, at most once, refusals.
 *
 * <p>Does no I/O: frames and times (nanoseconds of a monotonic clock) come in, frames go to the
 * sink, calls to the handler. One thread at a time. The handler is called last, so that it may
 * complete a call at once.
 */
public final class ServerSessions {
  /**
   * How a lane's sessions are set up.
   *
   * @param key secret, of the whole server: for cookies and session numbers
   * @param lane the lane's number, from 0
   * @param largeCountMax large messages at a time; 0: no message may be larger than a frame
   * @param streamCountMax streams at a time; 0: none
   * @param framePayloadMax the largest payload of a frame, if less than the medium's
   */
  public record Config(
      Medium medium,
      int bandLow,
      int bandHigh,
      int ceiling,
      long epoch,
      long clockDomain,
      SipHash key,
      int lane,
      int laneCount,
      int sessionCountMax,
      int messageSizeMax,
      int largeCountMax,
      int streamCountMax,
      int framePayloadMax) {}

  /** Takes the frames that the server sends. */
  @FunctionalInterface
  public interface Sink {
    void send(Peer peer, byte[] frame);
  }

  /** Runs the calls. */
  public interface Handler {
    /** Runs the call; {@link ServerSessions#complete} ends it, now or later. */
    void onCall(Request request);

    /** The caller of a running call gave up, or is gone. The call is still to be completed. */
    void onCancelled(Request request);

    /** The client of a stream may take more. */
    void onCredit(Request request);
  }

  /** A call that is to run. */
  public static final class Request {
    /** For the handler. */
    public Object attachment;

    final Header header;
    final Session session;
    final Slot slot;
    private final byte[] payload;
    private final long deadline;
    private final long received;

    Request(Header header, Session session, Slot slot, byte[] payload, long deadline, long at) {
      this.header = header;
      this.session = session;
      this.slot = slot;
      this.payload = payload;
      this.deadline = deadline;
      received = at;
    }

    public byte[] payload() {
      return payload;
    }

    /** On this host's clock. */
    public long deadline() {
      return deadline;
    }

    public long received() {
      return received;
    }

    public int callId() {
      return header.callId;
    }

    public int service() {
      return header.service;
    }

    public int method() {
      return header.method;
    }

    public int priority() {
      return header.priority;
    }

    public long traceId() {
      return header.traceId;
    }

    public long session() {
      return header.session;
    }

    public Peer peer() {
      return session.peer;
    }

    /** Whether the caller is answered before the method runs: {@link ServerSessions#accept}. */
    public boolean wantsReceipt() {
      return header.has(Header.REPLY_ON_RECEIPT);
    }

    public boolean wantsNoReply() {
      return header.has(Header.NO_REPLY);
    }

    public boolean wantsStream() {
      return header.item != 0;
    }

    /** Whether nobody waits for the call: a oneway's that was accepted, or a cancelled one's. */
    public boolean isUnawaited() {
      return slot.running != this || slot.isUnawaited;
    }
  }

  private enum State {
    EMPTY,
    RECEIVING,
    RUNNING,
    DONE
  }

  /** The place of one call of a session. */
  static final class Slot {
    final Session session;
    private State state = State.EMPTY;
    /** Runs without a waiting caller: a oneway, or cancelled. */
    private boolean isUnawaited;
    /** An incomplete request was evicted. */
    private boolean isEvicted;
    private boolean isReplied;
    private int callId;
    /** May be a later call that was refused while this one ran. */
    private int newestCallId;
    /** The reply, if it is kept. */
    private byte[] kept;
    private Large large;
    private Streaming stream;
    private Request running;

    Slot(Session session) {
      this.session = session;
    }

    private void begin(State newState, int newCallId) {
      state = newState;
      isUnawaited = false;
      isEvicted = false;
      isReplied = false;
      callId = newCallId;
      newestCallId = newCallId;
      kept = null;
      running = null;
    }
  }

  static final class Session {
    private final long id;
    private final Peer peer;
    private final long clientEpoch;
    private final long channel;
    private final int handshakeNumber;
    private final boolean hasOurClock;
    private final int messageSizeMax;
    private final Slot[] slots = new Slot[Limits.CALL_WINDOW];
    private boolean isEnded;
    private long lastHeard;

    Session(long id, Peer peer, Hello hello, int handshakeNumber, boolean hasOurClock) {
      this.id = id;
      this.peer = peer;
      clientEpoch = hello.clientEpoch();
      channel = hello.channel();
      this.handshakeNumber = handshakeNumber;
      this.hasOurClock = hasOurClock;
      messageSizeMax = hello.messageSizeMax();
      for (int i = 0; i < slots.length; ++i) {
        slots[i] = new Slot(this);
      }
    }

    private boolean isOf(Hello hello, Peer from) {
      return peer.equals(from)
          && clientEpoch == hello.clientEpoch()
          && channel == hello.channel();
    }
  }

  /** A message larger than a frame: a request, incomplete or served, or a reply. */
  private static final class Large {
    private final Slot slot;
    private final Peer peer;
    private final long deadline;
    private long heard;
    private IncomingMessage incoming;
    private boolean isServed;
    private OutgoingMessage outgoing;

    Large(Slot slot, Peer peer, long deadline, long now) {
      this.slot = slot;
      this.peer = peer;
      this.deadline = deadline;
      heard = now;
    }

    // hp-5.6-10: when it may be evicted.
    private long idleTime() {
      return isServed
          ? Limits.NEVER
          : Math.min(deadline, heard + Limits.LARGE_MESSAGE_SILENCE_MAX);
    }
  }

  private static final class Streaming {
    private final OutgoingStream items;
    private long deadline;

    Streaming(OutgoingStream items, long deadline) {
      this.items = items;
      this.deadline = deadline;
    }
  }

  /** A large reply that waits for a place (hp-5.6-5). */
  private record Waiting(Request request, Status status, byte[] payload) {}

  private static final int INDEX_BITS = 0xffff;
  private static final int LANE_SHIFT = 16;
  private static final long LANE_BITS = 0xffffffL << LANE_SHIFT;

  private final Config config;
  private final Sink sink;
  private final Handler handler;
  private final Counters counters = new Counters();
  private final CookieJar cookies;
  private final RateLimiter strangerAnswers;
  private final Session[] sessions;
  private final int payloadSizeMax;
  private final int itemSizeMax;
  private final int messageSizeMax;
  private final List<Large> larges = new ArrayList<>();
  private final List<Slot> streams = new ArrayList<>();
  private final List<Waiting> waiting = new ArrayList<>();
  private final List<Request> cancelled = new ArrayList<>();
  private long sessionSerial;
  private int sessionCount;

  public ServerSessions(Config config, Sink sink, Handler handler) {
    this.config = config;
    this.sink = sink;
    this.handler = handler;
    cookies = new CookieJar(config.key);
    strangerAnswers =
        new RateLimiter(
            config.key,
            Math.max(Limits.STRANGER_ANSWER_BURST, config.sessionCountMax),
            Limits.STRANGER_ANSWER_INTERVAL);
    sessions = new Session[config.sessionCountMax];
    payloadSizeMax = Math.min(config.framePayloadMax, config.medium.payloadSizeMax);
    // sec-4-3: sealed fragments are smaller, so the largest messages would have too many of them.
    itemSizeMax =
        (int)
            Math.min(config.messageSizeMax, (long) payloadSizeMax * Limits.FRAGMENT_COUNT_MAX);
    messageSizeMax =
        config.largeCountMax > 0 ? itemSizeMax : Math.min(itemSizeMax, payloadSizeMax);
  }

  public Counters counters() {
    return counters;
  }

  public int sessionCount() {
    return sessionCount;
  }

  // ---- frames -----------------------------------------------------------------------------------

  /**
   * Takes a received frame in, which may be anything.
   *
   * @return false if the connection is to be ended: it is not the H-Protocol's (hp-8-2)
   */
  public boolean onFrame(byte[] frame, Peer peer, long now) {
    ++counters.received;
    Header header = new Header();
    DropReason fault = header.readFrame(frame, config.medium);
    if (fault != null) {
      counters.drop(fault);
      return config.medium == Medium.DATAGRAM;
    }
    byte[] payload = Bytes.payloadOf(frame);
    switch (header.kind) {
      case CALL -> onCall(header, payload, peer, now);
      case HELLO -> onHello(header, payload, peer, now);
      case CLOSE -> onClose(header, payload, peer);
      case ACK -> onAck(header, payload, peer, now);
      case CANCEL -> onCancel(header, payload, peer, now);
      case CREDIT -> onCredit(header, payload, peer, now);
      // hp-3-1: only a client receives the others.
      default -> counters.drop(DropReason.BAD_KIND);
    }
    reportCancelled();
    return true;
  }

  private void reportCancelled() {
    while (!cancelled.isEmpty()) {
      handler.onCancelled(cancelled.remove(cancelled.size() - 1));
    }
  }

  // A bare header, so that it is never larger than what it refuses (hp-4.4-2).
  private void refuse(Header about, Status status, Peer peer, long now) {
    ++counters.refused;
    Header header = new Header();
    header.kind = FrameKind.REFUSE;
    header.priority = about.priority;
    header.session = about.session;
    header.callId = about.callId;
    header.statusNumber = status.number();
    header.senderTimeNs = now;
    sink.send(peer, header.frame(Bytes.NONE, 0));
  }

  // hp-4.1-2, hp-4.1-3
  private Status faultOf(Header header, Hello hello) {
    if (hello.versionMin() > Limits.VERSION || hello.versionMax() < Limits.VERSION) {
      return Status.VERSION_UNSUPPORTED;
    }
    if (hello.messageSizeMax() < Limits.MESSAGE_SIZE_FLOOR
        || hello.messageSizeMax() > Limits.MESSAGE_SIZE_CEILING) {
      return Status.BAD_LIMITS;
    }
    return serves(header.priority) ? null : Status.WRONG_BAND;
  }

  private boolean serves(int priority) {
    return config.bandLow <= priority && priority <= config.bandHigh;
  }

  // hp-4.1-5: in this order.
  private void onHello(Header header, byte[] payload, Peer peer, long now) {
    Hello hello = Hello.read(payload);
    if (hello == null) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    boolean isProven =
        config.medium == Medium.STREAM
            || cookies.isGood(hello.cookie(), peer, hello.clientEpoch(), now);
    // hp-4.4-5
    if (!isProven && !strangerAnswers.admit(peer, now)) {
      counters.drop(DropReason.RATE_LIMITED);
      return;
    }
    Status fault = faultOf(header, hello);
    if (fault != null) {
      refuse(header, fault, peer, now);
      return;
    }
    Header answer = new Header();
    answer.priority = header.priority;
    answer.callId = header.callId;
    answer.senderTimeNs = now;
    // hp-4.2-1
    if (!isProven) {
      if (hello.hasCookie()) {
        counters.drop(DropReason.BAD_COOKIE);
      }
      answer.kind = FrameKind.COOKIE;
      answer.payloadSize = Hello.COOKIE_SIZE;
      answer.messageSize = Hello.COOKIE_SIZE;
      sink.send(peer, answer.frame(cookies.give(peer, hello.clientEpoch(), now), 0));
      return;
    }
    if (isLate(hello, header.callId, peer)) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    Session session = findOrOpen(hello, header.callId, peer, now);
    if (session == null) {
      refuse(header, Status.OVERLOAD, peer, now);
      return;
    }
    Welcome welcome =
        new Welcome(
            config.bandLow,
            config.bandHigh,
            config.ceiling,
            0,
            Limits.CALL_WINDOW,
            config.epoch,
            config.clockDomain,
            messageSizeMax);
    answer.kind = FrameKind.WELCOME;
    answer.session = session.id;
    answer.payloadSize = Welcome.SIZE;
    answer.messageSize = Welcome.SIZE;
    sink.send(peer, answer.frame(welcome.payload(), 0));
  }

  /**
   * Stream only: answers the first frame of a connection for which there is no place: REFUSE
   * overload to a HELLO, nothing to any other frame.
   */
  public void turnAway(byte[] frame, Peer peer, long now) {
    Header header = new Header();
    if (header.readFrame(frame, config.medium) != null || header.kind != FrameKind.HELLO) {
      return;
    }
    Hello hello = Hello.read(Bytes.payloadOf(frame));
    if (hello != null) {
      Status fault = faultOf(header, hello);
      refuse(header, fault == null ? Status.OVERLOAD : fault, peer, now);
    }
  }

  // hp-4.1-6: a late copy of an earlier handshake must not end a later one's session.
  private boolean isLate(Hello hello, int number, Peer peer) {
    if (config.medium == Medium.STREAM) {
      return false;
    }
    for (Session session : sessions) {
      if (session != null
          && session.isOf(hello, peer)
          && number - session.handshakeNumber < 0) {
        return true;
      }
    }
    return false;
  }

  private Session findOrOpen(Hello hello, int number, Peer peer, long now) {
    int best = -1;
    boolean hasCapacity = hasCapacityFor(peer);
    for (int i = 0; i < sessions.length; ++i) {
      Session session = sessions[i];
      boolean isOfChannel = session != null && session.isOf(hello, peer);
      if (isOfChannel && session.handshakeNumber == number) {
        // hp-4.1-4
        session.lastHeard = now;
        return session;
      }
      boolean isOfConnection =
          config.medium == Medium.STREAM && session != null && session.peer.equals(peer);
      if (isOfChannel || isOfConnection) {
        // hp-4-4, hp-4.1-6
        end(session);
        best = i;
        break;
      }
      // hp-4-7: a host that has its share replaces only its own sessions.
      if (!hasCapacity && (session == null || !session.peer.isSameHost(peer))) {
        continue;
      }
      if (best < 0
          || (sessions[best] != null
              && (session == null || session.lastHeard < sessions[best].lastHeard))) {
        best = i;
      }
    }
    if (best < 0) {
      return null;
    }
    if (sessions[best] != null) {
      // hp-5.5-1: a client that still repeats a call relies on its session.
      if (now - sessions[best].lastHeard < Limits.SESSION_IDLE_MIN) {
        return null;
      }
      ++counters.sessionsEvicted;
      end(sessions[best]);
    }
    boolean hasOurClock =
        hello.clockDomain() != 0 && hello.clockDomain() == config.clockDomain;
    Session opened = new Session(newSessionId(best), peer, hello, number, hasOurClock);
    opened.lastHeard = now;
    sessions[best] = opened;
    ++sessionCount;
    ++counters.sessionsOpened;
    return opened;
  }

  private boolean hasCapacityFor(Peer peer) {
    if (config.medium == Medium.STREAM) {
      return true;
    }
    int count = 0;
    for (Session session : sessions) {
      count += session != null && session.peer.isSameHost(peer) ? 1 : 0;
    }
    return count < Limits.shareOfOneHost(sessions.length);
  }

  // Bits 0 to 15 are the index, bits 16 to 39 the masked lane; the rest can't be guessed without
  // the key. Bit 40 ensures that the number is not 0.
  private long newSessionId(int index) {
    long random = config.key.hash(config.epoch, ++sessionSerial, config.lane) | 1L << 40;
    long id = random & ~LANE_BITS & ~INDEX_BITS | index;
    return id | laneMask(id) ^ (long) config.lane << LANE_SHIFT;
  }

  private long laneMask(long id) {
    return config.key.hash(config.epoch, id & ~LANE_BITS) & LANE_BITS;
  }

  // hp-4.4-4: whether another lane gave the number in this life of the server.
  private boolean isOfAnotherLane(long id) {
    long lane = ((id ^ laneMask(id)) & LANE_BITS) >>> LANE_SHIFT;
    return lane < config.laneCount && lane != config.lane;
  }

  // hp-4.4-1, hp-4.4-4
  private void refuseSession(Header about, Peer peer, long now) {
    // hp-4.4-5
    if (config.medium == Medium.DATAGRAM && !strangerAnswers.admit(peer, now)) {
      counters.drop(DropReason.RATE_LIMITED);
    } else if (!isOfAnotherLane(about.session)) {
      counters.drop(DropReason.UNKNOWN_SESSION);
      refuse(about, Status.UNKNOWN_SESSION, peer, now);
    } else if (!about.has(Header.NO_REPLY)) {
      // hp-5.8-1
      refuse(about, Status.WRONG_BAND, peer, now);
    }
  }

  private Session find(long id) {
    int index = (int) (id & INDEX_BITS);
    if (id == 0 || index >= sessions.length) {
      return null;
    }
    Session session = sessions[index];
    return session != null && session.id == id ? session : null;
  }

  /** Whether the request, which {@link Handler#onCall} just got, is of these sessions. */
  public boolean isOwn(Request request) {
    return find(request.session()) == request.session;
  }

  /** Whether a session has this number now. */
  public boolean isKnown(long session) {
    return find(session) != null;
  }

  // The session of a frame, from its own address; null if the frame was dropped.
  private Session sessionOf(Header header, Peer peer) {
    Session session = find(header.session);
    if (session == null) {
      counters.drop(DropReason.UNKNOWN_SESSION);
      return null;
    }
    // hp-5.1-4
    if (!session.peer.equals(peer)) {
      counters.drop(DropReason.FOREIGN_ADDRESS);
      return null;
    }
    return session;
  }

  private void onClose(Header header, byte[] payload, Peer peer) {
    // hp-4.5-3
    if (payload.length > 0) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    // hp-4.5-1
    Session session = sessionOf(header, peer);
    if (session != null) {
      end(session);
    }
  }

  private void end(Session session) {
    for (Slot slot : session.slots) {
      cancel(slot);
      freeStream(slot);
      freeLarge(slot);
    }
    session.isEnded = true;
    sessions[(int) (session.id & INDEX_BITS)] = null;
    --sessionCount;
  }

  /** Stream only: the connection is gone, and its session with it. */
  public void endConnection(Peer peer) {
    for (Session session : sessions.clone()) {
      if (session != null && session.peer.equals(peer)) {
        end(session);
      }
    }
    reportCancelled();
  }

  /** Ends all sessions, and tells their clients, because the server stops (hp-4.5-2). */
  public void closeAll(long now) {
    for (Session session : sessions.clone()) {
      if (session != null) {
        Header header = new Header();
        header.kind = FrameKind.CLOSE;
        header.priority = config.bandLow;
        header.session = session.id;
        header.senderTimeNs = now;
        sink.send(session.peer, header.frame(Bytes.NONE, 0));
        end(session);
      }
    }
    reportCancelled();
  }

  // ---- calls ------------------------------------------------------------------------------------

  private void onCall(Header header, byte[] payload, Peer peer, long now) {
    Session session = find(header.session);
    if (session == null) {
      refuseSession(header, peer, now);
      return;
    }
    // hp-5.1-4: only this address was proven for the session.
    if (!session.peer.equals(peer)) {
      counters.drop(DropReason.FOREIGN_ADDRESS);
      return;
    }
    session.lastHeard = now;
    Slot slot = slotOf(session, header);
    if (slot.state != State.EMPTY) {
      if (slot.callId == header.callId) {
        onCopy(header, payload, slot, now);
        return;
      }
      // hp-5.2-2, hp-5.2-3: what is refused because its place is taken stays refused.
      boolean isNew = isNewer(header.callId, slot.newestCallId);
      if (!isNew && header.callId != slot.newestCallId) {
        counters.drop(DropReason.STALE_CALL);
        return;
      }
      slot.newestCallId = header.callId;
      // hp-5.2-4: a call that nobody waits for does not hold its place, unless it has a buffer.
      boolean isRunning = slot.state == State.RUNNING;
      boolean isAwaited =
          isRunning && !slot.isUnawaited && (now < slot.running.deadline || slot.stream != null);
      boolean isTaken = isAwaited || isRunning && slot.large != null;
      if (!isNew || isTaken) {
        // hp-5.8-1
        if (header.has(Header.NO_REPLY)) {
          ++counters.refused;
        } else {
          refuse(header, Status.OVERLOAD, peer, now);
        }
        return;
      }
    }
    freeStream(slot);
    freeLarge(slot);
    admit(header, payload, slot, now);
  }

  private static Slot slotOf(Session session, Header header) {
    return session.slots[header.callId & Limits.CALL_WINDOW - 1];
  }

  private static boolean isNewer(int callId, int than) {
    return callId - than > 0;
  }

  // hp-5.2-1: a copy never runs.
  private void onCopy(Header header, byte[] payload, Slot slot, long now) {
    Peer peer = slot.session.peer;
    if (slot.isEvicted) {
      refuse(header, Status.OVERLOAD, peer, now);
    } else if (header.has(Header.NO_REPLY)) {
      // hp-5.8-1
      counters.drop(
          slot.state == State.DONE ? DropReason.STALE_CALL : DropReason.DUPLICATE_RUNNING);
    } else if (slot.state == State.RECEIVING) {
      onFragment(header, payload, slot, now);
    } else if (slot.state == State.RUNNING && !slot.isReplied) {
      int frameCount = 0;
      if (slot.stream != null) {
        // A sign of life of the caller.
        extend(slot.stream, leaseEnd(slot.session, header, now));
        frameCount = slot.stream.items.count();
      }
      if (header.has(Header.ACK_WANTED)) {
        // hp-5.6-4: nothing is missing.
        sendAck(header, FragmentAck.upTo(header.fragmentCount), frameCount, peer, now);
      } else {
        counters.drop(DropReason.DUPLICATE_RUNNING);
      }
    } else if (slot.large != null && slot.large.outgoing != null) {
      // It asks for the fragments that are not acknowledged.
      ++counters.duplicatesAnswered;
      slot.large.heard = now;
      slot.large.outgoing.nudge();
      sendFragments(slot, now);
    } else if (slot.kept == null) {
      // Nothing is repeated on a stream; a large reply is not kept once it arrived.
      counters.drop(DropReason.STALE_CALL);
    } else {
      ++counters.duplicatesAnswered;
      sendKept(slot);
    }
  }

  private void sendKept(Slot slot) {
    sink.send(slot.session.peer, Header.markRepeated(slot.kept.clone()));
  }

  // The first frame of a new call.
  private void admit(Header header, byte[] payload, Slot slot, long now) {
    Session session = slot.session;
    slot.begin(State.RUNNING, header.callId);
    slot.isUnawaited = header.has(Header.NO_REPLY);
    long deadline = deadlineOf(session, header, now);
    Request request = new Request(header, session, slot, payload, deadline, now);
    slot.running = request;
    if (Integer.compareUnsigned(header.messageSize, messageSizeMax) > 0) {
      refuseCall(request, Status.TOO_LARGE, now);
      return;
    }
    if (!serves(header.priority)) {
      refuseCall(request, Status.WRONG_BAND, now);
      return;
    }
    // hp-6.2-1
    boolean isPing =
        header.service == Limits.SESSION_SERVICE && header.method == Limits.METHOD_PING;
    if (header.priority > config.ceiling && !isPing) {
      refuseCall(request, Status.PRIORITY_NOT_ALLOWED, now);
      return;
    }
    // hp-5.4-3
    if (deadline <= now) {
      ++counters.expired;
      refuseCall(request, Status.EXPIRED, now);
      return;
    }
    if (header.fragmentCount == 1) {
      dispatch(request, now);
      return;
    }
    Large large = takeLarge(slot, deadline, now);
    if (large == null) {
      refuseCall(request, Status.OVERLOAD, now);
      return;
    }
    slot.state = State.RECEIVING;
    large.incoming = new IncomingMessage(header);
    onFragment(header, payload, slot, now);
  }

  private void dispatch(Request request, long now) {
    if (request.wantsStream()) {
      if (streams.size() >= config.streamCountMax) {
        refuseCall(request, Status.OVERLOAD, now);
        return;
      }
      int fragmentSize = Math.min(payloadSizeMax, request.session.messageSizeMax);
      request.slot.stream =
          new Streaming(
              new OutgoingStream(request.header, config.medium, fragmentSize),
              leaseEnd(request.session, request.header, now));
      streams.add(request.slot);
    }
    handler.onCall(request);
  }

  // hp-5.4-2
  private static long deadlineOf(Session session, Header header, long now) {
    long budget = Integer.toUnsignedLong(header.budgetUs) * Limits.MICROSECOND;
    boolean isPast = header.senderTimeNs >= 0 && header.senderTimeNs <= now;
    return (session.hasOurClock && isPast ? header.senderTimeNs : now) + budget;
  }

  // hp-5.1-5: a REPLY that is kept, so that a copy gets the same answer.
  private void refuseCall(Request request, Status status, long now) {
    if (status != Status.EXPIRED) {
      ++counters.refused;
    }
    complete(request, status, Bytes.NONE, now);
  }

  private void onFragment(Header header, byte[] payload, Slot slot, long now) {
    Large large = slot.large;
    Peer peer = slot.session.peer;
    IncomingMessage.Taken taken = large.incoming.take(header, payload);
    if (taken == IncomingMessage.Taken.FOREIGN) {
      counters.drop(DropReason.BAD_FRAGMENT);
      return;
    }
    // hp-5.6-10: a copy counts, too, as its sender may have missed every ACK.
    large.heard = now;
    if (taken != IncomingMessage.Taken.LAST) {
      if (header.has(Header.ACK_WANTED)) {
        sendAck(header, large.incoming.ack(), 0, peer, now);
      }
      return;
    }
    large.isServed = true;
    slot.state = State.RUNNING;
    long deadline = deadlineOf(slot.session, header, now);
    Request request =
        new Request(header, slot.session, slot, large.incoming.message(), deadline, now);
    slot.running = request;
    if (deadline <= now) {
      ++counters.expired;
      refuseCall(request, Status.EXPIRED, now);
      return;
    }
    dispatch(request, now);
  }

  private void sendAck(Header about, FragmentAck ack, int frameCount, Peer peer, long now) {
    Header header = about.about(FrameKind.ACK, FragmentAck.SIZE, now);
    header.item = frameCount;
    sink.send(peer, header.frame(ack.payload(), 0));
  }

  // How far the client has a large reply.
  private void onAck(Header header, byte[] payload, Peer peer, long now) {
    Session session = sessionOf(header, peer);
    if (session == null) {
      return;
    }
    FragmentAck ack = FragmentAck.read(payload);
    if (ack == null) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    session.lastHeard = now;
    Slot slot = slotOf(session, header);
    if (slot.state != State.DONE
        || slot.callId != header.callId
        || slot.large == null
        || slot.large.outgoing == null) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    slot.large.heard = now;
    slot.large.outgoing.onAck(ack, header.has(Header.ACK_WANTED));
    if (slot.large.outgoing.isAcknowledged()) {
      // hp-5.6-8
      freeLarge(slot);
      retryWaiting(now);
    } else {
      sendFragments(slot, now);
    }
  }

  private void sendFragments(Slot slot, long now) {
    for (byte[] frame; (frame = slot.large.outgoing.next(0, now)) != null; ) {
      sink.send(slot.session.peer, frame);
    }
  }

  /** The largest reply that the session allows. */
  public int replySizeMax(Request request) {
    return Math.min(messageSizeMax, request.session.messageSizeMax);
  }

  /**
   * Answers a call that {@link Request#wantsReceipt} before it runs; ok if it will run. A later
   * {@link #complete} sends nothing.
   */
  public void accept(Request request, Status status, long now) {
    if (!isRunning(request) || request.slot.isUnawaited) {
      return;
    }
    request.slot.isUnawaited = true;
    sendReply(request, status, Bytes.NONE, now);
  }

  /**
   * Ends a call. Each is ended once, in any order.
   *
   * @param payload at most {@link #replySizeMax} bytes; not copied
   */
  public void complete(Request request, Status status, byte[] payload, long now) {
    if (!isRunning(request)) {
      ++counters.orphaned;
      return;
    }
    Slot slot = request.slot;
    freeLarge(slot);
    slot.state = State.DONE;
    slot.running = null;
    if (!slot.isUnawaited) {
      sendReply(request, status, payload, now);
    }
    retryWaiting(now);
  }

  private boolean isRunning(Request request) {
    return !request.session.isEnded
        && request.slot.running == request
        && request.slot.state == State.RUNNING;
  }

  private void sendReply(Request request, Status status, byte[] payload, long now) {
    Slot slot = request.slot;
    Header header = replyHeader(request, status, payload, now);
    if (slot.stream != null) {
      // hp-5.10-6: says which frames the caller lacks. The stream is kept until all are there.
      header.item = slot.stream.items.count();
      if (slot.stream.items.isAcknowledged()) {
        freeStream(slot);
      }
    }
    slot.isReplied = true;
    if (payload.length <= payloadSizeMax) {
      byte[] frame = header.frame(payload, 0);
      if (config.medium == Medium.DATAGRAM) {
        slot.kept = frame;
      }
      sink.send(request.session.peer, frame);
      return;
    }
    if (!beginLargeReply(request, header, payload, now)) {
      // hp-5.6-5: its method ran, so that no status could replace the reply.
      if (waiting.size() < 2 * config.largeCountMax) {
        waiting.add(new Waiting(request, status, payload));
      } else {
        ++counters.orphaned;
      }
    }
  }

  private static Header replyHeader(Request request, Status status, byte[] payload, long now) {
    // hp-5.1-2
    Header header = request.header.about(FrameKind.REPLY, payload.length, now);
    header.statusNumber = status.number();
    long us = (now - request.received) / Limits.MICROSECOND;
    header.budgetUs = (int) Math.min(Math.max(us, 0), 0xffff_ffffL);
    return header;
  }

  private boolean beginLargeReply(Request request, Header header, byte[] payload, long now) {
    Large large = takeLarge(request.slot, request.deadline, now);
    if (large == null) {
      return false;
    }
    large.outgoing =
        new OutgoingMessage(header, payload, payloadSizeMax, config.medium.fragmentWindow);
    sendFragments(request.slot, now);
    return true;
  }

  private void retryWaiting(long now) {
    for (int i = 0; i < waiting.size(); ) {
      Waiting next = waiting.get(i);
      Request request = next.request;
      Slot slot = request.slot;
      boolean isWanted =
          !request.session.isEnded
              && slot.callId == request.header.callId
              && slot.state == State.DONE
              && request.deadline > now;
      if (isWanted) {
        Header header = replyHeader(request, next.status, next.payload, now);
        if (!beginLargeReply(request, header, next.payload, now)) {
          ++i;
          continue;
        }
      } else {
        ++counters.orphaned;
      }
      waiting.remove(i);
    }
  }

  // Takes a place for a large message of the slot's host, evicting another one if that may be.
  private Large takeLarge(Slot slot, long deadline, long now) {
    Peer peer = slot.session.peer;
    Large idle = null;
    Large ownIdle = null;
    int ownCount = 0;
    for (Large other : larges) {
      boolean isOwn = other.peer.isSameHost(peer);
      ownCount += isOwn ? 1 : 0;
      if (other.idleTime() > now) {
        continue;
      }
      idle = idle == null || other.heard < idle.heard ? other : idle;
      if (isOwn) {
        ownIdle = ownIdle == null || other.heard < ownIdle.heard ? other : ownIdle;
      }
    }
    // hp-5.6-11
    boolean hasShare = ownCount >= Limits.shareOfOneHost(config.largeCountMax);
    if (hasShare || larges.size() >= config.largeCountMax) {
      Large evicted = hasShare ? ownIdle : idle;
      if (evicted == null) {
        return null;
      }
      Slot other = evicted.slot;
      boolean isAwaited = evicted.deadline > now;
      // hp-5.6-10: a later fragment is answered only if its sender still waits.
      other.isEvicted = other.state == State.RECEIVING && isAwaited;
      other.state = State.DONE;
      if (isAwaited) {
        ++counters.largeEvicted;
      }
      freeLarge(other);
    }
    Large taken = new Large(slot, peer, deadline, now);
    larges.add(taken);
    slot.large = taken;
    return taken;
  }

  private void freeLarge(Slot slot) {
    if (slot.large != null) {
      larges.remove(slot.large);
      slot.large = null;
    }
  }

  // ---- cancellation -----------------------------------------------------------------------------

  // hp-5.9-1, hp-5.9-2
  private void onCancel(Header header, byte[] payload, Peer peer, long now) {
    Session session = sessionOf(header, peer);
    if (session == null) {
      return;
    }
    if (payload.length > 0) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    session.lastHeard = now;
    Slot slot = slotOf(session, header);
    boolean isKnown = slot.state != State.EMPTY;
    if (isKnown && slot.callId == header.callId) {
      if (slot.state != State.DONE) {
        ++counters.cancelled;
      }
      cancel(slot);
      freeStream(slot);
      if (slot.state != State.RUNNING) {
        freeLarge(slot);
        slot.state = State.DONE;
      }
      return;
    }
    // The CANCEL overtook its call, which must not run when it comes.
    if (isKnown && !isNewer(header.callId, slot.newestCallId)) {
      counters.drop(DropReason.STALE_CALL);
      return;
    }
    ++counters.cancelled;
    if (slot.state == State.RUNNING) {
      // An older call keeps its place; the later one counts as refused.
      slot.newestCallId = header.callId;
      return;
    }
    freeStream(slot);
    freeLarge(slot);
    slot.begin(State.DONE, header.callId);
  }

  private void cancel(Slot slot) {
    if (slot.state == State.RUNNING && !slot.isUnawaited) {
      slot.isUnawaited = true;
      cancelled.add(slot.running);
    }
  }

  // ---- streams ----------------------------------------------------------------------------------

  private void freeStream(Slot slot) {
    if (slot.stream != null) {
      streams.remove(slot);
      slot.stream = null;
    }
  }

  private static void extend(Streaming stream, long deadline) {
    stream.deadline = Math.max(stream.deadline, deadline);
  }

  // hp-5.10-7
  private long leaseEnd(Session session, Header header, long now) {
    if (config.medium == Medium.STREAM && header.budgetUs == Limits.BUDGET_UNLIMITED) {
      return Limits.NEVER;
    }
    long stated = deadlineOf(session, header, now);
    return config.medium == Medium.STREAM
        ? stated
        : Math.min(stated, now + Limits.STREAM_LEASE_MAX);
  }

  /** The largest item of the stream; 0 if it is none, or its caller gave up. */
  public int itemSizeMax(Request request) {
    return isRunning(request) && request.slot.stream != null
        ? Math.min(itemSizeMax, request.session.messageSizeMax)
        : 0;
  }

  /**
   * Sends as much of an item as the caller takes now.
   *
   * @param item at most {@link #itemSizeMax} bytes; the same until {@link #isItemMidway} is false
   * @return whether anything was sent
   */
  public boolean pushItem(Request request, byte[] item, long now) {
    if (!isRunning(request) || request.slot.stream == null) {
      return false;
    }
    OutgoingStream stream = request.slot.stream.items;
    boolean hasSent = false;
    do {
      byte[] frame = stream.push(item, now);
      if (frame == null) {
        return hasSent;
      }
      hasSent = true;
      sink.send(request.session.peer, frame);
    } while (stream.isMidway());
    ++counters.items;
    return true;
  }

  /** Whether a part of the last item is not sent yet. */
  public boolean isItemMidway(Request request) {
    return isRunning(request)
        && request.slot.stream != null
        && request.slot.stream.items.isMidway();
  }

  private void onCredit(Header header, byte[] payload, Peer peer, long now) {
    Session session = find(header.session);
    if (session == null) {
      refuseSession(header, peer, now);
      return;
    }
    if (!session.peer.equals(peer)) {
      counters.drop(DropReason.FOREIGN_ADDRESS);
      return;
    }
    // hp-5.10-8
    Credit credit = Credit.read(payload);
    if (credit == null) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    session.lastHeard = now;
    Slot slot = slotOf(session, header);
    boolean isAsked = header.has(Header.ACK_WANTED);
    boolean isKnown = slot.callId == header.callId && slot.state != State.EMPTY;
    boolean isReplied = isKnown && slot.isReplied;
    if (!isKnown || (slot.stream == null && !isReplied)) {
      if (isAsked) {
        // hp-5.10-7: the stream ended because its caller was silent.
        refuse(header, Status.LOST, peer, now);
      } else {
        counters.drop(DropReason.UNEXPECTED);
      }
      return;
    }
    answerCredit(header, credit, slot, now);
  }

  private void answerCredit(Header header, Credit credit, Slot slot, long now) {
    boolean isAsked = header.has(Header.ACK_WANTED);
    boolean hasRepaired = false;
    Request running = null;
    int frameCount = 0;
    boolean isStream = slot.stream != null;
    if (isStream) {
      OutgoingStream items = slot.stream.items;
      extend(slot.stream, leaseEnd(slot.session, header, now));
      items.onCredit(credit, header.item, isAsked);
      running = slot.state == State.RUNNING ? slot.running : null;
      frameCount = items.count();
      for (byte[] frame; (frame = items.next()) != null; ) {
        hasRepaired = true;
        sink.send(slot.session.peer, frame);
      }
      if (slot.isReplied && items.isAcknowledged()) {
        freeStream(slot);
      }
    }
    if (isAsked && slot.isReplied && slot.kept != null) {
      // hp-5.10-5: the reply is repeated behind the missing frames.
      ++counters.duplicatesAnswered;
      sendKept(slot);
    } else if (isAsked && !hasRepaired && isStream && slot.stream != null) {
      sendAck(header, FragmentAck.upTo(1), frameCount, slot.session.peer, now);
    }
    if (running != null) {
      handler.onCredit(running);
    }
  }

  // ---- time -------------------------------------------------------------------------------------

  /** Ends streams whose caller was silent for too long, and sends replies that waited. */
  public void onTime(long now) {
    for (Slot slot : List.copyOf(streams)) {
      if (slot.stream.deadline <= now) {
        if (slot.state == State.RUNNING) {
          ++counters.expired;
        }
        cancel(slot);
        freeStream(slot);
      }
    }
    retryWaiting(now);
    reportCancelled();
  }

  /** When {@link #onTime} is due. */
  public long nextTime() {
    long next = Limits.NEVER;
    for (int i = 0; i < streams.size(); ++i) {
      next = Math.min(next, streams.get(i).stream.deadline);
    }
    if (!waiting.isEmpty()) {
      for (Large large : larges) {
        next = Math.min(next, large.idleTime());
      }
      for (Waiting reply : waiting) {
        next = Math.min(next, reply.request.deadline);
      }
    }
    return next;
  }
}

package org.rtpm.internal.wire;

import java.util.ArrayList;
import java.util.List;
import org.rtpm.Status;

/**
 * The client's half of the protocol: handshake, calls, repetition, matching of replies, streams.
 *
 * <p>Does no I/O: frames and times (nanoseconds of a monotonic clock) come in, frames go to the
 * sink, and events to the listener. One thread at a time. The listener is called last, so that it
 * may begin calls.
 */
public final class ClientChannel {
  /**
   * How a channel is set up.
   *
   * @param clientEpoch the program's epoch, not 0
   * @param channel unique for each channel of the program
   * @param openCallMax how many calls may be open, 1 to 8, if the server grants them
   * @param handshakeNumber random for each life of the program (hp-4-2)
   * @param framePayloadMax the largest payload of a frame, if less than the medium's
   */
  public record Config(
      Medium medium,
      long clientEpoch,
      long channel,
      long clockDomain,
      int messageSizeMax,
      int openCallMax,
      int handshakeNumber,
      int framePayloadMax) {}

  /** Hears how the handshake and the calls go on. */
  public interface Listener {
    /** The handshake is done. */
    void onReady();

    /** The handshake was refused. */
    void onRefused(Status status);

    /** The handshake's deadline passed. */
    void onOpenTimeout();

    /** A call ended; items of a stream may be left to take. */
    void onReply(Call call, Status status, byte[] payload);

    /** A stream has items: take them by {@link ClientChannel#nextItem}. */
    void onItems(Call call);

    /** A call's deadline passed, or the server of a stream was silent for too long. */
    void onTimeout(Call call);

    /**
     * The server does not know the session. The open calls are over: each may be sent again in a
     * new session if {@link ClientChannel#hasNotRun} says so.
     */
    void onLost(List<Call> open);

    /** The server closed the session: the open calls are over, and may have run. */
    void onClosed(List<Call> open);

    /** Stream only: the peer does not speak the protocol. The connection is to be ended. */
    void onBroken(List<Call> open);
  }

  /** A call, from {@link ClientChannel#call} on. */
  public static final class Call {
    /** For the channel's owner. */
    public Object attachment;

    private final Header header = new Header();
    private final byte[] payload;
    private long deadline;
    private long begun;
    private final long lease;
    private final long silence;
    private final RetransmitTimer timer;
    private boolean isOpen;
    /** A stream whose reply was reported; items may be left. */
    private boolean isEnded;
    /** The server of the stream is known to have the call. */
    private boolean hasAnswered;
    private boolean isCreditDue;
    private boolean isAsking;
    private Status endStatus = Status.OK;
    private OutgoingMessage request;
    private IncomingMessage reply;
    private IncomingStream items;
    private int creditSent;
    private int bytesSent;
    private int freedSent;
    private long asked;
    private int askCount;
    private long itemHeard;
    private long itemGap;
    /** Where replies of its size go; null if each has memory of its own. */
    private byte[] replyMemory;
    /** The frame of the request, if it is written anew for each call. */
    private byte[] frameMemory;

    private Call(CallParameters parameters, byte[] payload, RoundTrip path, long now) {
      this.payload = payload;
      deadline = parameters.deadline();
      lease = parameters.streamLease();
      silence = Math.min(parameters.streamSilence(), Limits.STREAM_SILENCE);
      begun = now;
      timer = new RetransmitTimer(path);
    }

    /** The number of the call. */
    public int id() {
      return header.callId;
    }

    /** When it was first sent. */
    public long begun() {
      return begun;
    }

    public boolean isOpen() {
      return isOpen;
    }
  }

  /** Why a call was not begun, or null. */
  public enum NotBegun {
    TOO_LARGE,
    WRONG_BAND,
    WINDOW_FULL
  }

  private final Config config;
  private final FrameSink sink;
  private final Listener listener;
  private final int framePayloadMax;
  private final Header read = new Header();
  private final Counters counters = new Counters();
  private final RoundTrip roundTrip = new RoundTrip();
  private final RetransmitTimer helloTimer = new RetransmitTimer(new RoundTrip());
  private final ClockEstimator clock = new ClockEstimator();
  private final List<Call> calls = new ArrayList<>(Limits.CALL_WINDOW);
  /** Calls that were given up, at most one for each place of a call. */
  private final List<Header> givenUp = new ArrayList<>();
  private boolean isReady;
  private boolean isOpening;
  private boolean mayAnswerCookie;
  private int helloPriority;
  private int handshakeNumber;
  private long helloDeadline;
  private byte[] cookie = new byte[Hello.COOKIE_SIZE];
  private Welcome welcome;
  private long session;
  private int callId;
  private NotBegun notBegun;

  public ClientChannel(Config config, FrameSink sink, Listener listener) {
    this.config = config;
    this.sink = sink;
    this.listener = listener;
    handshakeNumber = config.handshakeNumber;
    framePayloadMax = Math.min(config.framePayloadMax, config.medium.payloadSizeMax);
  }

  /**
   * Whether a call that was refused with unknown_session has certainly not run (hp-5.5-2): the
   * server has the same epoch, and would have kept a session that it heard since.
   */
  public static boolean hasNotRun(long lostEpoch, long epochNow, long begun, long now) {
    return lostEpoch == epochNow && now - begun < Limits.SESSION_IDLE_MIN;
  }

  /** Where no frame leaves the host, none is lost on the way, so copies are sent later. */
  public void setOnHost(boolean isOnHost) {
    roundTrip.setIntervalMin(
        isOnHost ? Limits.RETRANSMIT_INTERVAL_ON_HOST : Limits.RETRANSMIT_INTERVAL_MIN);
  }

  public boolean isReady() {
    return isReady;
  }

  public boolean isOpening() {
    return isOpening;
  }

  /** The server's grants in the last handshake. */
  public Welcome welcome() {
    return welcome;
  }

  public long session() {
    return session;
  }

  public Counters counters() {
    return counters;
  }

  /** The smoothed round trip in nanoseconds; 0 before the first measurement. */
  public long roundTripNs() {
    return roundTrip.smoothed();
  }

  // ---- handshake --------------------------------------------------------------------------------

  /** Starts a handshake for the band of {@code priority}. Ends open calls without an event. */
  public void open(int priority, long deadline, long now) {
    reset();
    isOpening = true;
    mayAnswerCookie = true;
    helloPriority = priority;
    ++handshakeNumber; // hp-4-2: answers to earlier handshakes do not match it.
    helloDeadline = deadline;
    cookie = new byte[Hello.COOKIE_SIZE];
    helloTimer.begin(now);
    sendHello(now);
  }

  private void sendHello(long now) {
    Header header = new Header();
    header.kind = FrameKind.HELLO;
    header.priority = helloPriority;
    header.flags = helloTimer.repeatCount() > 0 ? Header.REPEATED : 0;
    header.callId = handshakeNumber;
    header.payloadSize = Hello.SIZE;
    header.messageSize = Hello.SIZE;
    header.senderTimeNs = now;
    Hello hello =
        new Hello(
            Limits.VERSION,
            Limits.VERSION,
            0,
            config.clientEpoch,
            config.channel,
            config.clockDomain,
            config.messageSizeMax,
            cookie);
    sink.send(header.frame(hello.payload(), 0));
  }

  /** Ends the session and the open calls, and tells the server. */
  public void close(long now) {
    if (session != 0) {
      Header header = new Header();
      header.kind = FrameKind.CLOSE;
      header.priority = helloPriority;
      header.session = session;
      header.senderTimeNs = now;
      sink.send(header.frame(Bytes.NONE, 0));
    }
    reset();
  }

  /** The connection is gone: the next call needs a handshake. Returns the calls that were open. */
  public List<Call> reset() {
    isReady = false;
    isOpening = false;
    session = 0;
    givenUp.clear();
    return endAll();
  }

  private List<Call> endAll() {
    List<Call> open = new ArrayList<>();
    for (Call call : List.copyOf(calls)) {
      // The items of a stream that ended well can still be taken.
      if (!call.isEnded) {
        open.add(call);
        end(call);
      }
    }
    return open;
  }

  private void end(Call call) {
    call.isOpen = false;
    call.isEnded = false;
    call.request = null;
    call.items = null;
    calls.remove(call);
  }

  // ---- calls ------------------------------------------------------------------------------------

  /** Whether another call can begin now. */
  public boolean hasFreeCall() {
    return isReady && calls.size() < Math.min(config.openCallMax, welcome.window());
  }

  /**
   * Begins a call on a channel that {@link #isReady}.
   *
   * @param payload is not copied, and must not change until the call ends
   * @return the call, which is over at once with {@link Delivery#SENT}; null if it was not begun,
   *     see {@link #notBegun}
   */
  public Call call(CallParameters parameters, byte[] payload, long now) {
    notBegun = fault(parameters.priority(), parameters.delivery(), payload);
    if (notBegun != null) {
      return null;
    }
    Call call = new Call(parameters, payload, roundTrip, now);
    // hp-5.1-1: the count goes on across sessions, so that no two calls share a number.
    callId = nextCallId();
    Header header = call.header;
    header.priority = parameters.priority();
    header.session = session;
    header.callId = callId;
    header.service = parameters.service();
    header.method = parameters.method();
    header.traceId = parameters.traceId();
    header.payloadSize = payload.length;
    header.messageSize = payload.length;
    freePlaceOf(call, now);
    if (parameters.delivery() == Delivery.SENT) {
      header.flags = Header.NO_REPLY;
      sendCall(call, now);
      return call;
    }
    if (parameters.delivery() == Delivery.RECEIPT) {
      header.flags = Header.REPLY_ON_RECEIPT;
    }
    if (parameters.streamWindow() > 0) {
      call.items =
          new IncomingStream(
              config.medium,
              parameters.streamWindow(),
              Math.max(parameters.byteWindow(), config.medium.streamBytesFirst),
              config.messageSizeMax);
      header.item = parameters.streamWindow();
      call.creditSent = header.item;
      call.bytesSent = config.medium.streamBytesFirst;
    }
    begin(call, now);
    return call;
  }

  /** Why the last {@link #call} was not begun. */
  public NotBegun notBegun() {
    return notBegun;
  }

  private NotBegun fault(int priority, Delivery delivery, byte[] payload) {
    if (!hasFreeCall()) {
      return NotBegun.WINDOW_FULL;
    }
    // hp-5.1-8
    if (!welcome.serves(priority)) {
      return NotBegun.WRONG_BAND;
    }
    boolean isTooLarge =
        payload.length > Math.min(config.messageSizeMax, welcome.messageSizeMax())
            || payload.length > (long) framePayloadMax * Limits.FRAGMENT_COUNT_MAX
            || (delivery == Delivery.SENT && payload.length > framePayloadMax);
    return isTooLarge ? NotBegun.TOO_LARGE : null;
  }

  // hp-4.3-2: a number is free if the call that the server keeps in the same place has ended.
  private int nextCallId() {
    int id = callId;
    boolean isTaken = true;
    while (isTaken) {
      ++id;
      isTaken = false;
      for (int i = 0; i < calls.size(); ++i) {
        int taken = calls.get(i).header.callId;
        isTaken |= Integer.remainderUnsigned(id - taken, welcome.window()) == 0;
      }
    }
    return id;
  }

  /**
   * Lets a call be begun again by {@link #again}, without garbage: a reply of the memory's size is
   * written there, and that memory given to the listener.
   *
   * @param reusesFrame whether the sink is done with a frame when it returns
   */
  public void reuse(Call call, byte[] replyMemory, boolean reusesFrame) {
    call.replyMemory = replyMemory;
    if (reusesFrame && call.payload.length <= framePayloadMax) {
      call.frameMemory = new byte[Limits.HEADER_SIZE + call.payload.length];
    }
  }

  /**
   * Begins a call that ended once more, with the same object and method and what its payload is
   * now.
   *
   * @return false if it was not begun, see {@link #notBegun}
   */
  public boolean again(
      Call call, int service, int priority, long traceId, long deadline, long now) {
    notBegun = fault(priority, Delivery.REPLY, call.payload);
    if (notBegun != null) {
      return false;
    }
    callId = nextCallId();
    call.deadline = deadline;
    call.begun = now;
    call.reply = null;
    Header header = call.header;
    header.flags = 0;
    header.priority = priority;
    header.session = session;
    header.callId = callId;
    header.service = service;
    header.traceId = traceId;
    freePlaceOf(call, now);
    begin(call, now);
    return true;
  }

  private void begin(Call call, long now) {
    call.isOpen = true;
    calls.add(call);
    call.timer.begin(now);
    call.asked = now;
    call.itemHeard = now;
    call.askCount = 1;
    if (call.payload.length <= framePayloadMax) {
      sendCall(call, now);
      return;
    }
    call.request =
        new OutgoingMessage(
            call.header, call.payload, framePayloadMax, config.medium.fragmentWindow);
    sendMore(now);
  }

  // hp-5.3-2: each copy states the time that is left when it is sent.
  private void sendCall(Call call, long now) {
    call.header.budgetUs = budget(call, now);
    call.header.senderTimeNs = now;
    if (call.frameMemory == null) {
      sink.send(call.header.frame(call.payload, 0));
      return;
    }
    call.header.write(call.frameMemory);
    System.arraycopy(
        call.payload, 0, call.frameMemory, Limits.HEADER_SIZE, call.payload.length);
    sink.send(call.frameMemory);
  }

  private int budget(Call call, long now) {
    // hp-5.10-7: for a stream, how long the client may be silent.
    if (call.items != null) {
      long lease =
          config.medium == Medium.DATAGRAM
              ? Math.min(call.lease, Limits.STREAM_LEASE_MAX)
              : call.lease;
      return microseconds(Math.min(call.deadline == Limits.NEVER
          ? Limits.NEVER : call.deadline - now, lease));
    }
    return call.deadline == Limits.NEVER
        ? Limits.BUDGET_UNLIMITED
        : microseconds(call.deadline - now);
  }

  // Rounded up, so that it is 0 only if no time is left (hp-5.4-1).
  private static int microseconds(long nanoseconds) {
    if (nanoseconds <= 0) {
      return 0;
    }
    long us = nanoseconds / Limits.MICROSECOND + (nanoseconds % Limits.MICROSECOND > 0 ? 1 : 0);
    return (int) Math.min(us, 0xffff_ffffL);
  }

  /** Ends an open call whose caller gave up, and tells the server. The call may have run. */
  public void cancel(Call call, long now) {
    if (call.isOpen) {
      end(call);
      giveUp(call, now);
    }
  }

  private void sendCancel(Header about, long now) {
    sink.send(about.about(FrameKind.CANCEL, 0, now).frame(Bytes.NONE, 0));
  }

  private void giveUp(Call call, long now) {
    sendCancel(call.header, now);
    if (config.medium == Medium.DATAGRAM) {
      givenUp.add(call.header.copy());
    }
  }

  // A lost CANCEL leaves its call running in a place that a new call needs: sends it once more.
  private void freePlaceOf(Call call, long now) {
    for (int i = 0; i < givenUp.size(); ++i) {
      Header before = givenUp.get(i);
      if (Integer.remainderUnsigned(call.header.callId - before.callId, welcome.window()) == 0) {
        givenUp.remove(i);
        sendCancel(before, now);
        return;
      }
    }
  }

  /**
   * Returns the next item of a stream, in order; null if there is none now. The item before counts
   * as done with. Call {@link #flush} after the last one that is taken now.
   */
  public byte[] nextItem(Call call) {
    if (!call.isOpen || call.items == null) {
      return null;
    }
    byte[] item = call.items.next();
    if (item == null && call.isEnded) {
      end(call);
      return null;
    }
    lookAtCredit(call);
    return item;
  }

  /** Whether items of a stream can be taken. */
  public boolean hasItems(Call call) {
    return call.isOpen && call.items != null && call.items.hasNext();
  }

  /** Tells servers of streams how much more they may send. */
  public void flush(long now) {
    sendMore(now);
  }

  // Sends the CREDITs that are due, and the fragments of requests that may go.
  private void sendMore(long now) {
    for (Call call : calls) {
      if (call.isCreditDue) {
        sendCredit(call, now);
      }
      if (call.request != null) {
        for (byte[] frame; (frame = call.request.next(budget(call, now), now)) != null; ) {
          sink.send(frame);
        }
      }
    }
  }

  // ---- time -------------------------------------------------------------------------------------

  /** When {@link #onTime} is due, unless a frame comes earlier. */
  public long nextTime() {
    if (isOpening) {
      return Math.min(helloDeadline, helloTimer.due());
    }
    long next = Limits.NEVER;
    for (int i = 0; i < calls.size(); ++i) {
      next = Math.min(next, due(calls.get(i)));
    }
    return next;
  }

  /** Does what is due. */
  public void onTime(long now) {
    if (isOpening) {
      onOpeningTime(now);
      return;
    }
    for (Call call : List.copyOf(calls)) {
      if (call.isOpen && now >= due(call)) {
        onCallTime(call, now);
      }
    }
  }

  private void onOpeningTime(long now) {
    if (now >= helloDeadline) {
      isOpening = false;
      listener.onOpenTimeout();
      return;
    }
    if (now < helloTimer.due()) {
      return;
    }
    helloTimer.repeat(now);
    mayAnswerCookie = true;
    // A stream loses no HELLO, so that only the deadline counts.
    if (config.medium == Medium.DATAGRAM) {
      sendHello(now);
    }
  }

  private long due(Call call) {
    if (call.isEnded) {
      return Limits.NEVER;
    }
    // hp-5.3-4: nothing is repeated over a connection. hp-5.10-5: but a stream's client asks.
    if (config.medium == Medium.STREAM && !isStreamKnown(call)) {
      return call.deadline;
    }
    return Math.min(call.deadline, call.timer.due());
  }

  // Whether to ask after items instead of repeating the call.
  private boolean isStreamKnown(Call call) {
    return call.items != null
        && (call.hasAnswered || (config.medium == Medium.STREAM && call.request == null));
  }

  private void onCallTime(Call call, long now) {
    // A reader that was busy elsewhere asked nothing, so that the server owes no answer.
    boolean isSilent =
        call.items != null && call.askCount >= 3 && now - call.asked >= call.silence;
    if (now < call.deadline && !isSilent) {
      repeat(call, now);
      return;
    }
    // The server knows a call's deadline itself, but not a stream's.
    if (call.items != null) {
      giveUp(call, now);
    }
    end(call);
    listener.onTimeout(call);
  }

  // hp-5.6-7, hp-5.10-5
  private void repeat(Call call, long now) {
    boolean isAsking = isStreamKnown(call);
    if (config.medium == Medium.STREAM && !isAsking) {
      return;
    }
    call.timer.repeat(now);
    if (call.askCount++ == 0) {
      call.asked = now;
    }
    if (isAsking) {
      askAfter(call, call.timer.current(), now);
      call.isAsking = true;
      sendCredit(call, now);
    } else if (call.request != null && !call.request.isAcknowledged()) {
      call.request.nudge();
      sendMore(now);
    } else if (call.reply != null) {
      sendReplyAck(call, true, now);
    } else if (call.request != null) {
      sink.send(call.request.firstAgain(budget(call, now), now));
    } else {
      call.header.flags |= Header.REPEATED;
      // hp-5.10-3: the caller learns whether the stream runs before it asks after items.
      if (call.items != null) {
        call.header.flags |= Header.ACK_WANTED;
      }
      sendCall(call, now);
    }
  }

  // ---- frames -----------------------------------------------------------------------------------

  /** Takes a received frame in, which may be anything. */
  public void onFrame(byte[] frame, long now) {
    ++counters.received;
    DropReason fault = read.readFrame(frame, config.medium);
    if (fault != null) {
      counters.drop(fault);
      if (config.medium == Medium.STREAM) {
        // hp-8-2: where the next frame begins is unknown.
        listener.onBroken(reset());
      }
      return;
    }
    if (read.kind == FrameKind.REPLY && onReusedReply(frame, now)) {
      return;
    }
    byte[] payload = Bytes.payloadOf(frame);
    switch (read.kind) {
      case REPLY -> onReply(payload, now);
      case ITEM -> onItem(payload, now);
      case COOKIE -> onCookie(payload, now);
      case WELCOME -> onWelcome(payload, now);
      case REFUSE -> onRefuse(payload);
      case ACK -> onAck(payload, now);
      case CLOSE -> onClose(payload);
      // hp-3-1: only a server receives the others.
      default -> counters.drop(DropReason.BAD_KIND);
    }
  }

  // hp-4-3
  private boolean isOfThisHandshake() {
    return isOpening && read.callId == handshakeNumber;
  }

  private void onCookie(byte[] payload, long now) {
    if (!isOfThisHandshake() || config.medium == Medium.STREAM) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    if (payload.length != Hello.COOKIE_SIZE) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    cookie = payload;
    // hp-4.2-3, hp-4.2-4: a forger of COOKIEs must not keep the client sending.
    if (mayAnswerCookie) {
      mayAnswerCookie = false;
      sendHello(now);
    }
  }

  private void onWelcome(byte[] payload, long now) {
    if (!isOfThisHandshake()) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    Welcome granted = Welcome.read(payload, 0);
    // hp-4.3-1
    if (granted == null || read.session == 0 || !granted.serves(helloPriority)) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    welcome = granted;
    session = read.session;
    isReady = true;
    isOpening = false;
    helloTimer.end(now);
    listener.onReady();
  }

  private void onRefuse(byte[] payload) {
    // hp-4.4-3: taken as an answer it would mean that a method ran.
    if (read.statusNumber == Status.OK.number()) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    // hp-4.4-2
    if (payload.length > 0) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    Status status = read.status();
    if (isOfThisHandshake() && read.session == 0) {
      isOpening = false;
      listener.onRefused(status);
      return;
    }
    if (!isReady || read.session != session) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    Call refused = null;
    boolean isIdle = true;
    for (Call call : calls) {
      if (!call.isEnded) {
        isIdle = false;
        refused = call.header.callId == read.callId ? call : refused;
      }
    }
    if (status == Status.UNKNOWN_SESSION && (refused != null || isIdle)) {
      // hp-5.5-3. If no call is open it was a oneway's, or an ended call's (5.5).
      isReady = false;
    }
    if (refused == null) {
      counters.drop(DropReason.UNEXPECTED);
    } else if (status == Status.UNKNOWN_SESSION) {
      listener.onLost(endAll());
    } else {
      end(refused);
      listener.onReply(refused, status, Bytes.NONE);
    }
  }

  // hp-4.5-2: only a peer that sees the session's traffic knows its number.
  private void onClose(byte[] payload) {
    if (!isReady || read.session != session) {
      counters.drop(DropReason.UNEXPECTED);
    } else if (payload.length > 0) {
      counters.drop(DropReason.BAD_PAYLOAD);
    } else {
      listener.onClosed(reset());
    }
  }

  // hp-5.1-3: an answer counts only if session, call, service and method are an open call's.
  private Call find() {
    if (read.session != session) {
      return null;
    }
    for (int i = 0; i < calls.size(); ++i) {
      Call call = calls.get(i);
      if (call.header.callId == read.callId
          && call.header.service == read.service
          && call.header.method == read.method) {
        return call;
      }
    }
    return null;
  }

  private void onReply(byte[] payload, long now) {
    Call call = find();
    if (call == null || call.isEnded) {
      counters.drop(DropReason.UNEXPECTED);
    } else if (call.items != null) {
      onStreamEnd(call, payload, now);
    } else if (read.fragmentCount > 1) {
      onLargeReply(call, payload, now);
    } else {
      learnClock(call, now);
      end(call);
      call.timer.end(now);
      listener.onReply(call, read.status(), payload);
    }
  }

  // Whether the frame is the reply of a call that is reused, and of its usual size.
  private boolean onReusedReply(byte[] frame, long now) {
    Call call = find();
    boolean isUsual =
        call != null
            && call.replyMemory != null
            && read.fragmentCount == 1
            && read.statusNumber == Status.OK.number()
            && read.payloadSize == call.replyMemory.length;
    if (isUsual) {
      System.arraycopy(frame, Limits.HEADER_SIZE, call.replyMemory, 0, read.payloadSize);
      learnClock(call, now);
      end(call);
      call.timer.end(now);
      listener.onReply(call, Status.OK, call.replyMemory);
    }
    return isUsual;
  }

  // hp-5.7-1: the four times are known only if the call and its reply were each sent once.
  private void learnClock(Call call, long now) {
    boolean isOneClock =
        config.clockDomain != 0 && config.clockDomain == welcome.clockDomain();
    // Larger times are invalid, and their differences could overflow.
    boolean isPossible = read.senderTimeNs >= 0 && read.senderTimeNs < 1L << 61;
    if (!isOneClock
        && isPossible
        && call.timer.repeatCount() == 0
        && call.request == null
        && !read.has(Header.REPEATED)) {
      long took = Integer.toUnsignedLong(read.budgetUs) * Limits.MICROSECOND;
      clock.add(call.begun, read.senderTimeNs - took, read.senderTimeNs, now);
    }
  }

  private void onLargeReply(Call call, byte[] payload, long now) {
    // hp-5.6-5: HELLO stated the limit.
    if (read.messageSize > config.messageSizeMax) {
      counters.drop(DropReason.BAD_LENGTH);
      return;
    }
    if (call.reply == null) {
      call.reply = new IncomingMessage(read);
    }
    IncomingMessage.Taken taken = call.reply.take(read, payload);
    if (taken == IncomingMessage.Taken.FOREIGN) {
      counters.drop(DropReason.BAD_FRAGMENT);
      return;
    }
    call.timer.progress(now);
    if (taken == IncomingMessage.Taken.LAST) {
      end(call);
      call.timer.end(now);
      // hp-5.6-8: the ACK lets the server release the reply.
      sendReplyAck(call, false, now);
      listener.onReply(call, read.status(), call.reply.message());
    } else if (read.has(Header.ACK_WANTED)) {
      sendReplyAck(call, false, now);
    }
  }

  private void sendReplyAck(Call call, boolean isAsking, long now) {
    Header header = call.header.about(FrameKind.ACK, FragmentAck.SIZE, now);
    header.flags = isAsking ? Header.ACK_WANTED : 0;
    sink.send(header.frame(call.reply.ack().payload(), 0));
  }

  // How far a request is, or a sign of life of a stream's server.
  private void onAck(byte[] payload, long now) {
    Call call = find();
    boolean isStream = call != null && call.items != null && !call.isEnded;
    if (call == null || (call.request == null && !isStream)) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    FragmentAck ack = FragmentAck.read(payload);
    if (ack == null) {
      counters.drop(DropReason.BAD_PAYLOAD);
      return;
    }
    if (call.request != null) {
      call.request.onAck(ack, false);
    }
    if (isStream && (call.request == null || call.request.isAcknowledged())) {
      hear(call);
      // hp-5.10-5: nothing is missing, so that the next question is not urgent.
      askAfter(call, call.timer.current(), now);
    } else {
      call.timer.progress(now);
    }
    sendMore(now);
  }

  // ---- streams ----------------------------------------------------------------------------------

  private static void hear(Call call) {
    call.hasAnswered = true;
    call.request = null;
    call.askCount = 0;
  }

  // The pace of items, and how soon one counts as lost, say when to ask next.
  private void hearItems(Call call, long now) {
    hear(call);
    long least =
        config.medium == Medium.STREAM
            ? Limits.STREAM_ASK_INTERVAL_CONNECTED
            : roundTrip.interval();
    // The rest of an item comes soon, even if items are rare.
    askAfter(call, call.items.isMidway() ? least : Math.max(4 * call.itemGap, least), now);
  }

  private static void askAfter(Call call, long wait, long now) {
    call.timer.waitFor(
        now, Math.min(wait, Math.min(Limits.STREAM_ASK_INTERVAL_MAX, call.silence / 4)));
  }

  private void onItem(byte[] payload, long now) {
    Call call = find();
    if (call == null || call.items == null) {
      counters.drop(DropReason.UNEXPECTED);
      // hp-5.9-3: an earlier CANCEL was lost.
      if (call == null && isReady && read.session == session) {
        sendCancel(read, now);
      }
      return;
    }
    if (call.isEnded) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    // hp-5.10-10: HELLO stated the limit.
    if (read.messageSize > config.messageSizeMax) {
      counters.drop(DropReason.BAD_LENGTH);
      return;
    }
    boolean revealsGap = call.items.revealsGap(read.item);
    int droppedBefore = call.items.droppedCount();
    IncomingStream.Taken taken = call.items.take(read, payload);
    boolean isDuplicate = taken == IncomingStream.Taken.DUPLICATE;
    if (taken == IncomingStream.Taken.FOREIGN || isDuplicate) {
      counters.drop(DropReason.UNEXPECTED);
    }
    if (taken == IncomingStream.Taken.FOREIGN) {
      return;
    }
    if (call.items.droppedCount() != droppedBefore) {
      counters.drop(DropReason.UNEXPECTED);
    }
    if (!isDuplicate && !read.has(Header.REPEATED) && read.fragmentIndex == 0) {
      // A long pause must not dominate the mean.
      long gap = Math.min(now - call.itemHeard, Limits.STREAM_ASK_INTERVAL_MAX / 4);
      call.itemGap += (gap - call.itemGap) / 8;
      call.itemHeard = now;
    }
    hearItems(call, now);
    // hp-5.10-4: each gap is reported once. A CREDIT for each copy would bring copies without end.
    if (revealsGap && !isDuplicate) {
      call.isCreditDue = true;
    }
    lookAtCredit(call);
    if (call.items.isComplete()) {
      endOfStream(call, Bytes.NONE, now);
    } else if (call.items.hasNext()) {
      listener.onItems(call);
      sendMore(now);
    } else {
      sendMore(now);
    }
  }

  private void onStreamEnd(Call call, byte[] payload, long now) {
    Status status = read.status();
    // hp-5.10-6: lost frames still come, unless the server dropped them.
    boolean isGivenUp =
        status == Status.EXPIRED
            || status == Status.CANCELLED
            || status == Status.STOPPING
            || status == Status.LOST;
    boolean isDuplicate = call.items.isEnded();
    if (!isGivenUp && !call.items.end(read.item)) {
      counters.drop(DropReason.UNEXPECTED);
      return;
    }
    call.endStatus = status;
    // From now on only items count as progress: a server that does not send the items that it
    // counted is silent. It is asked at once only once, or both sides would do nothing else.
    if (isDuplicate && !isGivenUp) {
      return;
    }
    hearItems(call, now);
    if (isGivenUp || call.items.isComplete()) {
      // hp-7-1: the refusal of a stream without items carries the reason.
      endOfStream(call, read.item == 0 ? payload : Bytes.NONE, now);
      return;
    }
    call.isAsking = true;
    sendCredit(call, now);
  }

  private void endOfStream(Call call, byte[] payload, long now) {
    call.isEnded = true;
    // hp-5.10-6: a last CREDIT lets the server release the frames.
    sendCredit(call, now);
    listener.onReply(call, call.endStatus, payload);
  }

  // hp-5.10-4: after half a window, so that the server never stalls.
  private static void lookAtCredit(Call call) {
    // Useless before the server has the whole call.
    if (call.isEnded || !call.hasAnswered) {
      return;
    }
    IncomingStream items = call.items;
    int itemCount = items.limit() - call.creditSent;
    int frameCount = items.freedCount() - call.freedSent;
    // May be below 0: at first the server may send more than this client's window.
    int bytes = items.credit().byteLimit() - call.bytesSent;
    if (2 * itemCount >= call.header.item
        || frameCount >= Limits.STREAM_WINDOW / 2
        || 2L * bytes >= items.byteWindow()) {
      call.isCreditDue = true;
    }
  }

  private void sendCredit(Call call, long now) {
    Header header = call.header.about(FrameKind.CREDIT, Credit.SIZE, now);
    header.flags = call.isAsking ? Header.ACK_WANTED : 0;
    header.budgetUs = budget(call, now);
    header.item = call.items.limit();
    Credit credit = call.items.credit();
    call.creditSent = header.item;
    call.bytesSent = credit.byteLimit();
    call.freedSent = call.items.freedCount();
    call.isCreditDue = false;
    call.isAsking = false;
    sink.send(header.frame(credit.payload(), 0));
  }

  /** How far the server's clock is ahead, in nanoseconds; null before the first measurement. */
  public Long clockOffsetNs(long now) {
    if (welcome != null
        && config.clockDomain != 0
        && config.clockDomain == welcome.clockDomain()) {
      return 0L;
    }
    ClockEstimator.PeerClock estimate = clock.estimate(now);
    return estimate == null ? null : Long.valueOf(estimate.offsetNs());
  }
}

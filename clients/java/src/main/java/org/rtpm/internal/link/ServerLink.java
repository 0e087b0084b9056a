package org.rtpm.internal.link;

import java.util.ArrayList;
import java.util.List;
import java.util.function.IntSupplier;
import java.util.function.LongSupplier;
import org.rtpm.Status;
import org.rtpm.internal.sealed.KeyPair;
import org.rtpm.internal.sealed.SealedClient;
import org.rtpm.internal.sealed.Sealing;
import org.rtpm.internal.sealed.Suite;
import org.rtpm.internal.wire.BindReply;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.CallParameters;
import org.rtpm.internal.wire.ClientChannel;
import org.rtpm.internal.wire.Delivery;
import org.rtpm.internal.wire.FrameSink;
import org.rtpm.internal.wire.InterfaceText;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;

/**
 * A program's way to one server: sessions for the bands of its calls, binds, and calls that survive
 * a lost session where that is safe (hp-5.5-2, hp-6.1). Does no I/O.
 *
 * <p>One thread at a time. Handlers and the transport are called with the link locked.
 */
public final class ServerLink {
  /**
   * How a link is set up.
   *
   * @param channelNumbers a number for each channel
   * @param random for the first handshake's number
   * @param isOnHost no frame leaves this host
   * @param own this program's key; null: sessions are not sealed
   * @param serverKey the server's key
   * @param presharedKey 32 bytes
   */
  public record Config(
      Medium medium,
      long clientEpoch,
      LongSupplier channelNumbers,
      long clockDomain,
      int messageSizeMax,
      IntSupplier random,
      boolean isOnHost,
      KeyPair own,
      byte[] serverKey,
      byte[] presharedKey) {}

  /** Opens and closes the sockets of channels. */
  public interface Transport {
    /** Returns the sink of a channel's frames; over TCP it may keep them until it is connected. */
    FrameSink connect(ChannelOfBand channel);

    /** Closes the channel's socket. It may be connected again. */
    void disconnect(ChannelOfBand channel);
  }

  static final long PING_INTERVAL = 10 * Limits.SECOND;
  /** How many calls may wait for a place in a session. */
  private static final int QUEUE_SIZE_MAX = 1024;
  private static final int CHANNEL_COUNT_MAX = 64;
  /** How long a ping, or a bind for nobody in particular, waits. */
  private static final long PING_PATIENCE = Limits.SECOND;
  /** The method of a call that only waits until its session is open. */
  private static final int METHOD_READY = -1;

  final Transport transport;
  private final Config config;
  private final List<ChannelOfBand> channels = new ArrayList<>();
  private long now;
  private boolean isPumping;
  private boolean isClosed;

  public ServerLink(Config config, Transport transport) {
    this.config = config;
    this.transport = transport;
  }

  // ---- for bindings -----------------------------------------------------------------------------

  /**
   * Binds an object, and opens the session for its priority.
   *
   * @param handler is told ok when calls can begin
   */
  public void bind(LinkObject object, long deadline, LinkCall.Handler handler, long at) {
    now = at;
    LinkCall ready =
        LinkCall.of(
            object,
            METHOD_READY,
            object.priority,
            0,
            deadline,
            Delivery.REPLY,
            0,
            true,
            Bytes.NONE,
            handler);
    route(ready);
  }

  /** Begins a call, at once or when its session is open. */
  public void call(LinkCall call, long at) {
    now = at;
    route(call);
  }

  /** Ends a call whose caller gave up. Its handler hears nothing more. */
  public void cancel(LinkCall call, long at) {
    now = at;
    if (call.channel != null) {
      ChannelOfBand channel = call.channel;
      channel.queue.remove(call);
      channel.lost.remove(call);
      if (channel.open.remove(call) && call.call != null) {
        channel.channel.cancel(call.call, now);
        channel.settle(now);
      }
      call.isOver = true;
      pump(channel);
    }
    if (call.object != null) {
      call.object.waiting.remove(call);
    }
    call.isOver = true;
  }

  /** The next item of a stream; null if there is none now. Call {@link #flush} behind the last. */
  public byte[] nextItem(LinkCall call) {
    if (call.channel == null || call.call == null) {
      return null;
    }
    byte[] item = call.channel.channel.nextItem(call.call);
    if (item == null && !call.call.isOpen()) {
      call.channel.open.remove(call);
    }
    return item;
  }

  /** Whether items of a stream that came are not taken yet. */
  public boolean hasItems(LinkCall call) {
    return call.channel != null
        && call.call != null
        && call.channel.channel.hasItems(call.call);
  }

  /** Calls the session itself, at the object's priority. */
  public void ping(LinkObject object, long deadline, LinkCall.Handler handler, long at) {
    now = at;
    route(
        LinkCall.ofSession(
            Limits.METHOD_PING, object.priorityFor(-1), deadline, Bytes.NONE, handler));
  }

  /** Lets the servers of streams send more. */
  public void flush(LinkCall call, long at) {
    now = at;
    if (call.channel != null) {
      call.channel.channel.flush(now);
      call.channel.settle(now);
    }
  }

  /** Whether its sessions are sealed. */
  public boolean isSealed() {
    return config.own != null;
  }

  /** Whether no call is open or waits. */
  public boolean isIdle() {
    for (ChannelOfBand channel : channels) {
      if (!channel.isIdle()) {
        return false;
      }
    }
    return true;
  }

  /** Closes the sessions; open calls end as cancelled. */
  public void close(long at) {
    now = at;
    isClosed = true;
    for (ChannelOfBand channel : channels) {
      List<LinkCall> all = new ArrayList<>(channel.queue);
      all.addAll(channel.lost);
      all.addAll(channel.open);
      channel.queue.clear();
      channel.lost.clear();
      channel.open.clear();
      channel.channel.close(now);
      channel.settle(now);
      transport.disconnect(channel);
      for (LinkCall call : all) {
        end(call, Outcome.failed(Outcome.Cause.CANCELLED, call.wasSent));
      }
    }
    channels.clear();
  }

  // ---- for the transport ------------------------------------------------------------------------

  /** Takes a received frame in. Returns false if the connection is to be ended. */
  public boolean onFrame(ChannelOfBand channel, byte[] frame, long at) {
    now = at;
    if (channel.sealed != null) {
      return channel.sealed.onFrame(frame, now);
    }
    channel.channel.onFrame(frame, now);
    return true;
  }

  /** The channel's connection ended, or could not be opened. */
  public void onDisconnected(ChannelOfBand channel, boolean wasConnected, long at) {
    now = at;
    List<LinkCall> open = new ArrayList<>(channel.open);
    channel.open.clear();
    channel.channel.reset();
    if (channel.sealed != null) {
      channel.sealed.reset();
    }
    if (!wasConnected) {
      onUnopened(channel, Outcome.failed(Outcome.Cause.UNREACHABLE, false));
    }
    onEndOfSession(channel, open, Outcome.Cause.LOST);
  }

  public long nextTime() {
    long next = Limits.NEVER;
    for (int i = 0; i < channels.size(); ++i) {
      next = Math.min(next, channels.get(i).nextTime());
    }
    return next;
  }

  public void onTime(long at) {
    now = at;
    for (ChannelOfBand channel : List.copyOf(channels)) {
      for (LinkCall expired : channel.takeExpired(now)) {
        end(expired, Outcome.failed(Outcome.Cause.DEADLINE, expired.wasSent));
      }
      if (channel.channel.nextTime() <= now) {
        channel.channel.onTime(now);
        channel.settle(now);
      }
      if (channel.isReady() && channel.lastUsed + PING_INTERVAL <= now) {
        keepAlive(channel);
      }
    }
  }

  private void keepAlive(ChannelOfBand channel) {
    channel.lastUsed = now;
    // sec-6-5: an idle session with old keys is closed; the next call opens one with new keys.
    if (channel.sealed != null && channel.sealed.isRenewalDue(now) && channel.isIdle()) {
      channel.channel.close(now);
      return;
    }
    LinkCall ping =
        LinkCall.ofSession(
            Limits.METHOD_PING, channel.priority, now + PING_PATIENCE, Bytes.NONE, outcome -> {});
    ping.channel = channel;
    channel.queue.add(ping);
    pump(channel);
  }

  // ---- calls ------------------------------------------------------------------------------------

  // Puts a call into the queue of the channel for its priority.
  private void route(LinkCall call) {
    if (isClosed) {
      end(call, Outcome.failed(Outcome.Cause.CANCELLED, false));
      return;
    }
    int priority = call.object == null ? call.priority : call.object.priorityFor(call.priority);
    ChannelOfBand channel = null;
    for (int i = 0; i < channels.size(); ++i) {
      if (channels.get(i).serves(priority)) {
        channel = channels.get(i);
      }
    }
    if (channel == null) {
      if (channels.size() == CHANNEL_COUNT_MAX) {
        end(call, Outcome.failed(Outcome.Cause.OVERLOAD, false));
        return;
      }
      channel = newChannel(priority);
    }
    if (channel.queue.size() >= QUEUE_SIZE_MAX) {
      end(call, Outcome.failed(Outcome.Cause.OVERLOAD, false));
      return;
    }
    call.channel = channel;
    channel.queue.add(call);
    pump(channel);
  }

  private ChannelOfBand newChannel(int priority) {
    ChannelOfBand channel = new ChannelOfBand(this, priority);
    FrameSink sink = transport.connect(channel);
    boolean isSealed = config.own != null;
    if (isSealed) {
      channel.sealed =
          new SealedClient(
              new SealedClient.Config(
                  config.medium,
                  config.own,
                  config.serverKey,
                  config.presharedKey,
                  Suite.ALL,
                  config.random.getAsInt()),
              sink);
    }
    channel.channel =
        new ClientChannel(
            new ClientChannel.Config(
                config.medium,
                config.clientEpoch,
                config.channelNumbers.getAsLong(),
                config.clockDomain,
                config.messageSizeMax,
                Limits.CALL_WINDOW,
                config.random.getAsInt(),
                isSealed ? Sealing.payloadSizeMax(config.medium) : Integer.MAX_VALUE),
            isSealed ? channel.sealed : sink,
            channel);
    if (isSealed) {
      channel.sealed.attach(channel.channel);
    }
    channel.channel.setOnHost(config.isOnHost);
    channels.add(channel);
    return channel;
  }

  /** Sends what waits, as far as the session takes it. */
  void pump(ChannelOfBand channel) {
    // A handler may call; then the outer loop goes on with what it added.
    if (isPumping) {
      return;
    }
    isPumping = true;
    try {
      boolean hasProgress = true;
      while (hasProgress) {
        hasProgress = false;
        // A call may add a channel.
        for (int i = 0; i < channels.size(); ++i) {
          hasProgress |= pumpOne(channels.get(i));
        }
      }
    } finally {
      isPumping = false;
    }
  }

  private boolean pumpOne(ChannelOfBand channel) {
    if (channel.queue.isEmpty() && channel.lost.isEmpty()) {
      return false;
    }
    if (!channel.isReady()) {
      if (!channel.channel.isOpening()) {
        openSession(channel);
      }
      // Over shared state an answer may have come at once.
      return channel.isReady();
    }
    boolean hasProgress = false;
    while (!channel.queue.isEmpty() && channel.isReady()) {
      LinkCall call = channel.queue.peek();
      if (!mayGo(channel, call)) {
        break;
      }
      channel.queue.remove(call);
      hasProgress = true;
      start(channel, call);
    }
    return hasProgress;
  }

  // A bind needs a place, too; a call that only waits for the session needs none.
  private boolean mayGo(ChannelOfBand channel, LinkCall call) {
    boolean needsPlace = call.method != METHOD_READY || !isBound(channel, call);
    return !needsPlace || channel.channel.hasFreeCall();
  }

  private static boolean isBound(ChannelOfBand channel, LinkCall call) {
    return call.object == null
        || call.object.epoch == channel.channel.welcome().serverEpoch();
  }

  private void start(ChannelOfBand channel, LinkCall call) {
    if (!isBound(channel, call)) {
      // hp-6.1-4
      call.object.waiting.add(call);
      if (!call.object.isBinding) {
        beginBind(channel, call);
      }
      return;
    }
    int priority = call.object == null ? call.priority : call.object.priorityFor(call.priority);
    if (!channel.channel.welcome().serves(priority)) {
      route(call);
      return;
    }
    if (call.method == METHOD_READY) {
      end(call, Outcome.replied(Status.OK, Bytes.NONE));
      return;
    }
    send(channel, call, priority);
  }

  private void send(ChannelOfBand channel, LinkCall call, int priority) {
    int service = call.object == null ? call.service : call.object.service();
    call.channel = channel;
    call.wasSent = true;
    call.epoch = channel.channel.welcome().serverEpoch();
    call.begun = now;
    channel.lastUsed = now;
    if (!begin(channel, call, service, priority)) {
      call.wasSent = false;
      end(call, Outcome.failed(Outcome.Cause.TOO_LARGE, false));
      return;
    }
    if (call.delivery == Delivery.SENT) {
      end(call, Outcome.replied(Status.OK, Bytes.NONE));
      return;
    }
    channel.open.add(call);
    channel.settle(now);
  }

  private boolean begin(ChannelOfBand channel, LinkCall call, int service, int priority) {
    if (call.isReused() && call.callChannel == channel) {
      return channel.channel.again(
          call.call, service, priority, call.traceId, call.deadline, now);
    }
    CallParameters parameters =
        call.streamWindow > 0
            ? CallParameters.stream(
                service,
                call.method,
                priority,
                call.traceId,
                call.deadline,
                call.streamWindow,
                byteWindow())
            : CallParameters.call(
                service, call.method, priority, call.traceId, call.deadline, call.delivery);
    ClientChannel.Call begun = channel.channel.call(parameters, call.payload, now);
    if (begun == null) {
      return false;
    }
    begun.attachment = call;
    call.call = begun;
    if (call.isReused()) {
      // A connection keeps frames that do not fit its buffer, and a seal makes its own.
      boolean reusesFrame = config.medium == Medium.DATAGRAM && !isSealed();
      channel.channel.reuse(begun, call.replyMemory(), reusesFrame);
      call.callChannel = channel;
    }
    return true;
  }

  // RTPM's clients take as many bytes of a stream as fragments may be on their way (hp-9).
  private int byteWindow() {
    return config.medium == Medium.STREAM ? 4 * Medium.STREAM.payloadSizeMax : 0;
  }

  void end(LinkCall call, Outcome outcome) {
    if (!call.isOver) {
      call.isOver = true;
      call.handler.onEnd(outcome);
    }
  }

  // ---- binds ------------------------------------------------------------------------------------

  private void beginBind(ChannelOfBand channel, LinkCall first) {
    LinkObject object = first.object;
    object.isBinding = true;
    BindRequest request = new BindRequest(object.fingerprint, object.path, object.interfaceName);
    send(
        channel,
        LinkCall.ofSession(
            Limits.METHOD_BIND,
            channel.priority,
            first.deadline,
            request.payload(),
            outcome -> onBound(channel, object, outcome)),
        channel.priority);
  }

  private void onBound(ChannelOfBand channel, LinkObject object, Outcome outcome) {
    BindReply reply = outcome.isOk() ? BindReply.read(outcome.payload()) : null;
    if (reply == null) {
      // hp-6.1-5: a malformed reply is none.
      finishBind(
          object,
          outcome.isOk() ? Outcome.failed(Outcome.Cause.NOT_UNDERSTOOD, false) : outcome);
    } else if (object.understands(reply)) {
      take(channel, object, reply);
    } else {
      describe(channel, object, reply);
    }
  }

  private void take(ChannelOfBand channel, LinkObject object, BindReply reply) {
    object.bound = reply;
    object.epoch = channel.channel.welcome().serverEpoch();
    finishBind(object, null);
  }

  // hp-6.1-2, hp-6.3: perhaps the two versions understand each other by their texts.
  private void describe(ChannelOfBand channel, LinkObject object, BindReply reply) {
    byte[] request = new byte[4];
    Bytes.put32(request, 0, reply.service());
    LinkCall describe =
        LinkCall.ofSession(
            Limits.METHOD_DESCRIBE,
            channel.priority,
            object.waiting.isEmpty() ? now + PING_PATIENCE : object.waiting.get(0).deadline,
            request,
            outcome -> {
              String text = new String(outcome.payload(), java.nio.charset.StandardCharsets.UTF_8);
              boolean isUnderstood =
                  outcome.isOk()
                      && !object.text.isEmpty()
                      && InterfaceText.findObstacle(object.text, text) == null;
              if (isUnderstood) {
                take(channel, object, reply);
              } else {
                finishBind(object, Outcome.failed(Outcome.Cause.NOT_UNDERSTOOD, false));
              }
            });
    channel.queue.addFirst(describe);
    describe.channel = channel;
    pump(channel);
  }

  // `failure`: null if it is bound.
  private void finishBind(LinkObject object, Outcome failure) {
    object.isBinding = false;
    List<LinkCall> waiting = new ArrayList<>(object.waiting);
    object.waiting.clear();
    for (LinkCall call : waiting) {
      if (failure == null) {
        route(call);
      } else {
        end(call, new Outcome(failure.cause(), failure.status(), failure.payload(), false));
      }
    }
  }

  // ---- sessions ---------------------------------------------------------------------------------

  void openSession(ChannelOfBand channel) {
    channel.lastUsed = now;
    channel.channel.open(channel.priority, channel.latestDeadline(), now);
    channel.settle(now);
  }

  void onReady(ChannelOfBand channel) {
    long epoch = channel.channel.welcome().serverEpoch();
    List<LinkCall> lost = new ArrayList<>(channel.lost);
    channel.lost.clear();
    for (int i = lost.size() - 1; i >= 0; --i) {
      LinkCall call = lost.get(i);
      // hp-5.5-2
      boolean isSafe = ClientChannel.hasNotRun(call.epoch, epoch, call.begun, now);
      if (isSafe || call.mayRepeat()) {
        call.wasSent = !isSafe;
        channel.queue.addFirst(call);
      } else {
        end(call, Outcome.failed(Outcome.Cause.LOST, true));
      }
    }
    pump(channel);
  }

  // No session could be opened: what waits for it fails.
  void onUnopened(ChannelOfBand channel, Outcome outcome) {
    if (config.medium == Medium.STREAM) {
      transport.disconnect(channel); // sec-3.2-3
    }
    List<LinkCall> waiting = new ArrayList<>(channel.lost);
    waiting.addAll(channel.queue);
    channel.lost.clear();
    channel.queue.clear();
    for (LinkCall call : waiting) {
      boolean isLate = call.deadline <= now;
      end(
          call,
          new Outcome(
              isLate && outcome.status() == null ? Outcome.Cause.DEADLINE : outcome.cause(),
              outcome.status(),
              outcome.payload(),
              call.wasSent));
    }
  }

  void onEndOfSession(ChannelOfBand channel, List<LinkCall> open, Outcome.Cause cause) {
    for (LinkCall call : open) {
      if (call.deadline > now && call.mayRepeat()) {
        channel.queue.add(call);
      } else {
        end(call, Outcome.failed(cause, true));
      }
    }
    pump(channel);
  }
}
